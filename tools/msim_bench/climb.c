#include "climb.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "interrupt.h"

/*------------------------------------- one rung -------------------------------------------------*/

static int run_rung(contestant *c, sample *s) {
  rung *r = c->data;
  if (!entrant_run(r->arena, r->who, r->setting, r->until, r->room)) {
    snprintf(c->reason, sizeof c->reason, "%s", r->room->reason);
    return 0;
  }
  s->whole = r->room->seconds;
  r->evaluations = r->room->evaluations;
  return 1;
}

static contestant *add_rung(climb *c, const entrant *who, double setting, double until) {
  rung *r = &c->rungs[c->count];
  contestant *run = &c->all[c->count++];
  *r = (rung){.who = who, .arena = &c->arena, .setting = setting, .until = until, .room = &c->room};
  *run = (contestant){.family = who->name, .measure = "rung", .run = run_rung, .data = r};
  snprintf(run->name, sizeof run->name, "%.31s", who->name);
  return run;
}

/* The first run of a setting, from which its error is measured. */
static void try_rung(const truth *t, contestant *run) {
  rung *r = run->data;
  sample s = {0};
  run->failed = !run_rung(run, &s);
  r->status = FAILED;
  if (run->failed) return;
  r->verdict = truth_judge(t, r->room->x, r->room->v);
  run->failed = !(r->verdict.error < 1);
  if (run->failed) {
    snprintf(run->reason, sizeof run->reason, "off by %.1g of the whole motion", r->verdict.error);
    return;
  }
  r->status = truth_can_tell(t, r->verdict.error) ? RAN : REFUSED;
  run->samples[run->n++] = s;
  run->spent = s.whole;
}

/*------------------------------------- ladders --------------------------------------------------*/

/* Expected time of the next run. Halving h doubles the number of steps; dividing tol by 10 at most
 * doubles it for most methods. */
static double next_seconds(const entrant *who, double seconds) {
  return seconds / (who->by_tol ? 0.5 : who->ratio);
}

/* Where stability limits the step, a tolerance above the error already reached changes nothing.
 * msim's tolerances are relative to the extent, those of SUNDIALS and all errors to the motion. */
static int may_change_nothing(const truth *t, const entrant *who, double setting, double error) {
  const double unit = who->integrator ? t->extent / t->motion : 1;
  return who->by_tol && setting * unit > error;
}

/* Stops when a run is as accurate as the reference solution, when the next one would exceed the
 * share of the time, or when PATIENCE smaller settings have not reduced the error. */
static void climb_ladder(climb *c, const entrant *who, double share) {
  enum { PATIENCE = 3 };
  const truth *t = c->arena.truth;
  const double until = wall_seconds() + share;
  double setting = who->first, best = 1;
  for (int i = 0, worse = 0; i < MOST_RUNGS && worse < PATIENCE; i++, setting *= who->ratio) {
    const double start = wall_seconds();
    if (is_interrupted() || start > until) return;
    contestant *run = add_rung(c, who, setting, until);
    const rung *r = run->data;
    try_rung(t, run);
    if (r->status == RAN && r->verdict.error < best) best = r->verdict.error, worse = 0;
    else worse += best < 1 && !may_change_nothing(t, who, setting, best);
    if (r->status == FAILED && c->room.refused) return;
    const double seconds = wall_seconds() - start;
    if (r->status == REFUSED || next_seconds(who, seconds) > until - wall_seconds()) return;
  }
}

enum { CHOSEN_BY_AUTO, LIBRARY, NAMED, GROUPS };

static int group_of(const entrant *who) {
  if (!who->integrator) return LIBRARY;
  return strcmp(who->name, AUTO_BY_TOL) == 0 ? CHOSEN_BY_AUTO : NAMED;
}

/* Divides the time that one method leaves unused among the following ones. */
static void climb_group(climb *c, int group, double until) {
  const entrants *list = &c->entrants;
  int left = 0;
  for (int i = 0; i < list->count; i++) left += group_of(&list->all[i]) == group;
  for (int i = 0; i < list->count; i++)
    if (group_of(&list->all[i]) == group)
      climb_ladder(c, &list->all[i], (until - wall_seconds()) / left--);
}

/* Each group gets a third of the time, so that all groups have results to compare. */
static void climb_all(climb *c, double until) {
  for (int group = 0; group < GROUPS; group++) {
    const double start = wall_seconds();
    climb_group(c, group, start + (until - start) / (GROUPS - group));
  }
}

int climb_run(const arena *a, const climb_plan *plan, climb *c) {
  const truth *t = a->truth;
  *c = (climb){.arena = *a};
  entrants_collect(t, a->kernel->split.by, a->ode, &c->entrants);
  const size_t most = (size_t)c->entrants.count * MOST_RUNGS;
  c->rungs = malloc(most * sizeof *c->rungs);
  c->all = malloc(most * sizeof *c->all);
  if (!c->rungs || !c->all || !ending_make(t->view.nparticles, &c->room)) return 0;
  climb_all(c, plan->until - plan->turns);
  for (int i = 0; i < c->count; i++) c->rungs[i].until = plan->until;
  const patience turns = {
      .most = 9, .budget = plan->turns, .until = fmin(plan->until, wall_seconds() + plan->turns)};
  contest(c->all, c->count, &turns);
  return 1;
}

void climb_free(climb *c) {
  free(c->rungs);
  free(c->all);
  ending_free(&c->room);
}
