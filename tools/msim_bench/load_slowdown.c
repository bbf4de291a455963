/* Measures how much slower steps are while the other cores are busy. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"
#include "linear.h"

enum { CANDIDATES = 3 };

/* A candidate of a solver comparison, run with the other cores idle or busy. */
typedef struct load_condition {
  timing_candidate *inner;
  const background_load *load; /* NULL: idle */
} load_condition;

/* Times the mean of 4 consecutive runs, as a single one may fall into a favourable time slice,
 * after untimed runs in which the threads adapt to the load. */
static int run_condition(timing_candidate *c, timing_sample *s) {
  enum { RUNS = 4 };
  const double USED_TO_IT = 0.1;
  const load_condition *run = c->data;
  const double start = clock_seconds();
  timing_sample one = {0};
  if (run->load) background_load_toggle(run->load);
  int good = run->inner->run(run->inner, &one);
  run->inner->nsamples = 1; /* warmed up */
  while (good && clock_seconds() - start < USED_TO_IT) good = run->inner->run(run->inner, &one);
  for (int i = 0; i < RUNS && good; i++) {
    good = run->inner->run(run->inner, &one);
    s->whole += one.whole / RUNS;
  }
  if (run->load) background_load_toggle(run->load);
  if (!good) memcpy(c->reason, run->inner->reason, sizeof c->reason);
  return good;
}

static void report_slowdown(report *out, const solver_comparison *r, const timing_candidate *idle,
                            const timing_candidate *busy, int cores) {
  const double slowdown = median_ratio(busy, whole_seconds, idle, whole_seconds);
  const double idle_ms = 1e3 * median_of(idle, whole_seconds),
               busy_ms = 1e3 * median_of(busy, whole_seconds);
  const timing_candidate *failed = idle->failed ? idle : busy->failed ? busy : NULL;
  char ratio[48];
  add_step_row(
      out, "busy", r->moving, r->system.h,
      FIELDS(TEXT("solver", idle->name),
             TEXT("status", failed               ? "failed"
                            : isfinite(slowdown) ? "ok"
                                                 : "left out"),
             TEXT("reason", failed               ? failed->reason
                            : isfinite(slowdown) ? NULL
                                                 : NO_TIME),
             INTEGER("busy_cores", cores), REAL("idle_ms", idle_ms),
             REAL("idle_spread", spread_of(idle, whole_seconds)), REAL("busy_ms", busy_ms),
             REAL("busy_spread", spread_of(busy, whole_seconds)), REAL("slowdown", slowdown)));
  if (isfinite(slowdown))
    printf(" %-19s %7.4g ms idle, %7.4g ms with %d busy core%s: %.3g times as long\n", idle->name,
           idle_ms, busy_ms, cores, cores == 1 ? "" : "s", slowdown);
  snprintf(ratio, sizeof ratio, "%.31s_slowdown", idle->name);
  report_case_key(out, ratio, r->moving->kind->name, r->moving->k, r->system.h, slowdown);
}

/* Times all candidates of r, each with the other cores idle and with them busy. */
static void run_conditions(linear_bench *b, solver_comparison *r, const timing_limits *p) {
  load_condition conditions[2 * CANDIDATES];
  timing_candidate all[2 * CANDIDATES];
  int count = 0;
  for (int i = 0; i < 2 * r->count; i++) {
    timing_candidate *inner = &r->all[i / 2], *c = &all[count];
    if (inner->failed) continue;
    conditions[count] = (load_condition){inner, i % 2 ? &b->load : NULL};
    candidate_init(c, inner->name, inner->measure, run_condition, &conditions[count++]);
  }
  time_in_turn(all, count, p);
  for (int i = 0; i + 1 < count && !is_interrupted(); i += 2)
    report_slowdown(b->report, r, &all[i], &all[i + 1], b->load.count);
}

void measure_slowdown(linear_bench *b, const moving_scene *m, double h, const timing_limits *p) {
  msim_error err;
  solver_comparison *r = b->load.count > 0 ? solver_comparison_create(m, h, 1e-6, 1, &err) : NULL;
  if (!r) return;
  solver_comparison_add_step(r, "auto", NULL, m->threads);
  solver_comparison_add_step(r, "cholmod", NULL, m->threads);
  if (solver_comparison_send(r, &b->cholmod))
    solver_comparison_add_reference(r, "default", &b->cholmod, 0);
  run_conditions(b, r, p);
  solver_comparison_free(r);
}
