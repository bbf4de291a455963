#include "setting_sweep.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "interrupt.h"

/*------------------------------------- one rung -------------------------------------------------*/

static int run_point(timing_candidate *c, timing_sample *s) {
  sweep_point *r = c->data;
  if (!precision_method_run(r->arena, r->method, r->setting, r->until, r->result)) {
    snprintf(c->reason, sizeof c->reason, "%s", r->result->reason);
    return 0;
  }
  s->whole = r->result->seconds;
  r->evaluations = r->result->evaluations;
  return 1;
}

static timing_candidate *add_point(setting_sweep *c, const precision_method *who, double setting,
                                   double until) {
  sweep_point *r = &c->rungs[c->count];
  timing_candidate *run = &c->all[c->count++];
  *r = (sweep_point){
      .method = who, .arena = &c->arena, .setting = setting, .until = until, .result = &c->result};
  *run = (timing_candidate){.family = who->name, .measure = "rung", .run = run_point, .data = r};
  snprintf(run->name, sizeof run->name, "%.31s", who->name);
  return run;
}

/* The first run of a setting, from which its error is measured. */
static void measure_point(const reference_solution *t, timing_candidate *run) {
  sweep_point *r = run->data;
  timing_sample s = {0};
  run->failed = !run_point(run, &s);
  r->status = POINT_FAILED;
  if (run->failed) return;
  r->verdict = reference_solution_errors(t, r->result->x, r->result->v);
  run->failed = !(r->verdict.error < 1);
  if (run->failed) {
    snprintf(run->reason, sizeof run->reason, "off by %.1g of the whole motion", r->verdict.error);
    return;
  }
  r->status = reference_solution_resolves(t, r->verdict.error) ? POINT_MEASURED : POINT_UNRESOLVED;
  run->samples[run->nsamples++] = s;
  run->total_seconds = s.whole;
}

/*------------------------------------- ladders --------------------------------------------------*/

/* Expected time of the next run. Halving h doubles the number of steps; dividing tol by 10 at most
 * doubles it for most methods. */
static double next_seconds(const precision_method *who, double seconds) {
  return seconds / (who->by_tol ? 0.5 : who->ratio);
}

/* Where stability limits the step, a tolerance above the error already reached changes nothing.
 * msim's tolerances are relative to the extent, those of SUNDIALS and all errors to the motion. */
static int may_change_nothing(const reference_solution *t, const precision_method *who,
                              double setting, double error) {
  const double unit = who->integrator ? t->extent / t->motion : 1;
  return who->by_tol && setting * unit > error;
}

/* Stops when a run is as accurate as the reference solution, when the next one would exceed the
 * share of the time, or when PATIENCE smaller settings have not reduced the error. */
static void sweep_settings(setting_sweep *c, const precision_method *who, double share) {
  enum { PATIENCE = 3 };
  const reference_solution *t = c->arena.truth;
  const double until = clock_seconds() + share;
  double setting = who->first, best = 1;
  for (int i = 0, worse = 0; i < MAX_SWEEP_POINTS && worse < PATIENCE; i++, setting *= who->ratio) {
    const double start = clock_seconds();
    if (is_interrupted() || start > until) return;
    timing_candidate *run = add_point(c, who, setting, until);
    const sweep_point *r = run->data;
    measure_point(t, run);
    if (r->status == POINT_MEASURED && r->verdict.error < best) best = r->verdict.error, worse = 0;
    else worse += best < 1 && !may_change_nothing(t, who, setting, best);
    if (r->status == POINT_FAILED && c->result.refused) return;
    const double seconds = clock_seconds() - start;
    if (r->status == POINT_UNRESOLVED || next_seconds(who, seconds) > until - clock_seconds())
      return;
  }
}

enum { CHOSEN_BY_AUTO, LIBRARY_METHODS, NAMED_METHODS, GROUPS };

static int group_of(const precision_method *who) {
  if (!who->integrator) return LIBRARY_METHODS;
  return strcmp(who->name, AUTO_BY_TOL) == 0 ? CHOSEN_BY_AUTO : NAMED_METHODS;
}

/* Divides the time that one method leaves unused among the following ones. */
static void sweep_group(setting_sweep *c, int group, double until) {
  const precision_methods *list = &c->entrants;
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

int setting_sweep_run(const run_context *a, const sweep_limits *plan, setting_sweep *c) {
  const reference_solution *t = a->truth;
  *c = (setting_sweep){.arena = *a};
  precision_methods_collect(t, a->kernel->split.by, a->ode, &c->entrants);
  const size_t most = (size_t)c->entrants.count * MAX_SWEEP_POINTS;
  c->rungs = malloc(most * sizeof *c->rungs);
  c->all = malloc(most * sizeof *c->all);
  if (!c->rungs || !c->all || !run_result_create(t->view.nparticles, &c->result)) return 0;
  sweep_all_groups(c, plan->until - plan->repeat_seconds);
  for (int i = 0; i < c->count; i++) c->rungs[i].until = plan->until;
  const timing_limits turns = {.max_rounds = 9,
                               .budget = plan->repeat_seconds,
                               .until = fmin(plan->until, clock_seconds() + plan->repeat_seconds)};
  time_in_turn(c->all, c->count, &turns);
  return 1;
}

void setting_sweep_free(setting_sweep *c) {
  free(c->rungs);
  free(c->all);
  run_result_free(&c->result);
}
