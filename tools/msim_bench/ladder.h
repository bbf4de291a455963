/* ladder - Newton's method of msim at ever smaller newton.rtol: the same step from the same state,
 * each with its own sim */
#ifndef BENCH_LADDER_H
#define BENCH_LADDER_H

#include "nonlinear.h"
#include "pursuit.h"

enum { RUNGS = 19 }; /* newton.rtol = 1, 0.3, 0.1, ..., 1e-9 */

typedef struct ladder_plan {
  int first, stride; /* index of the first newton.rtol; 2: every other one */
  allowance allowed;
} ladder_plan;

typedef struct ladder {
  const nonlinear_step *step;
  pursuit pursuit;
  msim_sim *sims[RUNGS]; /* those that are the fastest to some accuracy */
} ladder;

double rung_rtol(int rung);

/* Decreases newton.rtol until all accuracies are reached, the time is up, or a step fails or finds
 * another minimum. Call ladder_free at the end. */
void ladder_climb(const nonlinear_step *s, const char *name, const char *solver,
                  const ladder_plan *plan, ladder *l);
void ladder_free(ladder *l);

/* Repeats the step with a newton.rtol whose sim was kept. */
msim_status ladder_step(const ladder *l, int rung, double *seconds, msim_error *err);

#endif
