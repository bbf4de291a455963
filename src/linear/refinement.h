/* refinement - solves with the present factor, verifies the true residual, and improves solutions
 * that are not accurate enough by iterative refinement */
#ifndef MS_REFINEMENT_H
#define MS_REFINEMENT_H

#include "linear/solver.h"

/* 1 if v is accurate enough, or to rounding. residual_norm: ||b - A v||; NAN: to be computed. */
int ms_refinement_is_accurate(ms_solver *s, const double *b, const double *v, double residual_norm);

/* v = A^-1 b with the present matrix and its factor, to s->target. */
msim_status ms_refinement_solve(ms_solver *s, const double *b, double *v, msim_error *err);

#endif
