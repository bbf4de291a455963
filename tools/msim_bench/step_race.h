/* step_race - all methods on one nonlinear step: first each on its own, to learn how far it must
 * go for each accuracy, then those that arrived in turn */
#ifndef BENCH_STEP_RACE_H
#define BENCH_STEP_RACE_H

#include "descent.h"
#include "ladder.h"
#include "race.h"

enum { BY_PCG, BY_CHOLMOD, BY_PROJECTIVE_DYNAMICS, BY_LBFGS, METHODS };

typedef struct step_plan {
  double solution;        /* s, to find it */
  double ladder, descent; /* s, for each ladder and each descent */
  int is_quick;           /* leave out rungs */
  patience turns;
} step_plan;

typedef struct step_race {
  nonlinear_step step;
  ladder ladders[2];
  laplacian matrix;
  potential potential;
  descent descents[2];
  double descent_limit; /* s, that each descent may take */
  const pursuit *pursuits[METHODS];
  race *linear; /* where the factorisation comes from */
  int count;
  contestant all[METHODS * ACCURACIES + 1];
  contestant *arrived[METHODS][ACCURACIES]; /* NULL: it did not */
  contestant *factor; /* factor_seconds of the linear step's matrix, by CHOLMOD; NULL: none */
  struct step_run {
    struct step_race *race;
    int method, accuracy;
  } runs[METHODS * ACCURACIES];
  msim_error no_factor; /* why there is none */
} step_race;

/* Run it, from a scene's state; until: on wall_seconds' clock. NULL: there is no solution to
 * measure errors by, and why in err. */
step_race *step_race_run(const moving *m, double h, const step_plan *plan, double until,
                         msim_error *err);
void step_race_free(step_race *r);

#endif
