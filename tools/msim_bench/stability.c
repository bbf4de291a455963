/* stability - benchmark of stability limits and energy growth against theory, and of scenes in
 * which methods break down: no run may become unstable without a report */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"
#include "../common/message.h"
#include "benches.h"
#include "stability_limits.h"
#include "watch_overhead.h"
#include "stress.h"
#include "../bench_reference/theory.h"

/* Numbers of outcomes of a method, or of all. */
typedef struct outcome_counts {
  int64_t cells, by[STRESS_OUTCOMES], detection_steps;
} outcome_counts;

static void count_outcome(const stress_result *c, outcome_counts *t) {
  t->cells += c->outcome != UNSUPPORTED;
  t->by[c->outcome]++;
  if (c->detection_steps > t->detection_steps) t->detection_steps = c->detection_steps;
}

static void report_outcome(const stress_scene *s, const char *method, double h,
                           const stress_result *c, report *r) {
  json_t *row = report_add_row(
      r, "cell",
      FIELDS(TEXT("scene", s->name), TEXT("method", method), REAL("h", h),
             TEXT("outcome", stress_words[c->outcome]), TEXT("reason", *c->text ? c->text : NULL)));
  if (c->detection_steps >= 0) put_fields(row, FIELDS(INTEGER("late", c->detection_steps)));
  if (c->outcome >= SILENT && c->outcome != UNSUPPORTED)
    printf(" %s, %s, h = %g s: %s %s\n", s->name, method, h, stress_words[c->outcome], c->text);
}

/* Runs all scenes and steps with one method. */
static void measure_method(const char *method, const bench_run *b, outcome_counts *one,
                           outcome_counts *all) {
  static const double steps[] = {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1}, few[] = {1e-3, 0.1};
  const int quick = b->options->quick, n = quick ? 2 : 7;
  const double *h = quick ? few : steps;
  const int64_t usual = quick ? 300 : 1000;
  const stress_scene *s;
  for (int i = 0; (s = stress_info(i)) != NULL; i++)
    for (int k = 0; k < n && !is_interrupted(); k++) {
      const int64_t count = s->steps > 0 && h[k] == 1e-3 && !quick ? s->steps : usual;
      const stress_result c = stress_run(s, method, h[k], count, MSIM_WATCH_ON, 60);
      report_outcome(s, method, h[k], &c, b->report);
      count_outcome(&c, one);
      count_outcome(&c, all);
    }
}

static void report_method(const char *method, const outcome_counts *t, report *r) {
  const double good = (double)(t->by[STABLE] + t->by[BOUNDED] + t->by[DISSIPATED]);
  const double share = t->cells ? good / (double)t->cells : NAN;
  json_t *row = report_add_row(r, "method", FIELDS(TEXT("method", method), REAL("share", share)));
  printf(" %-24s", method);
  for (int o = 0; o < STRESS_OUTCOMES; o++) {
    put_fields(row, FIELDS(INTEGER(stress_words[o], t->by[o])));
    printf(" %10lld", (long long)t->by[o]);
  }
  printf(" %7.1f%%\n", 100 * share);
  fflush(stdout);
}

static void measure_cells(const bench_run *b) {
  const msim_integrator_entry *entry;
  outcome_counts sum = {0};
  printf("\nnumber of runs by outcome\n %-24s", "method");
  for (int o = 0; o < STRESS_OUTCOMES; o++) printf(" %10s", stress_words[o]);
  printf(" %8s\n", "share");
  for (int32_t m = 0; (entry = msim_integrator_info(m)) != NULL && !is_interrupted(); m++) {
    outcome_counts t = {0};
    if (entry->order == 0) continue;
    measure_method(entry->name, b, &t, &sum);
    report_method(entry->name, &t, b->report);
  }
  report_key(b->report, "cells", (double)sum.cells);
  report_key(b->report, "refused", (double)sum.by[UNSUPPORTED]);
  report_key(b->report, "silent", (double)sum.by[SILENT]);
  report_key(b->report, "crashes", (double)sum.by[CRASHED]);
  report_key(b->report, "hangs", (double)sum.by[HUNG]);
  report_key(b->report, "detection_steps", (double)sum.detection_steps);
}

/* Checks that theory.c lists every integrator. */
static int has_theory_of_all(void) {
  const msim_integrator_entry *entry;
  int all = 1;
  for (int32_t m = 0; (entry = msim_integrator_info(m)) != NULL; m++) {
    if (entry->order == 0 || theory_find(entry->name)) continue;
    report_error("integrator '%s' is missing in theory.c; add its stability limits", entry->name);
    all = 0;
  }
  return all;
}

/* Self-test: a run that becomes unstable within 20 steps without the energy monitor must be
 * SILENT. */
static int detects_instability(void) {
  const stress_result r =
      stress_run(stress_info(0), "velocity-verlet", 0.1, 20, MSIM_WATCH_OFF, 60);
  if (r.outcome == SILENT) return 1;
  report_error("self-test failed: an unstable run was classified as %s instead of silent",
               stress_words[r.outcome]);
  return 0;
}

int bench_stability(bench_run *b) {
  const int quick = b->options->quick;
  if (!has_theory_of_all() || !detects_instability()) return EXIT_ERROR;
  const double error = measure_limits(quick, b->report);
  if (!is_interrupted()) report_key(b->report, "limit_error", error);
  if (!is_interrupted()) measure_drift(quick, b->report);
  if (!is_interrupted()) measure_cells(b);
  if (!is_interrupted() && !quick) report_key(b->report, "watch_overhead", watch_overhead());
  return 0;
}
