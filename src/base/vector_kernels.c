/* Compiled once for each instruction set, with MS_ISA defined as its name. */
#include "base/vector_kernels.h"

#include <math.h>

#include "base/simd.h"

enum { MOST_SUMS = 2, MOST_REGISTERS = 4 };

/* The sums of some registers of rows, which stay in registers */
typedef struct register_sums {
  ms_lanes of[MOST_SUMS][MOST_REGISTERS];
} register_sums;

MS_INLINE register_sums sum_registers(int sums, int registers, int n, const double *const *y,
                                      const ms_combination *of, size_t row) {
  register_sums r = {{{{0}}}};
  for (int k = 0; k < n; k++)
    for (int i = 0; i < registers; i++) {
      const ms_lanes term = ms_simd_load(y[k] + row + i * MS_LANES);
      for (int j = 0; j < sums; j++) r.of[j][i] += of[j].w[k] * term;
    }
  for (int j = 0; j < sums; j++)
    for (int i = 0; i < registers; i++) {
      const double *x = of[j].x;
      r.of[j][i] += x ? ms_simd_load(x + row + i * MS_LANES) : (ms_lanes){0};
    }
  return r;
}

MS_INLINE void store_registers(int sums, int registers, register_sums r, const ms_combination *of,
                               size_t row) {
  for (int j = 0; j < sums; j++)
    for (int i = 0; i < registers; i++) ms_simd_store(of[j].z + row + i * MS_LANES, r.of[j][i]);
}

/* Compute whole blocks of `registers` registers; return the index of the first row that is left. */
MS_INLINE size_t combine_blocks(int sums, int registers, int n, const double *const *y,
                                const ms_combination *of, size_t at, size_t end) {
  const size_t block = (size_t)registers * MS_LANES;
  for (; at + block <= end; at += block)
    store_registers(sums, registers, sum_registers(sums, registers, n, y, of, at), of, at);
  return at;
}

/* Rows that do not fill a register are computed in one that overlaps the register before, at first,
 * as z may be x or one of y. */
MS_INLINE void combine(int sums, ms_shape s, int n, const double *const *y,
                       const ms_combination *of) {
  const int overlaps = s.n > MS_LANES && s.n % MS_LANES != 0;
  register_sums last = {{{{0}}}};
  for (size_t at = 0; at < (size_t)s.dims * (size_t)s.stride; at += (size_t)s.stride) {
    const size_t end = at + (size_t)s.n;
    if (overlaps) last = sum_registers(sums, 1, n, y, of, end - MS_LANES);
    size_t row = combine_blocks(sums, MOST_REGISTERS, n, y, of, at, end);
    row = combine_blocks(sums, 1, n, y, of, row, end);
    if (overlaps) store_registers(sums, 1, last, of, end - MS_LANES);
    for (; row < end && !overlaps; row++) {
      double sum[MOST_SUMS] = {0};
      for (int k = 0; k < n; k++)
        for (int j = 0; j < sums; j++) sum[j] += of[j].w[k] * y[k][row];
      for (int j = 0; j < sums; j++) of[j].z[row] = (of[j].x ? of[j].x[row] : 0) + sum[j];
    }
  }
}

static void combinations(ms_shape s, int n, const double *const *y, int sums,
                         const ms_combination *of) {
  if (sums == 1) combine(1, s, n, y, of);
  else combine(2, s, n, y, of);
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

const ms_vector_kernels MS_TABLE(ms_vector_kernels) = {combinations, is_valid};
