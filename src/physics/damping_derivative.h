/* damping_derivative - the non-symmetric damping term of the matrix, -h^2 d(D(x) v)/dx, which
 * arises as dashpots change their direction
 *
 * With d = x_j - x_i, w = v_j - v_i, u = d/l, the force of a dashpot on i is c (u.w) u; its
 * derivative with respect to d is K = c/l^2 ((d.w) (I - 2 u u^T) + d w^T). h^2 K is added to blocks
 * (i,i) and (j,j) of the matrix, -h^2 K to (i,j) and (j,i). */
#ifndef MS_DAMPING_DERIVATIVE_H
#define MS_DAMPING_DERIVATIVE_H

#include "physics/force.h"

typedef struct ms_damping_derivative {
  const double *x, *v; /* v NULL: the matrix is without this term, and symmetric */
  double h;
} ms_damping_derivative;

/* h^2 K of a half-edge of row i, dims x dims; returns 0 if it is 0, and does not write it then. */
int ms_damping_derivative_block(const ms_model *model, const ms_damping_derivative *t, int32_t i,
                                int32_t half, double block[3][3]);

/* y += the term's product with z, which must be 0 past the unknowns. */
void ms_damping_derivative_apply(const ms_model *model, const ms_damping_derivative *t,
                                 const double *z, double *y);

#endif
