/* nystrom - explicit Runge-Kutta methods of many stages, written for accelerations alone
 *
 * The method for y' = f(y), with y = (x, v), f = (v, a), in Nystroem form:
 *   k_i = a(X_i, V_i),  V_i = v + h sum_j A_ij k_j,
 *   X_i = x + C_i h v + h^2 sum_j AA_ij k_j
 * The state after the step is stage `result`, and its k is the first one of the next step.
 *
 * Work vectors: the k of both ends, alternating; of the other stages.
 * cached_stage: 1 + the index of the work vector that holds k of the present state. */
#ifndef MS_NYSTROM_H
#define MS_NYSTROM_H

#include "integrate/integrator.h"

/* Stages that a method may have, those of dense output included */
enum { MS_NYSTROM_STAGES = 16 };
typedef double ms_nystrom_row[MS_NYSTROM_STAGES];

/* Indices count from 0. Rows of products with A, for equations of second order, follow from the
 * others: aa = A A. */
typedef struct ms_nystrom {
  int result, stages;           /* stages after the result are for dense output */
  const double *c;              /* [stages]: their times, as shares of h */
  const ms_nystrom_row *a, *aa; /* [stages]; row `result`: the weights of the result */
} ms_nystrom;

/* Where the sums of slopes begin, NULL: at 0, and where they go; to_v NULL: x alone */
typedef struct ms_nystrom_sums {
  int slopes; /* k_j with j below this are added; the others have weight 0 */
  const double *x, *v;
  double time; /* x begins at x + time v */
  double *to_x, *to_v;
} ms_nystrom_sums;

/* x = its beginning + h^2 sum_j row2_j k_j,  v = its beginning + h sum_j row_j k_j. Terms that only
 * one of both has are added to the other one with weight 0. */
void ms_nystrom_add_slopes(const ms_stepper *s, ms_nystrom_sums of, const ms_nystrom_row row2,
                           const ms_nystrom_row row, double *const k[MS_NYSTROM_STAGES]);

/* k of all stages, with that of the state at the start of the step in work vector `at` */
void ms_nystrom_find_slopes(const ms_nystrom *m, const ms_stepper *s, int at,
                            double *k[MS_NYSTROM_STAGES]);

/* A step from x, v: its stages are X and V, V NULL where no force depends on velocities; k: their
 * accelerations */
typedef struct ms_nystrom_stages {
  const double *x, *v;
  double *X, *V, *k[MS_NYSTROM_STAGES];
} ms_nystrom_stages;

/* k of the stages from..to - 1; of->X and of->V: scratch, with pinned positions in X */
void ms_nystrom_evaluate(const ms_nystrom *m, ms_stepper *s, const ms_nystrom_stages *of, int from,
                         int to);

/* One step of s->h */
void ms_nystrom_step(const ms_nystrom *m, ms_stepper *s);

/* The difference of the result, before reflection, from that of another formula:
 *   dv = h sum_j row_j k_j,  dx = h^2 sum_j row2_j k_j */
void ms_nystrom_estimate(const ms_nystrom *m, const ms_stepper *s, const ms_nystrom_row row2,
                         const ms_nystrom_row row, double *dx, double *dv);

#endif
