/* step_comparison - compares all methods on one nonlinear step: first each alone, to find the
 * iterations for each accuracy, then those that reached it in turn */
#ifndef BENCH_STEP_COMPARISON_H
#define BENCH_STEP_COMPARISON_H

#include "../bench_reference/prefactored_descent.h"
#include "newton_sweep.h"
#include "solver_comparison.h"

enum { BY_PCG, BY_CHOLMOD, BY_PROJECTIVE_DYNAMICS, BY_LBFGS, METHODS };

typedef struct step_plan {
  double solution;        /* s, limit for the converged solution */
  double newton, descent; /* s, limits for each Newton run and each descent */
  int is_quick;           /* use every other newton.rtol */
  timing_limits turns;
} step_plan;

typedef struct step_comparison {
  nonlinear_step step;
  newton_sweep newton[2];
  laplacian matrix;
  potential potential;
  descent descents[2];
  double descent_limit; /* s, limit for each prefactored method */
  accuracy_record records[METHODS];
  solver_comparison *linear; /* runs the factorization */
  int count;
  timing_candidate all[METHODS * ACCURACIES + 1];
  timing_candidate *reached[METHODS][ACCURACIES]; /* NULL: not reached */
  timing_candidate *factor; /* factor_seconds of the linearly implicit step's matrix, by CHOLMOD;
                               NULL: none */
  struct step_run {
    struct step_comparison *comparison;
    int method, accuracy;
  } runs[METHODS * ACCURACIES];
  msim_error no_factor; /* why there is none */
} step_comparison;

/* Runs the comparison from a scene's state; until: on the clock of clock_seconds. Returns NULL if
 * no converged solution was found and sets err. */
step_comparison *step_comparison_run(const moving_scene *m, double h, const step_plan *plan,
                                     double until, msim_error *err);
void step_comparison_free(step_comparison *r);

#endif
