#include "envelope.h"

#include <math.h>
#include <string.h>

const double levels[LEVELS] = {1e-2, 1e-4, 1e-6, 1e-8, 1e-10};

/* The cost of a run, and its error as far as it is measurable. */
typedef struct point {
  double error;
  cost cost;
} point;

static point point_of(const climb *c, int i) {
  const rung *r = &c->rungs[i];
  const double told = fmax(r->verdict.error, 10 * c->arena.truth->error);
  return (point){.error = r->status == FAILED ? INFINITY : told,
                 .cost = {median_of(&c->all[i], whole_seconds), (double)r->evaluations}};
}

static double between(double a, double b, double share) { return a * pow(b / a, share); }

/* The cost at an error between those of two settings. */
static cost interpolate(const point *above, const point *below, double error) {
  const double share = log(above->error / error) / log(above->error / below->error);
  return (cost){between(above->cost.seconds, below->cost.seconds, share),
                between(above->cost.evaluations, below->cost.evaluations, share)};
}

cost cost_of(const climb *c, const entrant *who, double error) {
  cost best = {NAN, NAN};
  point before = {.error = INFINITY};
  if (!truth_allows(c->arena.truth, error)) return best;
  for (int i = 0; i < c->count; i++) {
    if (c->rungs[i].who != who) continue;
    const point here = point_of(c, i);
    if (here.error <= error) {
      const int bracketed = before.error > error && isfinite(before.error);
      const cost found = bracketed ? interpolate(&before, &here, error) : here.cost;
      if (!(best.seconds <= found.seconds)) best = found;
    }
    before = here;
  }
  return best;
}

static int takes_part(const entrant *who, int of_msim) {
  if (!who->integrator) return !of_msim;
  return of_msim && strcmp(who->integrator, "auto") != 0;
}

const entrant *cheapest(const climb *c, int of_msim, double error) {
  const entrant *best = NULL;
  double least = INFINITY;
  for (const entrant *who = c->entrants.all; who < c->entrants.all + c->entrants.count; who++) {
    const double seconds = takes_part(who, of_msim) ? cost_of(c, who, error).seconds : NAN;
    if (seconds < least) best = who, least = seconds;
  }
  return best;
}
