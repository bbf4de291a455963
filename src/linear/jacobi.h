/* jacobi - the block-Jacobi preconditioner: the inverses of the 3x3 diagonal blocks */
#ifndef MS_JACOBI_H
#define MS_JACOBI_H

#include "msim/backend.h"
#include "physics/force.h"

/* 6 numbers a row, as ms_coefficients keeps the blocks themselves; NULL: no memory. */
double *ms_jacobi_create(const ms_model *model);

/* A block that is not positive definite says that A is not: MSIM_NOT_SPD. Where A need not be
 * (kind: MSIM_FACTOR_SYMMETRIC) a multiple of the identity, as large, takes its place: iterations
 * for indefinite systems want a preconditioner that is positive definite nevertheless. */
msim_status ms_jacobi_invert(const ms_model *model, const ms_coefficients *a, int32_t kind,
                             double *inverse);

/* z = P r, P the inverses of the diagonal blocks. Rows past the unknowns are left alone. */
void ms_jacobi_apply(const ms_model *model, const double *inverse, const double *r, double *z);

#endif
