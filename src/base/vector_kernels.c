/* Compiled once for each instruction set, with MS_ISA defined as its name. */
#include "base/vector_kernels.h"

#include <math.h>

#include "base/simd.h"

/* Process whole blocks of `registers` registers, whose sums stay in registers; return the index of
 * the first row that is left. */
MS_INLINE size_t combine_blocks(int registers, const double *x, int n, const double *w,
                                const double *const *y, size_t at, size_t end, double *z) {
  enum { MOST = 4 };
  const size_t block = (size_t)registers * MS_LANES;
  for (; at + block <= end; at += block) {
    ms_lanes sum[MOST] = {{0}};
    for (int k = 0; k < n; k++)
      for (int i = 0; i < registers; i++) sum[i] += w[k] * ms_simd_load(y[k] + at + i * MS_LANES);
    for (int i = 0; i < registers; i++) {
      const size_t row = at + (size_t)i * MS_LANES;
      ms_simd_store(z + row, (x ? ms_simd_load(x + row) : (ms_lanes){0}) + sum[i]);
    }
  }
  return at;
}

/* x + sum of w y for one register of rows */
MS_INLINE ms_lanes combine_register(const double *x, int n, const double *w, const double *const *y,
                                    size_t row) {
  ms_lanes sum = {0};
  for (int k = 0; k < n; k++) sum += w[k] * ms_simd_load(y[k] + row);
  return (x ? ms_simd_load(x + row) : (ms_lanes){0}) + sum;
}

/* Rows that do not fill a register are computed in one that overlaps the register before, at first,
 * as z may be x or one of y. */
static void linear_combination(ms_shape s, const double *x, int n, const double *w,
                               const double *const *y, double *z) {
  const int overlaps = s.n > MS_LANES && s.n % MS_LANES != 0;
  ms_lanes last = {0};
  for (size_t at = 0; at < (size_t)s.dims * (size_t)s.stride; at += (size_t)s.stride) {
    const size_t end = at + (size_t)s.n;
    if (overlaps) last = combine_register(x, n, w, y, end - MS_LANES);
    size_t row = combine_blocks(4, x, n, w, y, at, end, z);
    row = combine_blocks(1, x, n, w, y, row, end, z);
    if (overlaps) ms_simd_store(z + end - MS_LANES, last);
    for (; row < end && !overlaps; row++) {
      double sum = 0;
      for (int k = 0; k < n; k++) sum += w[k] * y[k][row];
      z[row] = (x ? x[row] : 0) + sum;
    }
  }
}

/* (c x)^2 is infinite or NaN if x is NaN or beyond MS_LARGEST_VALID, and so is any sum that
 * contains it. */
static int is_valid(ms_shape s, const double *x) {
  enum { REGISTERS = 2 };
  const double c =
      1.35e154 / MS_LARGEST_VALID; /* c MS_LARGEST_VALID exceeds the root of the largest double */
  ms_lanes lanes[REGISTERS] = {{0}};
  double sum = 0;
  for (size_t at = 0; at < (size_t)s.dims * (size_t)s.stride; at += (size_t)s.stride) {
    int32_t r = 0;
    for (; r + REGISTERS * MS_LANES <= s.n; r += REGISTERS * MS_LANES)
      for (int i = 0; i < REGISTERS; i++) {
        const ms_lanes y = c * ms_simd_load(x + at + r + i * MS_LANES);
        lanes[i] += y * y;
      }
    for (; r < s.n; r++) sum += (c * x[at + (size_t)r]) * (c * x[at + (size_t)r]);
  }
  lanes[0] += lanes[1];
  for (int i = 0; i < MS_LANES; i++) sum += lanes[0][i];
  return isfinite(sum);
}

const ms_vector_kernels MS_TABLE(ms_vector_kernels) = {linear_combination, is_valid};
