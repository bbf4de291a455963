/* jacobi - the block-Jacobi preconditioner: the inverses of the diagonal blocks */
#ifndef MS_JACOBI_H
#define MS_JACOBI_H

#include "msim/backend.h"
#include "physics/force.h"

/* In units of `scale`, a power of 4 near the largest diagonal entry. */
typedef struct ms_jacobi {
  int32_t block; /* scalars in one: those of the coefficients */
  double scale;
  double *inverse; /* of the diagonal blocks / scale, as ms_coefficients has them */
} ms_jacobi;

msim_status ms_jacobi_create(const ms_model *model, const ms_coefficients *a, ms_jacobi *jacobi,
                             msim_error *err);
void ms_jacobi_destroy(const ms_model *model, ms_jacobi *jacobi);

/* A block that is not positive definite says that A is not: MSIM_NOT_SPD. Where A need not be
 * (any kind but MSIM_FACTOR_SPD) the blocks are those of a matrix in which compressed springs do
 * not push sideways: iterations for such systems want a preconditioner that is positive definite
 * nevertheless. */
msim_status ms_jacobi_invert(const ms_model *model, const ms_coefficients *a, int32_t kind,
                             ms_jacobi *jacobi);

/* z = D^-1 r, D the diagonal blocks, for vectors of `components`: those of a block, or any number
 * where it is a scalar. Rows past the unknowns are left alone. */
void ms_jacobi_apply(const ms_model *model, const ms_jacobi *jacobi, int32_t components,
                     const double *r, double *z);

/* ||r|| = sqrt(r.D^-1 r), the norm in which residuals are judged: as D is near A, it is near the
 * energy norm of the error, sqrt(r.A^-1 r) (Arioli 2004), which weighs light particles as heavy
 * ones and has no units of its own. */
double ms_jacobi_norm(const ms_model *model, const ms_coefficients *a, const double *r);

/* D = L L^T, for blocks of more than a scalar: roots, 6 for each unknown row; then r = L^-1 r,
 * whose 2-norm is that norm, and y = L y. */
void ms_jacobi_roots(const ms_model *model, const ms_coefficients *a, double *roots);
void ms_jacobi_divide(const ms_model *model, const double *roots, double *r);
void ms_jacobi_multiply(const ms_model *model, const double *roots, double *y);

#endif
