#include "climb.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../common/clock.h"
#include "interrupt.h"

/*------------------------------------- one rung -------------------------------------------------*/

static int run_rung(contestant *c, sample *s) {
  rung *r = c->data;
  const double until = fmin(wall_seconds() + r->limit, r->until);
  if (!entrant_run(r->arena, r->who, r->setting, until, r->room)) {
    snprintf(c->reason, sizeof c->reason, "%s", r->room->reason);
    return 0;
  }
  s->whole = r->room->seconds;
  r->evaluations = r->room->evaluations;
  return 1;
}

static contestant *add_rung(climb *c, const entrant *who, double setting, const climb_plan *plan) {
  rung *r = &c->rungs[c->count];
  contestant *run = &c->all[c->count++];
  *r = (rung){.who = who,
              .arena = &c->arena,
              .setting = setting,
              .limit = plan->longest,
              .until = plan->until,
              .room = &c->room};
  *run = (contestant){.family = who->name, .measure = "rung", .run = run_rung, .data = r};
  snprintf(run->name, sizeof run->name, "%.31s", who->name);
  return run;
}

/* The first run, which tells the error. */
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

/* Shorter steps cost as much more as there are more of them; a tenth of tol makes at most twice as
 * many of most methods. */
static double next_seconds(const entrant *who, double seconds) {
  return seconds / (who->by_tol ? 0.5 : who->ratio);
}

/* Up to the first rung that is as good as the truth, to where its share of the time is used up, or
 * to where shorter steps have not helped for a while. */
static void climb_ladder(climb *c, const truth *t, const entrant *who, const climb_plan *plan,
                         double share) {
  enum { PATIENCE = 3 };
  double setting = who->first, spent = 0, best = 1;
  for (int i = 0, worse = 0; i < MOST_RUNGS && worse < PATIENCE; i++, setting *= who->ratio) {
    if (is_interrupted() || wall_seconds() > plan->until) return;
    const double start = wall_seconds();
    contestant *run = add_rung(c, who, setting, plan);
    const rung *r = run->data;
    try_rung(t, run);
    const double seconds = wall_seconds() - start;
    spent += seconds;
    worse += best < 1 && !(r->status == RAN && r->verdict.error < best);
    if (r->status == RAN && r->verdict.error < best) best = r->verdict.error, worse = 0;
    if (r->status == FAILED && c->room.refused) return;
    if (r->status == REFUSED || spent > share) return;
    if (next_seconds(who, seconds) > plan->longest) return;
  }
}

int climb_run(const arena *a, const climb_plan *plan, climb *c) {
  const truth *t = a->truth;
  *c = (climb){.arena = *a};
  entrants_collect(t, a->ode, &c->entrants);
  const size_t most = (size_t)c->entrants.count * MOST_RUNGS;
  c->rungs = malloc(most * sizeof *c->rungs);
  c->all = malloc(most * sizeof *c->all);
  if (!c->rungs || !c->all || !ending_make(t->view.nparticles, &c->room)) return 0;
  for (int i = 0; i < c->entrants.count; i++) {
    const double left = plan->until - plan->turns - wall_seconds();
    climb_ladder(c, t, &c->entrants.all[i], plan, left / (c->entrants.count - i));
  }
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
