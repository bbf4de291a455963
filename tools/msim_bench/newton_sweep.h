/* newton_sweep - Newton's method of msim at ever smaller newton.rtol: the same step from the same
 * state, each with its own sim */
#ifndef BENCH_NEWTON_SWEEP_H
#define BENCH_NEWTON_SWEEP_H

#include "nonlinear_step.h"
#include "accuracy_record.h"

enum { NEWTON_RTOLS = 19 }; /* newton.rtol = 1, 0.3, 0.1, ..., 1e-9 */

typedef struct newton_sweep_plan {
  int first, stride; /* index of the first newton.rtol; 2: every other one */
  method_limits allowed;
} newton_sweep_plan;

typedef struct newton_sweep {
  const nonlinear_step *step;
  msim_sim *sims[NEWTON_RTOLS]; /* those that are the fastest to some accuracy */
} newton_sweep;

double newton_sweep_rtol(int setting);

/* Decreases newton.rtol until all accuracies are reached, the time is up, or a step fails or finds
 * another minimum. Call newton_sweep_free at the end. */
void newton_sweep_run(const nonlinear_step *s, const char *solver, const newton_sweep_plan *plan,
                      newton_sweep *l, accuracy_record *p);
void newton_sweep_free(newton_sweep *l);

/* Repeats the step with a newton.rtol whose sim was kept. */
msim_status newton_sweep_step(const newton_sweep *l, int setting, double *seconds, msim_error *err);

#endif
