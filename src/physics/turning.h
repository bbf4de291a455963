/* turning - what dashpots add to the matrix as they turn: -h^2 d(D(x) v)/dx, which has no symmetry
 *
 * With d = x_j - x_i, w = v_j - v_i, u = d/l a dashpot pushes i by c (u.w) u, whose derivative by
 * d is K = c/l^2 ((d.w) (I - 2 u u^T) + d w^T). Blocks (i,i) and (j,j) of the matrix take h^2 K,
 * (i,j) and (j,i) take -h^2 K. */
#ifndef MS_TURNING_H
#define MS_TURNING_H

#include "physics/force.h"

typedef struct ms_turning {
  const double *x, *v; /* v NULL: the matrix is without it, and symmetric */
  double h;
} ms_turning;

/* h^2 K of a half spring of row i, dims rows of 3; returns 0 where nothing turns. */
int ms_turning_block(const ms_model *model, const ms_turning *t, int32_t i, int32_t half,
                     double block[3][3]);

/* y += what it adds to A z; rows past the unknowns must be 0 in z. */
void ms_turning_apply(const ms_model *model, const ms_turning *t, const double *z, double *y);

#endif
