/* skip - benchmark of what skipping features saves: each scene with the skip, without it, and
 * without it by CHOLMOD in every step, the general direct method */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"
#include "benches.h"
#include "skip_cases.h"
#include "timing.h"

enum { ON, OFF, DIRECT, WAYS };

static const char *const ways[WAYS] = {"on", "off", "off, cholmod"};

/* Data of one of the three ways. */
typedef struct skip_run {
  const skip_case *what;
  msim_scene *scene;
  msim_sim *sim;
} skip_run;

static int run_skip_series(timing_candidate *c, timing_sample *s) {
  const skip_run *r = c->data;
  msim_scene_view view = {.size = sizeof view};
  msim_error err;
  msim_scene_get(r->scene, &view);
  const msim_state start = {
      .size = sizeof start, .n = view.nparticles, .x = view.x, .v = view.v, .h = r->what->h};
  const msim_status status = time_steps(r->sim, &start, r->what->series, INFINITY, s, &err);
  return status ? candidate_fail(c, err.text) : 1;
}

/* Makes steps for SECONDS; the next sample continues from there. */
static int run_continued_steps(timing_candidate *c, timing_sample *s) {
  const double SECONDS = 0.05;
  const skip_run *r = c->data;
  const double start = clock_seconds();
  int64_t steps = 0;
  msim_error err;
  do {
    if (msim_sim_step(r->sim, 1, &err) != MSIM_OK) return candidate_fail(c, err.text);
    steps++;
    s->whole = clock_seconds() - start;
  } while (s->whole < SECONDS && !is_interrupted());
  s->whole /= (double)steps;
  return 1;
}

/* option: NAME, to be off, or NAME=VALUE */
static msim_status set_off(const char *option, msim_options *options, msim_error *err) {
  char name[64];
  const char *value = strchr(option, '=');
  snprintf(name, sizeof name, "%.*s", (int)strcspn(option, "="), option);
  return msim_options_set(options, name, value ? value + 1 : "off", err);
}

static msim_status make_skip_sim(int32_t threads, int way, skip_run *r, msim_error *err) {
  const skip_case *what = r->what;
  msim_options options =
      implicit_options(what->h, 1e-6, way == DIRECT ? "cholmod" : "auto", threads);
  options.integrator = what->integrator;
  const char *const off[] = {what->off, what->also_off};
  msim_status status = MSIM_OK;
  for (int i = 0; i < 2 && off[i] && way != ON && !status; i++)
    status = set_off(off[i], &options, err);
  if (!status) status = msim_scene_create(NULL, &r->scene, err);
  if (!status) status = skip_case_build(what, way != ON, r->scene, err);
  if (!status) status = msim_sim_create(r->scene, &options, &r->sim, err);
  return status;
}

static void add_skip_run(int32_t threads, const skip_case *what, int way, skip_run *r,
                         timing_candidate *c) {
  msim_error err = {0, "out of memory for the scene"};
  *r = (skip_run){.what = what};
  candidate_init(c, ways[way], "step", what->series ? run_skip_series : run_continued_steps, r);
  c->failed = make_skip_sim(threads, way, r, &err) != MSIM_OK;
  if (c->failed) candidate_fail(c, err.text);
}

/*------------------------------------- results --------------------------------------------------*/

static const column columns[] = {{"", "way", -12, NULL, 0},
                                 {"ms", "ms", 10, "%.4g", 0},
                                 {"+-", "spread", 4, "%.0f%%", 100},
                                 {"solver", "solver", -8, NULL, 0},
                                 {.key = NULL}};

static json_t *add_skip_row(report *out, const char *measure, const skip_case *what) {
  return report_add_row(out, measure,
                        FIELDS(TEXT("skip", what->name), TEXT("scene", what->scene),
                               TEXT("integrator", what->integrator), REAL("h", what->h)));
}

static void report_way(report *out, const skip_case *what, const timing_candidate *c) {
  const skip_run *r = c->data;
  json_t *row = add_skip_row(out, "step", what);
  msim_plan plan = {.size = sizeof plan};
  put_fields(row, FIELDS(TEXT("way", c->name)));
  put_result(row, c, "ms", 1e3);
  if (has_result(c)) {
    msim_sim_plan(r->sim, &plan);
    put_fields(row, FIELDS(TEXT("solver", plan.solver)));
    if (what->series)
      put_fields(row, FIELDS(INTEGER("series", what->series),
                             REAL("median_ms", 1e3 * median_of(c, median_seconds)),
                             REAL("least_kinetic", median_of(c, kinetic_energy))));
  }
  print_row(columns, row);
}

/* Reports the time of the slower way over that of the faster one. */
static double report_skip_factor(report *out, const skip_case *what, const timing_candidate *slow,
                                 const timing_candidate *fast) {
  const double factor =
      slow->failed || fast->failed ? NAN : median_ratio(slow, whole_seconds, fast, whole_seconds);
  if (!isfinite(factor)) return NAN;
  put_fields(add_skip_row(out, "factor", what),
             FIELDS(TEXT("over", slow->name), TEXT("under", fast->name), REAL("factor", factor)));
  printf(" %.4g times as fast as with skip %s\n", factor, slow->name);
  return factor;
}

static int is_implicit(const skip_case *what) {
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++)
    if (strcmp(entry->name, what->integrator) == 0) return entry->implicit;
  return 0;
}

static void measure_skip_case(const bench_run *b, const skip_case *what, const timing_limits *p) {
  static timing_candidate all[WAYS];
  skip_run runs[WAYS];
  const int count = is_implicit(what) ? WAYS : DIRECT;
  printf("\n%s: %s, %s, h = %g s\n", what->name, what->scene, what->integrator, what->h);
  fflush(stdout);
  for (int way = 0; way < count; way++)
    add_skip_run(b->options->threads, what, way, &runs[way], &all[way]);
  time_in_turn(all, count, p);
  if (!is_interrupted()) {
    print_titles(columns);
    for (int way = 0; way < count; way++) report_way(b->report, what, &all[way]);
    for (int way = OFF; way < count; way++) {
      const double factor = report_skip_factor(b->report, what, &all[way], &all[ON]);
      if (way == DIRECT && what->key) report_key(b->report, what->key, factor);
    }
  }
  for (int way = 0; way < count; way++) {
    msim_sim_destroy(runs[way].sim);
    msim_scene_destroy(runs[way].scene);
  }
}

int bench_skip(bench_run *b) {
  const int quick = b->options->quick;
  const timing_limits p = {
      .max_rounds = quick ? 7 : 15, .budget = quick ? 8 : 30, .min_rounds = 5, .until = b->until};
  const skip_case *what;
  for (int i = 0; (what = skip_case_info(i)) != NULL && !is_interrupted(); i++)
    measure_skip_case(b, what, &p);
  return 0;
}
