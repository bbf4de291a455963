/* force - forces on the unknowns, and the matrix of implicit methods, A = M - h D - h^2 J */
#ifndef MS_FORCE_H
#define MS_FORCE_H

#include "physics/model.h"
#include "physics/spring_law.h"

/* f = F(x, v) on the unknowns, by spring_law.h and external_force.h; a spring with l = 0 exerts no
 * force, one with l^2 < MS_MIN_LENGTH2 that of this l^2. v NULL: without the terms in v. Each row
 * adds up its springs in the order of half_edges.h. The values of f past the unknowns are
 * undefined. */
void ms_force_compute(const ms_model *model, const double *x, const double *v, double *f);

/* A constraint of a row by planes, as a penalty: it adds sum weight n n^T + drag (I - sum n n^T - s
 * s^T) to the diagonal block, so that the row hardly moves along the directions n, and without drag
 * along s. */
typedef struct ms_constraint {
  int32_t row, n;
  double direction[3][3]; /* n unit vectors in space; if n < 3, the next one is s, or 0 */
  double weight;          /* kg, set by ms_coefficients_add_constraints */
  double friction;        /* kg: h times the coefficient of viscous friction across them */
} ms_constraint;

/* The matrix A = M - h D - h^2 J, stored as two numbers per half-edge, the positions, and the
 * diagonal block of each row.
 *
 * Block (i,j) of a spring is -(t I + g d d^T), d = x_j - x_i; its opposite is added to blocks (i,i)
 * and (j,j):
 *   J_ii = -k (u u^T + (1 - L/l) (I - u u^T))  and  D_ii = -c u u^T,  u = d/l,  give
 *   t = h^2 k s,  g = (h^2 k (1 - s) + h c)/l^2,  s = 1 - L/l   (clamped: max(0, s))
 * and l = 0: J_ii = -k I, so t = h^2 k, g = 0. As s <= 1, g is >= 0.
 *
 * If all rest lengths and dampings are 0, then g = 0, and t depends on h only: A is constant and
 * identical for each component. It is then stored as a scalar matrix, block = 1. */
typedef struct ms_coefficients {
  double drag;    /* that of external forces on the diagonal, kg */
  int32_t block;  /* rows of a block: dims, or 1 */
  double *t, *g;  /* 8 half_edges.nentries each; g: NULL if block = 1; padding: 0 */
  double *x;      /* positions, a vector; NULL if block = 1 */
  double *angles; /* the elements of the model's angular springs (angle.h), MS_ANGLE_ELEMENT numbers
                     each, those of 8 interleaved; their blocks are added to those of springs */
  /* ms_coefficients_diagonal_size(block) first_pinned: the diagonal blocks, element by element for
   * all rows: xx yy zz xy xz yz, or xx yy xy, or a scalar */
  double *diagonal;
  double *own; /* 6 first_pinned: blocks of a force function, part of `diagonal`; NULL: none */
  const ms_constraint *constraint; /* nholds, borrowed from the caller */
  int32_t nconstraints;
} ms_coefficients;

/* The number of elements of a symmetric block, and the index of element (a, b). */
static inline size_t ms_coefficients_diagonal_size(size_t dims) { return dims * (dims + 1) / 2; }
static inline size_t ms_coefficients_diagonal_element(size_t dims, size_t a, size_t b) {
  return a == b ? a : dims + a + b - 1;
}
/* The shape of `diagonal` as a vector with one component per element */
static inline ms_shape ms_coefficients_diagonal_shape(const ms_unknowns *rows,
                                                      const ms_coefficients *a) {
  const int32_t size = (int32_t)ms_coefficients_diagonal_size((size_t)a->block);
  return (ms_shape){.n = rows->nfree, .stride = rows->first_pinned, .dims = size};
}

msim_status ms_coefficients_create(const ms_model *model, ms_coefficients *a, msim_error *err);
void ms_coefficients_destroy(const ms_model *model, ms_coefficients *a);

/* A at positions x for a step h, without constraints; clamp: 1 for the clamped matrix. A force
 * function has been linearized before. */
void ms_coefficients_compute(const ms_model *model, const double *x, double h, int clamp,
                             ms_coefficients *a);

/* Add constraints to the matrix just computed, and set their weights; not if block = 1. */
void ms_coefficients_add_constraints(const ms_model *model, ms_constraint *constraint, int32_t n,
                                     ms_coefficients *a);

/* y += by H x, H the sum of the constraints' blocks with `share` times their weights; returns
 * by x.H x */
double ms_coefficients_apply_constraints(const ms_model *model, const ms_coefficients *a,
                                         double share, double by, ms_operands o);

/* y = A x on the unknowns; past them x must be 0, and y becomes 0. Springs act on differences
 * x_i - x_j, so that a common translation gives (M + h b) x without rounding errors of the
 * stiffness. */
void ms_coefficients_apply(const ms_model *model, const ms_coefficients *a, const double *x,
                           double *y);

/* y = (A - M) x = -(h D + h^2 J) x, without the weights of constraints and a force function */
void ms_coefficients_apply_massless(const ms_model *model, const ms_coefficients *a,
                                    const double *x, double *y);

/* y = A x for vectors of one component; block = 1 */
void ms_coefficients_apply_component(const ms_model *model, const ms_coefficients *a,
                                     const double *x, double *y);

/* y >= |A| |x| element by element, the scale of rounding errors of A x */
void ms_coefficients_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y);

#endif
