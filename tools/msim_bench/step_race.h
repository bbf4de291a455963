/* step_race - compares all methods on one nonlinear step: first each alone, to find the iterations
 * for each accuracy, then those that reached it in turn */
#ifndef BENCH_STEP_RACE_H
#define BENCH_STEP_RACE_H

#include "descent.h"
#include "ladder.h"
#include "race.h"

enum { BY_PCG, BY_CHOLMOD, BY_PROJECTIVE_DYNAMICS, BY_LBFGS, METHODS };

typedef struct step_plan {
  double solution;        /* s, limit for the converged solution */
  double ladder, descent; /* s, limits for each Newton run and each descent */
  int is_quick;           /* use every other newton.rtol */
  patience turns;
} step_plan;

typedef struct step_race {
  nonlinear_step step;
  ladder ladders[2];
  laplacian matrix;
  potential potential;
  descent descents[2];
  double descent_limit; /* s, limit for each prefactored method */
  const pursuit *pursuits[METHODS];
  race *linear; /* runs the factorization */
  int count;
  contestant all[METHODS * ACCURACIES + 1];
  contestant *arrived[METHODS][ACCURACIES]; /* NULL: not reached */
  contestant *factor; /* factor_seconds of the linearly implicit step's matrix, by CHOLMOD; NULL:
                         none */
  struct step_run {
    struct step_race *race;
    int method, accuracy;
  } runs[METHODS * ACCURACIES];
  msim_error no_factor; /* why there is none */
} step_race;

/* Runs the comparison from a scene's state; until: on wall_seconds' clock. Returns NULL if no
 * converged solution was found and sets err. */
step_race *step_race_run(const moving *m, double h, const step_plan *plan, double until,
                         msim_error *err);
void step_race_free(step_race *r);

#endif
