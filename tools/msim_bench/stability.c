/* stability - benchmark of stability limits and energy growth against theory, and of scenes in
 * which methods break down: no run may become unstable without a report */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/message.h"
#include "benches.h"
#include "interrupt.h"
#include "stability_limits.h"
#include "watch_overhead.h"
#include "stress.h"
#include "../bench_reference/theory.h"

enum { MOST_METHODS = 32 };

typedef struct outcome_counts {
  int64_t cells, by[STRESS_OUTCOMES], late;
} outcome_counts;

static void record_cell(const stress_scene *s, const char *method, double h, const stress_result *c,
                        report *r, outcome_counts *t) {
  json_t *row = report_add_row(r, "cell");
  put_text(row, "scene", s->name);
  put_text(row, "method", method);
  put_real(row, "h", h);
  put_text(row, "outcome", stress_words[c->outcome]);
  if (*c->text) put_text(row, "reason", c->text);
  if (c->detection_steps >= 0) put_integer(row, "late", c->detection_steps);
  t->cells += c->outcome != UNSUPPORTED;
  t->by[c->outcome]++;
  if (c->detection_steps > t->late) t->late = c->detection_steps;
  if (c->outcome >= SILENT && c->outcome != UNSUPPORTED)
    printf(" %s, %s, h = %g s: %s %s\n", s->name, method, h, stress_words[c->outcome], c->text);
}

/* Runs all scenes and steps with one method. */
static void measure_method(const char *method, const bench_options *wishes, report *r,
                           outcome_counts *t) {
  static const double all[] = {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1}, few[] = {1e-3, 0.1};
  const double *h = wishes->quick ? few : all;
  const int n = wishes->quick ? 2 : 7;
  const stress_scene *s;
  for (int i = 0; (s = stress_info(i)) != NULL; i++)
    for (int k = 0; k < n && !is_interrupted(); k++) {
      const int64_t usual = wishes->quick ? 300 : 1000;
      const int64_t steps = s->steps > 0 && h[k] == 1e-3 && !wishes->quick ? s->steps : usual;
      const stress_result c = stress_run(s, method, h[k], steps, MSIM_WATCH_ON, 60);
      record_cell(s, method, h[k], &c, r, t);
    }
}

static void add_counts(const outcome_counts *more, outcome_counts *to) {
  to->cells += more->cells;
  for (int o = 0; o < STRESS_OUTCOMES; o++) to->by[o] += more->by[o];
  if (more->late > to->late) to->late = more->late;
}

static void measure_cells(const bench_options *wishes, report *r) {
  const msim_integrator_entry *entry;
  outcome_counts sum = {0};
  printf("\nstress\n %-24s", "method");
  for (int o = 0; o < STRESS_OUTCOMES; o++) printf(" %10s", stress_words[o]);
  printf(" %8s\n", "share");
  for (int32_t m = 0; (entry = msim_integrator_info(m)) != NULL && !is_interrupted(); m++) {
    outcome_counts t = {0};
    if (entry->order == 0) continue;
    measure_method(entry->name, wishes, r, &t);
    const double good = (double)(t.by[STABLE] + t.by[BOUNDED] + t.by[DISSIPATED]);
    json_t *row = report_add_row(r, "method");
    put_text(row, "method", entry->name);
    printf(" %-24s", entry->name);
    for (int o = 0; o < STRESS_OUTCOMES; o++) {
      put_integer(row, stress_words[o], t.by[o]);
      printf(" %10lld", (long long)t.by[o]);
    }
    put_real(row, "share", t.cells ? good / (double)t.cells : NAN);
    printf(" %7.1f%%\n", t.cells ? 100 * good / (double)t.cells : 0);
    fflush(stdout);
    add_counts(&t, &sum);
  }
  report_key(r, "cells", (double)sum.cells);
  report_key(r, "refused", (double)sum.by[UNSUPPORTED]);
  report_key(r, "silent", (double)sum.by[SILENT]);
  report_key(r, "crashes", (double)sum.by[CRASHED]);
  report_key(r, "hangs", (double)sum.by[HUNG]);
  report_key(r, "detection_steps", (double)sum.late);
}

/* Checks that theory.c lists every integrator. */
static int has_theory_of_all(void) {
  const msim_integrator_entry *entry;
  int all = 1;
  for (int32_t m = 0; (entry = msim_integrator_info(m)) != NULL; m++) {
    if (entry->order == 0 || theory_find(entry->name)) continue;
    report_error("no theory of the integrator '%s' is known", entry->name);
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
  report_error("the judge takes a run that blows up for one that is %s", stress_words[r.outcome]);
  return 0;
}

int bench_stability(const bench_options *wishes, report *r) {
  if (wishes->nscenes)
    return report_usage_error(
        "", "--scene is not for the bench 'stability', which has scenes of its own");
  if (!has_theory_of_all() || !detects_instability()) return EXIT_ERROR;
  const double error = measure_limits(wishes->quick, r);
  if (!is_interrupted()) report_key(r, "limit_error", error);
  if (!is_interrupted()) measure_drift(wishes->quick, r);
  if (!is_interrupted()) measure_cells(wishes, r);
  if (!is_interrupted() && !wishes->quick) report_key(r, "watch_overhead", watch_overhead());
  return 0;
}
