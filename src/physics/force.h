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
 * in one order, that of halves.h. Rows past the unknowns are scratch. */
void ms_force(const ms_model *model, const double *x, const double *v, double *f);

/* The matrix A = M - h D - h^2 J, given by two numbers a half spring, the positions, and the
 * diagonal block of each row.
 *
 * Block (i,j) of a spring is -(t I + g d d^T), d = x_j - x_i; its opposite is added to blocks (i,i)
 * and (j,j):
 *   J_ii = -k (u u^T + (1 - L/l) (I - u u^T))  and  D_ii = -c u u^T,  u = d/l,  give
 *   t = h^2 k s,  g = (h^2 k (1 - s) + h c)/l^2,  s = 1 - L/l   (clamped: max(0, s))
 * and l = 0: J_ii = -k I, so t = h^2 k, g = 0. As s <= 1, g is >= 0.
 *
 * Where every rest length and damping is 0, so is every g, and t depends on h alone: A is constant,
 * and acts on each component alike. Then it is kept as a matrix of scalars, block = 1. */
typedef struct ms_hold {
  int32_t row, n;
  double along[3][3]; /* n directions in space, of length 1, along which the row does not move */
  double weight;      /* kg, see below */
  double drag;        /* kg: h times the viscous friction on what moves across them */
} ms_hold;

/* Rows that planes hold are so heavy along those directions that they move next to nothing: their
 * diagonal blocks have sum weight n n^T + drag (I - sum n n^T) more. */
typedef struct ms_coefficients {
  double drag;         /* h b, kg */
  int32_t block;       /* scalars in a block: dims, or 1 */
  double *t, *g;       /* 8 halves.nslots each; g: NULL where block = 1; padding: 0 */
  double *x;           /* the rows' positions; NULL where block = 1 */
  double *diagonal;    /* ms_diagonal_size(block) first_pinned: the numbers of the diagonal blocks,
                       each for all rows: xx yy zz xy xz yz, or xx yy xy, or one for all */
  const ms_hold *hold; /* the caller's */
  int32_t nholds;
} ms_coefficients;

/* Numbers of a symmetric block, and which of them is its entry (a, b). */
static inline size_t ms_diagonal_size(size_t dims) { return dims * (dims + 1) / 2; }
static inline size_t ms_diagonal_entry(size_t dims, size_t a, size_t b) {
  return a == b ? a : dims + a + b - 1;
}
/* All of them, as a vector of so many components */
static inline ms_shape ms_diagonal_shape(const ms_rows *rows, const ms_coefficients *a) {
  const int32_t size = (int32_t)ms_diagonal_size((size_t)a->block);
  return (ms_shape){.n = rows->nfree, .stride = rows->first_pinned, .dims = size};
}

msim_status ms_coefficients_create(const ms_model *model, ms_coefficients *a, msim_error *err);
void ms_coefficients_destroy(const ms_model *model, ms_coefficients *a);

/* At positions x with step h; clamp: 1 for the clamped matrix. */
void ms_coefficients_compute(const ms_model *model, const double *x, double h, int clamp,
                             ms_coefficients *a);

/* Hold rows, once that is done; not where block = 1. Sets the weights. */
void ms_coefficients_hold(const ms_model *model, ms_hold *hold, int32_t n, ms_coefficients *a);

/* q += by times what holds add to A p; returns p.q of that */
double ms_coefficients_apply_holds(const ms_model *model, const ms_coefficients *a, double by,
                                   const double *p, double *q);

/* y = A x on the unknowns; rows past them must be 0 in x and are 0 in y. Springs are applied to
 * differences x_i - x_j, so that a translation of all gives (M + h b) x without rounding errors of
 * their stiffness. */
void ms_coefficients_apply(const ms_model *model, const ms_coefficients *a, const double *x,
                           double *y);

/* y = (A - M) x = -(h D + h^2 J) x, the same without the masses and the weights of holds */
void ms_coefficients_apply_massless(const ms_model *model, const ms_coefficients *a,
                                    const double *x, double *y);

/* The same for one component, block = 1. */
void ms_coefficients_apply_one(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y);

/* y >= |A| |x| entry by entry: what rounding errors of A x are measured against. */
void ms_coefficients_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y);

#endif
