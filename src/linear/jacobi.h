/* jacobi - the block-Jacobi preconditioner, i.e. the inverses of the diagonal blocks D of A, and
 * the norm of residuals that D defines */
#ifndef MS_JACOBI_H
#define MS_JACOBI_H

#include "msim/backend.h"
#include "physics/force.h"

typedef struct ms_jacobi {
  int32_t block;         /* scalars in a block, as in the coefficients */
  double scale;          /* a power of 4 near the largest diagonal entry of any rank */
  double coupling_scale; /* the same without weights of constraints along axes */
  double *inverse; /* of the diagonal blocks / scale, in the layout of ms_coefficients.diagonal */
} ms_jacobi;

msim_status ms_jacobi_create(const ms_model *model, const ms_coefficients *a, ms_jacobi *jacobi,
                             msim_error *err);
void ms_jacobi_destroy(const ms_model *model, ms_jacobi *jacobi);

/* MSIM_NOT_SPD: a block is not positive definite, hence neither is A. Where A need not be (any kind
 * but MSIM_FACTOR_SPD) the blocks are shifted to compensate the negative transverse stiffness of
 * compressed springs, because iterations still require a positive definite preconditioner. */
msim_status ms_jacobi_invert(const ms_model *model, const ms_coefficients *a, int32_t kind,
                             ms_jacobi *jacobi);

/* z = D^-1 r, for vectors with that many components: those of a block, or any number where blocks
 * are scalar. Padding and pinned particles are left unchanged. */
void ms_jacobi_apply(const ms_model *model, const ms_jacobi *jacobi, int32_t components,
                     const double *r, double *z);

/* ||p - q|| / ||p||, Frobenius norms of n numbers of inverse blocks, a multiple of 8 */
double ms_jacobi_relative_distance(const float *p, const float *q, size_t n);

/* ||r|| = sqrt(r.D^-1 r), the norm by which solutions are accepted. It approximates the energy norm
 * of the error, sqrt(r.A^-1 r) (Arioli 2004), as D approximates A. It is invariant under scaling of
 * the unknowns, so that light particles count as much as heavy ones. */
double ms_jacobi_norm(const ms_model *model, const ms_coefficients *a, const double *r);

/* D = L L^T, for blocks of more than a scalar. roots: L, 6 numbers per unknown.
 * ms_jacobi_solve_lower: r = L^-1 r, the 2-norm of which is the norm above;
 * ms_jacobi_multiply_lower: y = L y. */
void ms_jacobi_factor_blocks(const ms_model *model, const ms_coefficients *a, double *roots);
void ms_jacobi_solve_lower(const ms_model *model, const double *roots, double *r);
void ms_jacobi_multiply_lower(const ms_model *model, const double *roots, double *y);

#endif
