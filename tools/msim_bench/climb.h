/* climb - runs every method of `precision` over its settings, from large to small errors, as far as
 * its share of the time allows; then repeats all these runs in turn while time remains */
#ifndef BENCH_CLIMB_H
#define BENCH_CLIMB_H

#include "entrants.h"
#include "timing.h"

typedef struct climb_plan {
  double turns; /* s, for the repeated runs */
  double until; /* on wall_seconds' clock */
} climb_plan;

/* REFUSED: the error is too close to that of the reference solution to be measured. */
enum { RAN, REFUSED, FAILED };

typedef struct rung {
  const entrant *who;
  const arena *arena;
  double setting;
  int status;
  verdict verdict;
  int64_t evaluations;
  double until; /* on wall_seconds' clock: when a run is aborted */
  ending *room;
} rung;

typedef struct climb {
  arena arena;
  entrants entrants;
  int count;
  rung *rungs;     /* grouped by method, in the order of the settings */
  contestant *all; /* timed runs: all[i] belongs to rungs[i] */
  ending room;
} climb;

/* Returns 0 if out of memory. Call climb_free in any case. */
int climb_run(const arena *a, const climb_plan *plan, climb *c);
void climb_free(climb *c);

#endif
