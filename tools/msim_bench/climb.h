/* climb - each entrant goes up the ladder of its settings, towards smaller errors, as far as its
 * share of the time allows; then all rungs run in turn, as often as there is time */
#ifndef BENCH_CLIMB_H
#define BENCH_CLIMB_H

#include "entrants.h"
#include "timing.h"

typedef struct climb_plan {
  double turns; /* s: all rungs again */
  double until; /* on wall_seconds' clock */
} climb_plan;

/* REFUSED: the truth is not known well enough to tell its error. */
enum { RAN, REFUSED, FAILED };

typedef struct rung {
  const entrant *who;
  const arena *arena;
  double setting;
  int status;
  verdict verdict;
  int64_t evaluations;
  double until; /* on wall_seconds' clock: when a run is cut off */
  ending *room;
} rung;

typedef struct climb {
  arena arena;
  entrants entrants;
  int count;
  rung *rungs;     /* an entrant's one after another, from the first setting on */
  contestant *all; /* their runs: all[i] of rungs[i] */
  ending room;
} climb;

/* 0: there is no memory. Call climb_free in any case. */
int climb_run(const arena *a, const climb_plan *plan, climb *c);
void climb_free(climb *c);

#endif
