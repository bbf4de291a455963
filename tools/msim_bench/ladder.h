/* ladder - msim's Newton method on its way: the same step, from the same state, for ever smaller
 * newton.rtol, each with a sim of its own */
#ifndef BENCH_LADDER_H
#define BENCH_LADDER_H

#include "nonlinear.h"
#include "pursuit.h"

enum { RUNGS = 19 }; /* newton.rtol from 1 to 1e-9, two a decade */

typedef struct ladder_plan {
  int first, stride; /* rungs: where to begin, and 2: every other one */
  allowance allowed;
} ladder_plan;

typedef struct ladder {
  const nonlinear_step *step;
  pursuit pursuit;
  msim_sim *sims[RUNGS]; /* of the rungs that are the quickest to some accuracy */
} ladder;

double rung_rtol(int rung);

/* Climb until all accuracies are reached or a rung fails: those above it would fail too. Call
 * ladder_free at the end. */
void ladder_climb(const nonlinear_step *s, const char *name, const char *solver,
                  const ladder_plan *plan, ladder *l);
void ladder_free(ladder *l);

/* One step on a rung that was kept. */
msim_status ladder_step(const ladder *l, int rung, double *seconds, msim_error *err);

#endif
