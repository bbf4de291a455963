/* skip - benchmark of what skipping features saves: each scene with the skip, without it, and
 * without it by CHOLMOD in every step, the general direct method */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/message.h"
#include "benches.h"
#include "interrupt.h"
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

static int fail_skip_run(timing_candidate *c, const char *why) {
  snprintf(c->reason, sizeof c->reason, "%s", why);
  return 0;
}

/* Makes the same steps in each sample. Setting the state discards lagged factorizations, so that
 * each sample includes making them. */
static int run_skip_series(timing_candidate *c, timing_sample *s) {
  const skip_run *r = c->data;
  msim_scene_view view = {.size = sizeof view};
  msim_error err;
  msim_scene_get(r->scene, &view);
  const msim_state start = {
      .size = sizeof start, .n = view.nparticles, .x = view.x, .v = view.v, .h = r->what->h};
  if (msim_sim_set_state(r->sim, &start, &err)) return fail_skip_run(c, err.text);
  return time_series(r->sim, r->what->series, INFINITY, s, &err) ? 1 : fail_skip_run(c, err.text);
}

/* Makes steps for SECONDS; the next sample continues from there. */
static int run_continued_steps(timing_candidate *c, timing_sample *s) {
  const double SECONDS = 0.05;
  const skip_run *r = c->data;
  const double start = clock_seconds();
  int64_t steps = 0;
  msim_error err;
  do {
    if (msim_sim_step(r->sim, 1, &err) != MSIM_OK) return fail_skip_run(c, err.text);
    steps++;
    s->whole = clock_seconds() - start;
  } while (s->whole < SECONDS && !is_interrupted());
  s->whole /= (double)steps;
  return 1;
}

static msim_status make_skip_sim(const bench_options *wishes, int way, skip_run *r,
                                 msim_error *err) {
  const skip_case *what = r->what;
  msim_options options =
      implicit_options(what->h, 1e-6, way == DIRECT ? "cholmod" : "auto", wishes->threads);
  options.integrator = what->integrator;
  msim_status status = MSIM_OK;
  for (int i = 0; i < MOST_OFF && what->off[i] && way != ON && !status; i++)
    status = msim_options_set(&options, what->off[i], "off", err);
  if (!status) status = msim_scene_create(NULL, &r->scene, err);
  if (!status) status = what->build(way != ON, r->scene, err);
  if (!status) status = msim_sim_create(r->scene, &options, &r->sim, err);
  return status;
}

static void add_skip_run(const bench_options *wishes, const skip_case *what, int way, skip_run *r,
                         timing_candidate *c) {
  msim_error err = {0, "out of memory for the scene"};
  *r = (skip_run){.what = what};
  *c = (timing_candidate){.family = ways[way], .measure = "step", .data = r};
  c->run = what->series ? run_skip_series : run_continued_steps;
  snprintf(c->name, sizeof c->name, "%s", ways[way]);
  c->residual = NAN;
  c->failed = make_skip_sim(wishes, way, r, &err) != MSIM_OK;
  if (c->failed) fail_skip_run(c, err.text);
}

/*------------------------------------- what was found -------------------------------------------*/

static json_t *add_skip_row(report *out, const char *measure, const skip_case *what) {
  json_t *row = report_add_row(out, measure);
  put_text(row, "skip", what->name);
  put_text(row, "scene", what->scene);
  put_text(row, "integrator", what->integrator);
  put_real(row, "h", what->h);
  return row;
}

static void report_way(report *out, const skip_case *what, const timing_candidate *c) {
  json_t *row = add_skip_row(out, "step", what);
  const int ran = !c->failed && c->nsamples > 0;
  put_text(row, "way", c->name);
  put_text(row, "status", ran ? "ok" : c->failed ? "failed" : "left out");
  if (!ran) {
    put_text(row, "reason", c->failed ? c->reason : "there was no time left");
    printf(" %-12s %s\n", c->name, c->failed ? c->reason : "there was no time left");
    return;
  }
  const skip_run *r = c->data;
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(r->sim, &plan);
  put_text(row, "solver", plan.solver);
  put_real(row, "ms", 1e3 * median_of(c, whole_seconds));
  if (what->series) {
    put_integer(row, "series", what->series);
    put_real(row, "median_ms", 1e3 * median_of(c, median_seconds));
    put_real(row, "least_kinetic", median_of(c, kinetic_energy));
  }
  put_real(row, "spread", spread_of(c, whole_seconds));
  put_integer(row, "repeats", c->nsamples > 1 ? c->nsamples - 1 : 1);
  printf(" %-12s %10.4g ms  +-%3.0f%%  %s\n", c->name, 1e3 * median_of(c, whole_seconds),
         100 * spread_of(c, whole_seconds), plan.solver);
}

/* Reports the time of the slower way over that of the faster one. */
static double report_skip_factor(report *out, const skip_case *what, const timing_candidate *slow,
                                 const timing_candidate *fast) {
  if (slow->failed || fast->failed) return NAN;
  const double factor = median_ratio(slow, whole_seconds, fast, whole_seconds);
  if (!isfinite(factor)) return NAN;
  json_t *row = add_skip_row(out, "factor", what);
  put_text(row, "over", slow->name);
  put_text(row, "under", fast->name);
  put_real(row, "factor", factor);
  printf(" %.4g times as fast as %s\n", factor, slow->name);
  return factor;
}

static int is_implicit(const skip_case *what) {
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++)
    if (strcmp(entry->name, what->integrator) == 0) return entry->implicit;
  return 0;
}

static void measure_skip_case(const bench_options *wishes, const skip_case *what,
                              const timing_limits *p, report *out) {
  static timing_candidate all[WAYS];
  skip_run runners[WAYS];
  const int count = is_implicit(what) ? WAYS : DIRECT;
  printf("\n%s: %s, %s, h = %g s\n", what->name, what->scene, what->integrator, what->h);
  fflush(stdout);
  for (int way = 0; way < count; way++) add_skip_run(wishes, what, way, &runners[way], &all[way]);
  time_in_turn(all, count, p);
  if (!is_interrupted()) {
    for (int way = 0; way < count; way++) report_way(out, what, &all[way]);
    report_skip_factor(out, what, &all[OFF], &all[ON]);
    if (count == WAYS) {
      const double factor = report_skip_factor(out, what, &all[DIRECT], &all[ON]);
      if (what->key) report_key(out, what->key, factor);
    }
  }
  for (int way = 0; way < count; way++) {
    msim_sim_destroy(runners[way].sim);
    msim_scene_destroy(runners[way].scene);
  }
}

int bench_skip(const bench_options *wishes, report *r) {
  const skip_case *what;
  if (wishes->nscenes)
    return report_usage_error("",
                              "--scene is not for the bench 'skip', which has scenes of its own");
  timing_limits p = {.max_rounds = wishes->quick ? 7 : 15,
                     .budget = wishes->quick ? 8 : 30,
                     .min_rounds = 5,
                     .until = clock_seconds() + (wishes->quick ? 50 : 600)};
  for (int i = 0; (what = skip_case_info(i)) != NULL && !is_interrupted(); i++)
    measure_skip_case(wishes, what, &p, r);
  return 0;
}
