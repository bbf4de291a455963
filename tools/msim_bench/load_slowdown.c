/* Measures how much slower steps are while the other cores are busy. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "interrupt.h"
#include "linear.h"
#include "linear_report.h"

enum { CANDIDATES = 3 };

/* A candidate of a solver comparison, run with the other cores idle or busy. */
typedef struct load_condition {
  timing_candidate *inner;
  const background_load *spinner; /* NULL: idle */
} load_condition;

/* Times the mean of 4 consecutive runs, as a single one may fall into a favourable time slice,
 * after untimed runs in which the threads adapt to the load. */
static int run_condition(timing_candidate *c, timing_sample *s) {
  enum { RUNS = 4 };
  const double USED_TO_IT = 0.1;
  const load_condition *run = c->data;
  const double start = clock_seconds();
  timing_sample one = {0};
  if (run->spinner) background_load_toggle(run->spinner);
  int good = run->inner->run(run->inner, &one);
  run->inner->nsamples = 1; /* warmed up */
  while (good && clock_seconds() - start < USED_TO_IT) good = run->inner->run(run->inner, &one);
  for (int i = 0; i < RUNS && good; i++) {
    good = run->inner->run(run->inner, &one);
    s->whole += one.whole / RUNS;
  }
  if (run->spinner) background_load_toggle(run->spinner);
  if (!good) memcpy(c->reason, run->inner->reason, sizeof c->reason);
  return good;
}

static void report_slowdown_key(report *out, const char *solver, const bench_scene *scene,
                                double slowdown) {
  char key[80];
  snprintf(key, sizeof key, "%.31s_slowdown_when_other_core_busy_%s", solver, scene->name);
  report_key(out, key, slowdown);
}

void init_slowdown_keys(report *out, const bench_scene *scene) {
  report_slowdown_key(out, "auto", scene, NAN);
  report_slowdown_key(out, "cholmod", scene, NAN);
}

static void report_slowdown(report *out, const solver_comparison *r, const timing_candidate *idle,
                            const timing_candidate *busy, int spinners) {
  const double slowdown = median_ratio(busy, whole_seconds, idle, whole_seconds);
  json_t *row = add_step_row(out, "busy", r->moving, r->system.h);
  put_text(row, "solver", idle->name);
  put_text(row, "status", busy->failed || idle->failed ? "failed" : "ok");
  if (busy->failed) put_text(row, "reason", busy->reason);
  put_integer(row, "busy_cores", spinners);
  put_real(row, "idle_ms", 1e3 * median_of(idle, whole_seconds));
  put_real(row, "idle_spread", spread_of(idle, whole_seconds));
  put_real(row, "busy_ms", 1e3 * median_of(busy, whole_seconds));
  put_real(row, "busy_spread", spread_of(busy, whole_seconds));
  put_real(row, "slowdown", slowdown);
  if (isfinite(slowdown))
    printf(" %-19s %7.4g ms idle, %7.4g ms with %d busy core%s: %.3g times\n", idle->name,
           1e3 * median_of(idle, whole_seconds), 1e3 * median_of(busy, whole_seconds), spinners,
           spinners == 1 ? "" : "s", slowdown);
  if (strcmp(idle->measure, "step") == 0)
    report_slowdown_key(out, idle->name, r->moving->kind, slowdown);
}

/* Times all candidates of r, each with the other cores idle and with them busy. */
static void run_conditions(linear_bench *b, solver_comparison *r, const timing_limits *p) {
  load_condition conditions[2 * CANDIDATES];
  timing_candidate all[2 * CANDIDATES] = {{.nsamples = 0}};
  int count = 0;
  for (int i = 0; i < 2 * r->count; i++) {
    timing_candidate *inner = &r->all[i / 2], *c = &all[count];
    if (inner->failed) continue;
    conditions[count] = (load_condition){inner, i % 2 ? &b->spinner : NULL};
    memcpy(c->name, inner->name, sizeof c->name);
    c->family = "busy";
    c->measure = inner->measure;
    c->run = run_condition;
    c->data = &conditions[count++];
  }
  time_in_turn(all, count, p);
  for (int i = 0; i + 1 < count && !is_interrupted(); i += 2)
    report_slowdown(b->report, r, &all[i], &all[i + 1], b->spinner.count);
}

void measure_slowdown(linear_bench *b, const moving_scene *m, double h, const timing_limits *p) {
  msim_error err;
  solver_comparison *r =
      b->spinner.count > 0 ? solver_comparison_create(m, h, 1e-6, 1, &err) : NULL;
  if (!r) return;
  solver_comparison_add_step(r, "auto", NULL, m->threads);
  solver_comparison_add_step(r, "cholmod", NULL, m->threads);
  if (reference_program_send_system(&b->cholmod, &r->system))
    solver_comparison_add_reference(r, "default", &b->cholmod, 0);
  run_conditions(b, r, p);
  solver_comparison_free(r);
}
