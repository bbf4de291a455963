/* slice_pair - springs of two neighbouring slices in registers of 16 floats
 *
 * AVX-512 has registers for 16 floats, but slices have 8 rows (half_edges.h). An entry of one slice
 * and one of the next fill a register; each row adds its springs in the same order as alone, so
 * that its bits are those of single slices. */
#ifndef MS_SLICE_PAIR_H
#define MS_SLICE_PAIR_H

#include "physics/lanes.h"
#include "physics/single.h"
#include "physics/spring_law.h"

typedef float ms_pair __attribute__((vector_size(4 * 2 * MS_SLICE)));

typedef struct ms_pair_vectors {
  ms_pair c[3];
} ms_pair_vectors;

MS_INLINE ms_pair ms_pair_load(const float *from) { return (ms_pair)_mm512_loadu_ps(from); }

MS_INLINE ms_pair ms_pair_join(ms_lanes low, ms_lanes high) {
  const __m512d wide = _mm512_castpd256_pd512((__m256d)low);
  return (ms_pair)_mm512_insertf64x4(wide, (__m256d)high, 1);
}

MS_INLINE ms_lanes ms_pair_low(ms_pair v) { return (ms_lanes)_mm512_castps512_ps256((__m512)v); }

MS_INLINE ms_lanes ms_pair_high(ms_pair v) {
  return (ms_lanes)_mm512_extractf64x4_pd((__m512d)v, 1);
}

/* a b + c and c - a b */
MS_INLINE ms_pair ms_pair_fma(ms_pair a, ms_pair b, ms_pair c) {
  return (ms_pair)_mm512_fmadd_ps((__m512)a, (__m512)b, (__m512)c);
}

MS_INLINE ms_pair ms_pair_fnma(ms_pair a, ms_pair b, ms_pair c) {
  return (ms_pair)_mm512_fnmadd_ps((__m512)a, (__m512)b, (__m512)c);
}

MS_INLINE ms_pair ms_pair_dot(int dims, ms_pair_vectors a, ms_pair_vectors b) {
  ms_pair sum = a.c[0] * b.c[0];
  for (int c = 1; c < dims; c++) sum = ms_pair_fma(a.c[c], b.c[c], sum);
  return sum;
}

/* The values of two entries' springs, which most often are alike (spring_values.h) */
MS_INLINE ms_pair ms_pair_load_values(const float *of, size_t low, size_t high) {
  if (low == high) return (ms_pair)_mm512_broadcast_f64x4((__m256d)ms_simd_load(of + low));
  return ms_pair_join(ms_simd_load(of + low), ms_simd_load(of + high));
}

/* own - x of the neighbours in two entries, which most often are consecutive rows */
MS_INLINE ms_pair_vectors ms_pair_subtract_neighbours(int dims, const ms_half_edges *half_edges,
                                                      int32_t low, int32_t high, const float *x,
                                                      size_t stride, ms_pair_vectors own) {
  const int32_t start = half_edges->entry[low].start;
  ms_pair_vectors d = {{{0}}};
  if (start >= 0 && half_edges->entry[high].start == start + MS_SLICE) {
    for (int c = 0; c < dims; c++)
      d.c[c] = own.c[c] - ms_pair_load(x + (size_t)start + (size_t)c * stride);
  } else {
    const ms_lane_vectors i = ms_load_neighbours(dims, half_edges, low, 0, x, stride);
    const ms_lane_vectors j = ms_load_neighbours(dims, half_edges, high, 0, x, stride);
    for (int c = 0; c < dims; c++) d.c[c] = own.c[c] - ms_pair_join(i.c[c], j.c[c]);
  }
  return d;
}

/* What times d is the force of a spring, as spring_force_factor() computes it */
MS_INLINE ms_pair ms_pair_force_factor(int dims, int damped, ms_pair_vectors d, ms_pair_vectors dv,
                                       const ms_single *of, size_t low, size_t high) {
  const ms_pair zero = {0};
  const ms_pair l2 =
      (ms_pair)_mm512_max_ps((__m512)(zero + FLT_MIN), (__m512)ms_pair_dot(dims, d, d));
  const ms_pair r = (ms_pair)_mm512_rsqrt14_ps((__m512)l2);
  const ms_pair two_over_l = r * ms_pair_fnma(l2 * r, r, zero + 3);
  const ms_pair scale = ms_pair_fnma(ms_pair_load_values(of->half_k_rest, low, high), two_over_l,
                                     ms_pair_load_values(of->k, low, high));
  if (!damped) return scale;
  const ms_pair rate = ms_pair_dot(dims, d, dv);
  const ms_pair c = ms_pair_load_values(of->quarter_damping, low, high);
  return ms_pair_fma(MS_DASHPOT_FORCE(c, rate) * two_over_l, two_over_l, scale);
}

#endif
