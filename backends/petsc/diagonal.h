/* diagonal - D^-1, D the diagonal blocks of A, which defines the norm of the host */
#ifndef PETSC_DIAGONAL_H
#define PETSC_DIAGONAL_H

#include "msim/backend.h"

/* inverse: block^2 numbers a block row, by rows. 0: a block is not positive definite, so that A is
 * not. */
int petsc_diagonal_invert(const msim_system *A, double *inverse);

/* r.D^-1 r, of the rows of this rank */
double petsc_diagonal_product(const msim_system *A, const double *inverse, const double *r);

#endif
