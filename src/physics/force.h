/* force - forces on the unknowns, and the coefficients of their derivatives */
#ifndef MS_FORCE_H
#define MS_FORCE_H

#include "physics/model.h"

/* Springs shorter than the root of this have no direction that a double could hold; forces count
 * them as that long. */
#define MS_ZERO_LENGTH2 2.2250738585072014e-308

/* f = F(x, v) on every unknown row. With d = x_j - x_i, l = |d|, u = d/l a spring pushes i by
 * (k (l - L) + c u.(v_j - v_i)) u and j by the opposite; l = 0: not at all. Gravity adds m g,
 * drag -b v. v NULL: the part without velocities, springs and gravity. Each row adds up its springs
 * in the order of its neighbours. Rows past the unknowns are scratch. */
void ms_force(const ms_model *model, const double *x, const double *v, double *f);

/* The matrix A = M - h D - h^2 J, given by four numbers a half spring and six a row.
 *
 * Block (i,j) of a spring is -(t I + w w^T), and t I + w w^T is added to blocks (i,i) and (j,j):
 *   J_ii = -k (u u^T + (1 - L/l) (I - u u^T))  and  D_ii = -c u u^T  give
 *   t = h^2 k s,  w = sqrt(h^2 k (1 - s) + h c) u,  s = 1 - L/l   (clamped: max(0, s))
 * and l = 0: J_ii = -k I, so t = h^2 k, w = 0. As s <= 1 the root is real. */
typedef struct ms_coefficients {
  double *t, *wx, *wy, *wz; /* 8 halves.nslots; padding: 0 */
  double *diagonal; /* 6 first_pinned: xx yy zz xy xz yz of the diagonal blocks, component-wise */
} ms_coefficients;

msim_status ms_coefficients_create(const ms_model *model, ms_coefficients *a, msim_error *err);
void ms_coefficients_destroy(const ms_model *model, ms_coefficients *a);

/* At positions x with step h; clamp: 1 for the clamped matrix. */
void ms_coefficients_compute(const ms_model *model, const double *x, double h, int clamp,
                             ms_coefficients *a);

/* y = A x on the unknowns; rows past them must be 0 in x and are 0 in y. */
void ms_coefficients_apply(const ms_model *model, const ms_coefficients *a, const double *x,
                           double *y);

/* y >= |A| |x| entry by entry: what rounding errors of A x are measured against. */
void ms_coefficients_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y);

#endif
