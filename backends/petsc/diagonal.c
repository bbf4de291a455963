#include "diagonal.h"

#include <float.h>
#include <math.h>

/* inverse = D^-1 for a symmetric D of `block` rows, by Cholesky's D = L L^T. 0: not positive
 * definite, up to rounding. */
static int invert_block(int32_t block, const double *d, double *inverse) {
  double l[3][3] = {{0}};
  for (int32_t i = 0; i < block; i++)
    for (int32_t j = 0; j <= i; j++) {
      double sum = d[i * block + j];
      for (int32_t k = 0; k < j; k++) sum -= l[i][k] * l[j][k];
      if (i == j && !(sum > 4 * DBL_EPSILON * d[i * block + i])) return 0;
      l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
    }
  for (int32_t column = 0; column < block; column++) {
    double y[3] = {0};
    for (int32_t i = 0; i < block; i++) {
      y[i] = i == column;
      for (int32_t k = 0; k < i; k++) y[i] -= l[i][k] * y[k];
      y[i] /= l[i][i];
    }
    for (int32_t i = block - 1; i >= 0; i--) {
      for (int32_t k = i + 1; k < block; k++) y[i] -= l[k][i] * y[k];
      y[i] /= l[i][i];
      inverse[i * block + column] = y[i];
    }
  }
  return 1;
}

int petsc_diagonal_invert(const msim_system *A, double *inverse) {
  const int32_t block = A->block;
  for (int32_t i = 0; i < A->n; i++) {
    double d[9] = {0};
    for (int32_t c = 0; c < block; c++) {
      const int32_t row = block * i + c;
      for (int32_t e = A->rowptr[row]; e < A->rowptr[row + 1]; e++)
        if (A->colind[e] / block == i) d[c * block + A->colind[e] % block] = A->val[e];
    }
    if (!invert_block(block, d, inverse + (size_t)i * (size_t)(block * block))) return 0;
  }
  return 1;
}

double petsc_diagonal_product(const msim_system *A, const double *inverse, const double *r) {
  double sum = 0;
  for (int32_t i = 0; i < A->n; i++)
    for (int32_t c = 0; c < A->block; c++)
      for (int32_t d = 0; d < A->block; d++)
        sum +=
            r[A->block * i + c] * r[A->block * i + d] * inverse[(A->block * i + c) * A->block + d];
  return sum;
}
