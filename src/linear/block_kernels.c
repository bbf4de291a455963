/* This file is compiled once per instruction set, MS_ISA. */
#include "linear/block_kernels.h"

#include <math.h>

#include "base/simd.h"

#define MOST_QUADS (MS_BLOCK_CHOLESKY_MAX_BLOCK / 4)

static int invert_factor(size_t n, double *a, double *inverse) {
  for (size_t j = 0; j < n; j++) {
    for (size_t k = 0; k < j; k++)
      for (size_t i = j; i < n; i++) a[j * n + i] -= a[k * n + i] * a[k * n + j];
    if (!(a[j * n + j] > 0)) return 0;
    const double d = sqrt(a[j * n + j]);
    a[j * n + j] = d;
    for (size_t i = j + 1; i < n; i++) a[j * n + i] /= d;
  }
  for (size_t j = 0; j < n; j++) {
    double *x = inverse + j * n; /* L x = e_j */
    for (size_t i = 0; i < n; i++) x[i] = i == j;
    for (size_t k = j; k < n; k++) {
      x[k] /= a[k * n + k];
      for (size_t i = k + 1; i < n; i++) x[i] -= a[k * n + i] * x[k];
    }
  }
  return 1;
}

/* out = columns [j, j + 4) of a b^T; n is a constant where this is inlined */
MS_INLINE void multiply_transpose(size_t n, const double *a, const double *b, size_t j,
                                  ms_quad out[4][MOST_QUADS]) {
  for (size_t c = 0; c < 4; c++)
    for (size_t q = 0; q < n / 4; q++) out[c][q] = (ms_quad){0};
  for (size_t k = 0; k < n; k++) {
    ms_quad column[MOST_QUADS];
    for (size_t q = 0; q < n / 4; q++) column[q] = ms_simd_load_quad(a + k * n + 4 * q);
    for (size_t c = 0; c < 4; c++)
      for (size_t q = 0; q < n / 4; q++) out[c][q] += column[q] * b[k * n + j + c];
  }
}

MS_INLINE void subtract_product_of(size_t n, const double *a, const double *b, double *target) {
  for (size_t j = 0; j < n; j += 4) {
    ms_quad p[4][MOST_QUADS];
    multiply_transpose(n, a, b, j, p);
    for (size_t c = 0; c < 4; c++)
      for (size_t q = 0; q < n / 4; q++) {
        double *to = target + (j + c) * n + 4 * q;
        ms_simd_store_quad(to, ms_simd_load_quad(to) - p[c][q]);
      }
  }
}

static void subtract_product(size_t n, const double *a, const double *b, double *target) {
  if (n == 12) subtract_product_of(12, a, b, target);
  else subtract_product_of(8, a, b, target);
}

static void times_transpose(size_t n, double *a, const double *b, float *rounded) {
  ms_quad p[MS_BLOCK_CHOLESKY_MAX_BLOCK / 4][4][MOST_QUADS];
  for (size_t j = 0; j < n; j += 4) {
    if (n == 12) multiply_transpose(12, a, b, j, p[j / 4]);
    else multiply_transpose(8, a, b, j, p[j / 4]);
  }
  for (size_t j = 0; j < n; j++)
    for (size_t q = 0; q < n / 4; q++) ms_simd_store_quad(a + j * n + 4 * q, p[j / 4][j % 4][q]);
  for (size_t i = 0; i < n * n; i++) rounded[i] = (float)a[i];
}

/*------------------------------------- solves ---------------------------------------------------*/

enum { AHEAD = 16 /* blocks */ };

/* x_k = L_kk^-1 x_k, then x_row -= L_row,k x_k for the other rows of column k. many: the factor
 * exceeds MS_CACHE */
MS_INLINE void forward(size_t n, int many, const ms_block_cholesky *chol, int32_t k, double *x) {
  const int32_t begin = chol->first[k], end = chol->first[k + 1];
  double xk[MS_BLOCK_CHOLESKY_MAX_BLOCK];
  for (int32_t b = begin; b < end; b++) {
    const float *l = chol->factor + n * n * (size_t)b;
    double *y = x + n * (size_t)chol->row[b];
    if (many) ms_simd_prefetch(l, n * n * sizeof *l, AHEAD * n * n * sizeof *l);
    ms_quad sum[MOST_QUADS];
    for (size_t q = 0; q < n / 4; q++) sum[q] = (ms_quad){0};
    for (size_t c = 0; c < n; c++) {
      const double s = b == begin ? y[c] : xk[c];
      for (size_t q = 0; q < n / 4; q++) sum[q] += ms_simd_load_float_quad(l + c * n + 4 * q) * s;
    }
    for (size_t q = 0; q < n / 4; q++) {
      if (b == begin) ms_simd_store_quad(xk + 4 * q, sum[q]);
      ms_simd_store_quad(y + 4 * q, b == begin ? sum[q] : ms_simd_load_quad(y + 4 * q) - sum[q]);
    }
  }
}

/* sums[c] += column c of the block times y, lane by lane */
MS_INLINE void add_transposed(size_t n, const float *l, const double *y, ms_quad *sums) {
  for (size_t c = 0; c < n; c++)
    for (size_t q = 0; q < n / 4; q++)
      sums[c] += ms_simd_load_float_quad(l + c * n + 4 * q) * ms_simd_load_quad(y + 4 * q);
}

/* x_k = L_kk^-T (x_k - sum of L_row,k^T x_row) */
MS_INLINE void backward(size_t n, int many, const ms_block_cholesky *chol, int32_t k, double *x) {
  const size_t area = n * n;
  ms_quad sums[MS_BLOCK_CHOLESKY_MAX_BLOCK];
  double *xk = x + n * (size_t)k;
  for (size_t c = 0; c < n; c++) sums[c] = (ms_quad){0};
  for (int32_t b = chol->first[k] + 1; b < chol->first[k + 1]; b++) {
    const float *l = chol->factor + area * (size_t)b;
    if (many && b >= AHEAD) ms_simd_prefetch(l - AHEAD * area, area * sizeof *l, 0);
    add_transposed(n, l, x + n * (size_t)chol->row[b], sums);
  }
  double y[MS_BLOCK_CHOLESKY_MAX_BLOCK];
  for (size_t c = 0; c < n; c += 4)
    ms_simd_store_quad(y + c,
                       ms_simd_load_quad(xk + c) -
                           ms_simd_quad_sums(sums[c], sums[c + 1], sums[c + 2], sums[c + 3]));
  for (size_t c = 0; c < n; c++) sums[c] = (ms_quad){0};
  add_transposed(n, chol->factor + area * (size_t)chol->first[k], y, sums);
  for (size_t c = 0; c < n; c += 4)
    ms_simd_store_quad(xk + c, ms_simd_quad_sums(sums[c], sums[c + 1], sums[c + 2], sums[c + 3]));
}

MS_INLINE void solve_of(size_t n, const ms_block_cholesky *chol, double *x) {
  const int many = sizeof(float) * n * n * (size_t)chol->first[chol->n] > MS_CACHE;
  for (int32_t k = 0; k < chol->n; k++) forward(n, many, chol, k, x);
  for (int32_t k = chol->n - 1; k >= 0; k--) backward(n, many, chol, k, x);
}

static void block_solve(const ms_block_cholesky *chol, double *x) {
  if (chol->block == 12) solve_of(12, chol, x);
  else solve_of(8, chol, x);
}

const ms_block_kernels MS_TABLE(ms_block_kernels) = {invert_factor, times_transpose,
                                                     subtract_product, block_solve};
