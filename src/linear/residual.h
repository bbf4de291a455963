/* residual - the true residual of a solution, and the right-hand side for a change of velocity */
#ifndef MS_RESIDUAL_H
#define MS_RESIDUAL_H

#include "linear/linear.h"

/* to = b - (A - M) base, without the weights of constraints (physics/force.h). A dv = to is then
 * A (base + dv) = b + M base, and `to` is small where the velocity hardly changes. */
void ms_residual_compute_change_rhs(const ms_linear_system *s, const double *b, const double *base,
                                    double *to);

/* r = b - A y. Returns its norm (jacobi.h). */
double ms_residual_compute(const ms_linear_system *s, const double *b, const double *y, double *r);

/* to = b - A guess, the right-hand side for the correction of a guess. *target, for b on input,
 * then requires the same of its residual. to may be b; work: a vector. Returns `to`. */
const double *ms_residual_subtract_guess(const ms_linear_system *s, const double *b,
                                         const double *guess, ms_linear_target *target,
                                         double *work, double *to);

/* v.A v / v.M v for the solution v of A v = b; NAN: v = 0. Collective. */
double ms_residual_compute_curvature(const ms_linear_system *s, const double *b, const double *v);

/* The norm of the rounding errors of a residual, 8 eps (|A| |y| + |b|). It is the sum of the norms
 * of single components, because signs are arbitrary, and D^-1 may nearly cancel components. */
double ms_residual_compute_rounding_level(const ms_linear_system *s, const double *b,
                                          const double *y, double *work1, double *work2);

#endif
