#include "setting_sweep.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"

/*------------------------------------- one setting ----------------------------------------------*/

static int run_point(timing_candidate *c, timing_sample *s) {
  sweep_point *r = c->data;
  if (!precision_method_run(r->context, r->method, r->setting, r->until, r->result))
    return candidate_fail(c, r->result->reason);
  s->whole = r->result->seconds;
  r->evaluations = r->result->evaluations;
  return 1;
}

static timing_candidate *add_point(setting_sweep *c, const precision_method *m, double setting,
                                   double until) {
  sweep_point *r = &c->points[c->count];
  timing_candidate *run = &c->all[c->count++];
  *r = (sweep_point){.method = m,
                     .context = &c->context,
                     .setting = setting,
                     .until = until,
                     .result = &c->result};
  candidate_init(run, m->name, "point", run_point, r);
  run->settled = 1;
  return run;
}

/* The first run of a setting, from which its error is measured. */
static void measure_point(const reference_solution *t, timing_candidate *run) {
  sweep_point *r = run->data;
  timing_sample s = {0};
  run->failed = !run_point(run, &s);
  r->status = POINT_FAILED;
  if (run->failed) return;
  r->errors = reference_solution_errors(t, r->result->x, r->result->v);
  run->failed = !(r->errors.error < 1);
  if (run->failed) {
    snprintf(run->reason, sizeof run->reason, "relative error %.1g: above the whole motion",
             r->errors.error);
    return;
  }
  r->status = reference_solution_resolves(t, r->errors.error) ? POINT_MEASURED : POINT_UNRESOLVED;
  run->samples[run->nsamples++] = s;
  run->total_seconds = s.whole;
}

/*------------------------------------- sweeps ---------------------------------------------------*/

/* Expected time of the next run. Halving h doubles the number of steps; dividing tol by 10 at most
 * doubles it for most methods. */
static double next_seconds(const precision_method *m, double seconds) {
  return seconds / (m->by_tol ? 0.5 : m->ratio);
}

/* Where stability limits the step, a tolerance above the error already reached changes nothing.
 * msim's tolerances are relative to the extent, those of SUNDIALS and all errors to the motion. */
static int may_change_nothing(const reference_solution *t, const precision_method *m,
                              double setting, double error) {
  const double unit = m->integrator ? t->extent / t->motion : 1;
  return m->by_tol && setting * unit > error;
}

/* Stops when a run is as accurate as the reference solution, when the next one would exceed the
 * share of the time, or when PATIENCE smaller settings have not reduced the error. */
static void sweep_settings(setting_sweep *c, const precision_method *m, double share) {
  enum { PATIENCE = 3 };
  const reference_solution *t = c->context.reference;
  const double until = clock_seconds() + share;
  double setting = m->first, best = 1;
  for (int i = 0, worse = 0; i < MAX_SWEEP_POINTS && worse < PATIENCE; i++, setting *= m->ratio) {
    const double start = clock_seconds();
    if (is_interrupted() || start > until) return;
    timing_candidate *run = add_point(c, m, setting, until);
    const sweep_point *r = run->data;
    measure_point(t, run);
    if (r->status == POINT_MEASURED && r->errors.error < best) best = r->errors.error, worse = 0;
    else worse += best < 1 && !may_change_nothing(t, m, setting, best);
    if (r->status == POINT_FAILED && c->result.refused) return;
    const double seconds = clock_seconds() - start;
    if (r->status == POINT_UNRESOLVED || next_seconds(m, seconds) > until - clock_seconds()) return;
  }
}

enum { CHOSEN_BY_AUTO, LIBRARY_METHODS, NAMED_METHODS, GROUPS };

static int group_of(const precision_method *m) {
  if (!m->integrator) return LIBRARY_METHODS;
  return strcmp(m->name, AUTO_BY_TOL) == 0 ? CHOSEN_BY_AUTO : NAMED_METHODS;
}

/* Divides the time that one method leaves unused among the following ones. */
static void sweep_group(setting_sweep *c, int group, double until) {
  const precision_methods *list = &c->methods;
  int left = 0;
  for (int i = 0; i < list->count; i++) left += group_of(&list->all[i]) == group;
  for (int i = 0; i < list->count; i++)
    if (group_of(&list->all[i]) == group)
      sweep_settings(c, &list->all[i], (until - clock_seconds()) / left--);
}

/* Each group gets a third of the time, so that all groups have results to compare. */
static void sweep_all_groups(setting_sweep *c, double until) {
  for (int group = 0; group < GROUPS; group++) {
    const double start = clock_seconds();
    sweep_group(c, group, start + (until - start) / (GROUPS - group));
  }
}

int setting_sweep_run(const run_context *a, double until, setting_sweep *c) {
  const reference_solution *t = a->reference;
  *c = (setting_sweep){.context = *a};
  precision_methods_collect(t, a->parts->split.by, a->ode, &c->methods);
  const size_t most = (size_t)c->methods.count * MAX_SWEEP_POINTS;
  c->points = malloc(most * sizeof *c->points);
  c->all = malloc(most * sizeof *c->all);
  if (!c->points || !c->all || !run_result_create(t->view.nparticles, &c->result)) return 0;
  sweep_all_groups(c, until);
  return 1;
}

void setting_sweep_repeat(setting_sweep *c, double seconds, double until) {
  for (int i = 0; i < c->count; i++) c->points[i].until = until;
  const timing_limits turns = {
      .max_rounds = 9, .budget = seconds, .until = fmin(until, clock_seconds() + seconds)};
  time_in_turn(c->all, c->count, &turns);
}

void setting_sweep_free(setting_sweep *c) {
  free(c->points);
  free(c->all);
  run_result_free(&c->result);
}
