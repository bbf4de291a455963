/* bicgstab - solves systems with the non-symmetric damping derivative
 * (physics/damping_derivative.h) by BiCGStab(2) (Sleijpen and Fokkema, ETNA 1 (1993) 11),
 * preconditioned by A0, A without that term
 *
 * The preconditioner B ~ A0^-1 acts from the right, and the iteration runs in the coordinates
 * L^-1 r, D = L L^T the diagonal blocks: the 2-norm that it minimizes, and by which it stops, is
 * then the norm of jacobi.h. It needs ten vectors. GMRES(20) stagnates where conjugate gradients
 * take some 100 iterations for A0, which is symmetric. */
#ifndef MS_BICGSTAB_H
#define MS_BICGSTAB_H

#include "linear/linear.h"

enum { MS_BICGSTAB_DEGREE = 2 }; /* of the polynomials that minimize the residual */

typedef struct ms_bicgstab {
  double *r[MS_BICGSTAB_DEGREE + 1], *u[MS_BICGSTAB_DEGREE + 1];
  double *shadow, *x, *z, *w; /* shadow residual, accumulated solution, two work vectors */
  double *roots;              /* L of the diagonal blocks; NULL: not created */
} ms_bicgstab;

msim_status ms_bicgstab_create(const ms_model *model, ms_bicgstab *solver, msim_error *err);
void ms_bicgstab_destroy(const ms_model *model, ms_bicgstab *solver);

/* A y = b, A with the damping derivative; y: 0 on input, the solution on output. by: prepared for
 * A0. Each product with A counts as an iteration. MSIM_OK: the true residual has reached the target
 * or stagnates, which the caller must check. MSIM_NOT_CONVERGED: too many iterations. */
msim_status ms_bicgstab_solve(const ms_bicgstab *solver, ms_linear *by,
                              const ms_linear_target *target, const double *b, double *y,
                              int64_t *iterations);

#endif
