/* stability - benchmark of stability limits and energy growth against theory, and of scenes in
 * which methods break down: no run may become unstable without a report */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/message.h"
#include "benches.h"
#include "interrupt.h"
#include "limits.h"
#include "overhead.h"
#include "stress.h"
#include "theory.h"

enum { MOST_METHODS = 32 };

typedef struct tally {
  int64_t cells, by[STRESS_OUTCOMES], late;
} tally;

static void note(const stress_scene *s, const char *method, double h, const stress_result *c,
                 report *r, tally *t) {
  json_t *row = report_row(r, "cell");
  put_text(row, "scene", s->name);
  put_text(row, "method", method);
  put_real(row, "h", h);
  put_text(row, "outcome", stress_words[c->outcome]);
  if (*c->text) put_text(row, "reason", c->text);
  if (c->late >= 0) put_integer(row, "late", c->late);
  t->cells += c->outcome != REFUSED;
  t->by[c->outcome]++;
  if (c->late > t->late) t->late = c->late;
  if (c->outcome >= SILENT && c->outcome != REFUSED)
    printf(" %s, %s, h = %g s: %s %s\n", s->name, method, h, stress_words[c->outcome], c->text);
}

/* Runs all scenes and steps with one method. */
static void measure_method(const char *method, const bench_wishes *wishes, report *r, tally *t) {
  static const double all[] = {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1}, few[] = {1e-3, 0.1};
  const double *h = wishes->quick ? few : all;
  const int n = wishes->quick ? 2 : 7;
  const stress_scene *s;
  for (int i = 0; (s = stress_info(i)) != NULL; i++)
    for (int k = 0; k < n && !is_interrupted(); k++) {
      const int64_t usual = wishes->quick ? 300 : 1000;
      const int64_t steps = s->steps > 0 && h[k] == 1e-3 && !wishes->quick ? s->steps : usual;
      const stress_result c = stress_run(s, method, h[k], steps, MSIM_WATCH_ON, 60);
      note(s, method, h[k], &c, r, t);
    }
}

static void add(const tally *more, tally *to) {
  to->cells += more->cells;
  for (int o = 0; o < STRESS_OUTCOMES; o++) to->by[o] += more->by[o];
  if (more->late > to->late) to->late = more->late;
}

static void measure_cells(const bench_wishes *wishes, report *r) {
  const msim_integrator_entry *entry;
  tally sum = {0};
  printf("\nstress\n %-24s", "method");
  for (int o = 0; o < STRESS_OUTCOMES; o++) printf(" %10s", stress_words[o]);
  printf(" %8s\n", "share");
  for (int32_t m = 0; (entry = msim_integrator_info(m)) != NULL && !is_interrupted(); m++) {
    tally t = {0};
    if (entry->order == 0) continue;
    measure_method(entry->name, wishes, r, &t);
    const double good = (double)(t.by[STABLE] + t.by[BOUNDED] + t.by[DISSIPATED]);
    json_t *row = report_row(r, "method");
    put_text(row, "method", entry->name);
    printf(" %-24s", entry->name);
    for (int o = 0; o < STRESS_OUTCOMES; o++) {
      put_integer(row, stress_words[o], t.by[o]);
      printf(" %10lld", (long long)t.by[o]);
    }
    put_real(row, "share", t.cells ? good / (double)t.cells : NAN);
    printf(" %7.1f%%\n", t.cells ? 100 * good / (double)t.cells : 0);
    fflush(stdout);
    add(&t, &sum);
  }
  report_key(r, "cells", (double)sum.cells);
  report_key(r, "refused", (double)sum.by[REFUSED]);
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
    if (entry->order == 0 || theory_of(entry->name)) continue;
    complain("no theory of the integrator '%s' is known", entry->name);
    all = 0;
  }
  return all;
}

/* Self-test: a run that becomes unstable within 20 steps without the energy monitor must be
 * SILENT. */
static int has_a_judge_that_sees(void) {
  const stress_result r =
      stress_run(stress_info(0), "velocity-verlet", 0.1, 20, MSIM_WATCH_OFF, 60);
  if (r.outcome == SILENT) return 1;
  complain("the judge takes a run that blows up for one that is %s", stress_words[r.outcome]);
  return 0;
}

int bench_stability(const bench_wishes *wishes, report *r) {
  if (wishes->nscenes)
    return complain_usage("",
                          "--scene is not for the bench 'stability', which has scenes of its own");
  if (!has_theory_of_all() || !has_a_judge_that_sees()) return EXIT_ERROR;
  const double error = measure_limits(wishes->quick, r);
  if (!is_interrupted()) report_key(r, "limit_error", error);
  if (!is_interrupted()) measure_drift(wishes->quick, r);
  if (!is_interrupted()) measure_cells(wishes, r);
  if (!is_interrupted() && !wishes->quick) report_key(r, "watch_overhead", watch_overhead());
  return 0;
}
