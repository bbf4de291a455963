/* lanes - arithmetic on spatial vectors, one in each lane of a SIMD register. `dims` is a constant
 * in the callers, so that the compiler unrolls all loops. */
#ifndef MS_LANES_H
#define MS_LANES_H

#include "base/simd.h"
#include "layout/half_edges.h"

typedef struct ms_lane_vectors {
  ms_lanes c[3];
} ms_lane_vectors;

MS_INLINE ms_lane_vectors ms_load_vec(int dims, const ms_real *from, size_t stride) {
  ms_lane_vectors v = {{{0}}};
  for (int c = 0; c < dims; c++) v.c[c] = ms_simd_load(from + (size_t)c * stride);
  return v;
}

MS_INLINE void ms_store_vec(int dims, ms_real *to, size_t stride, ms_lane_vectors v) {
  for (int c = 0; c < dims; c++) ms_simd_store(to + (size_t)c * stride, v.c[c]);
}

/* v + s d */
MS_INLINE ms_lane_vectors ms_fma_vec(int dims, ms_lanes s, ms_lane_vectors d, ms_lane_vectors v) {
  for (int c = 0; c < dims; c++) v.c[c] = ms_simd_fma(s, d.c[c], v.c[c]);
  return v;
}

/* v - s d */
MS_INLINE ms_lane_vectors ms_fnma_vec(int dims, ms_lanes s, ms_lane_vectors d, ms_lane_vectors v) {
  for (int c = 0; c < dims; c++) v.c[c] = ms_simd_fnma(s, d.c[c], v.c[c]);
  return v;
}

MS_INLINE ms_lane_vectors ms_subtract_vec(int dims, ms_lane_vectors a, ms_lane_vectors b) {
  for (int c = 0; c < dims; c++) a.c[c] -= b.c[c];
  return a;
}

MS_INLINE ms_lane_vectors ms_add_vec(int dims, ms_lane_vectors a, ms_lane_vectors b) {
  for (int c = 0; c < dims; c++) a.c[c] += b.c[c];
  return a;
}

MS_INLINE ms_lanes ms_dot_vec(int dims, ms_lane_vectors a, ms_lane_vectors b) {
  ms_lanes sum = a.c[0] * b.c[0];
  for (int c = 1; c < dims; c++) sum = ms_simd_fma(a.c[c], b.c[c], sum);
  return sum;
}

/* x of the neighbours in an entry: one load if they are consecutive rows, else a gather */
MS_INLINE ms_lane_vectors ms_load_neighbours(int dims, const ms_half_edges *half_edges,
                                             int32_t entry, size_t lane, const ms_real *x,
                                             size_t stride) {
  const int32_t start = half_edges->entry[entry].start;
  if (start >= 0) return ms_load_vec(dims, x + (size_t)start + lane, stride);
  const int32_t *j = ms_half_edges_scattered(half_edges, start) + lane;
  ms_lane_vectors v = {{{0}}};
  for (int c = 0; c < dims; c++) v.c[c] = ms_simd_gather(x + (size_t)c * stride, j);
  return v;
}

/* own - x of the neighbours in an entry. Consecutive rows are operands of the subtraction, which
 * needs no register for them: a load that both cases share would. */
MS_INLINE ms_lane_vectors ms_subtract_neighbours(int dims, const ms_half_edges *half_edges,
                                                 int32_t entry, size_t lane, const ms_real *x,
                                                 size_t stride, ms_lane_vectors own) {
  const int32_t start = half_edges->entry[entry].start;
  if (start >= 0)
    return ms_subtract_vec(dims, own, ms_load_vec(dims, x + (size_t)start + lane, stride));
  const int32_t *j = ms_half_edges_scattered(half_edges, start) + lane;
  for (int c = 0; c < dims; c++) own.c[c] -= ms_simd_gather(x + (size_t)c * stride, j);
  return own;
}

/* Sweeps over more than MS_CACHE bytes fetch what they need for an entry so many entries before. */
enum { MS_AHEAD = 64 };

/* The rows of a slice range, and the destination of its sums. */
typedef struct ms_slice_range {
  size_t row;    /* of lane 0 */
  int is_split;  /* 1: of a split row, to which all lanes belong */
  double *sums;  /* the first sum of lane 0 */
  size_t stride; /* from there to the next sum of lane 0 */
} ms_slice_range;

/* to: the sums of slices; NULL: not needed. */
MS_INLINE ms_slice_range ms_slice_range_at(const ms_half_edges *half_edges, int32_t range,
                                           double *to, size_t stride) {
  const int32_t part = range - half_edges->nslices;
  const size_t row = MS_SLICE * (size_t)range;
  if (part < 0) return (ms_slice_range){row, 0, to ? to + row : NULL, stride};
  return (ms_slice_range){(size_t)half_edges->part_row[part], 1,
                          half_edges->part_sums + MS_SLICE * (size_t)part,
                          MS_SLICE * (size_t)half_edges->nparts};
}

/* x of the slice range's own rows */
MS_INLINE ms_lane_vectors ms_load_own(int dims, ms_slice_range p, size_t lane, const ms_real *x,
                                      size_t stride) {
  if (!p.is_split) return ms_load_vec(dims, x + p.row + lane, stride);
  ms_lane_vectors v = {{{0}}};
  for (int c = 0; c < dims; c++) v.c[c] += x[(size_t)c * stride + p.row];
  return v;
}

#endif
