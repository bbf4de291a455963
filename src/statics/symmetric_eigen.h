/* symmetric_eigen - all eigenvalues and eigenvectors of a small dense symmetric matrix */
#ifndef MS_SYMMETRIC_EIGEN_H
#define MS_SYMMETRIC_EIGEN_H

#include <stdint.h>

/* a (n x n) becomes diagonal, with the eigenvalues in descending order; column j of `vectors`
 * (n x n, row by row) is the normalized eigenvector of the j-th. By Jacobi's rotations, which find
 * small eigenvalues as accurately as large ones if a is positive definite (Demmel and Veselic
 * 1992). */
void ms_symmetric_eigen_solve(int32_t n, double *a, double *vectors);

#endif
