/* lanes - arithmetic on spatial vectors, one in each lane of a SIMD register. `dims` is a constant
 * in the callers, so that the compiler unrolls all loops. */
#ifndef MS_LANES_H
#define MS_LANES_H

#include "base/simd.h"
#include "layout/halves.h"

typedef struct ms_vec {
  ms_lanes c[3];
} ms_vec;

MS_INLINE ms_vec ms_load_vec(int dims, const double *from, size_t stride) {
  ms_vec v = {{{0}}};
  for (int c = 0; c < dims; c++) v.c[c] = ms_load(from + (size_t)c * stride);
  return v;
}

MS_INLINE void ms_store_vec(int dims, double *to, size_t stride, ms_vec v) {
  for (int c = 0; c < dims; c++) ms_store(to + (size_t)c * stride, v.c[c]);
}

/* v + s d */
MS_INLINE ms_vec ms_fma_vec(int dims, ms_lanes s, ms_vec d, ms_vec v) {
  for (int c = 0; c < dims; c++) v.c[c] = ms_fma(s, d.c[c], v.c[c]);
  return v;
}

MS_INLINE ms_vec ms_minus(int dims, ms_vec a, ms_vec b) {
  for (int c = 0; c < dims; c++) a.c[c] -= b.c[c];
  return a;
}

MS_INLINE ms_vec ms_plus(int dims, ms_vec a, ms_vec b) {
  for (int c = 0; c < dims; c++) a.c[c] += b.c[c];
  return a;
}

MS_INLINE ms_lanes ms_dot_vec(int dims, ms_vec a, ms_vec b) {
  ms_lanes sum = a.c[0] * b.c[0];
  for (int c = 1; c < dims; c++) sum = ms_fma(a.c[c], b.c[c], sum);
  return sum;
}

/* x of the neighbours in an entry: one load if they are consecutive rows, else a gather */
MS_INLINE ms_vec ms_load_neighbours(int dims, const ms_halves *halves, int32_t slot, size_t lane,
                                    const double *x, size_t stride) {
  const int32_t start = halves->start[slot];
  if (start >= 0) return ms_load_vec(dims, x + (size_t)start + lane, stride);
  const int32_t *j = halves->neighbour + MS_GROUP * (size_t)slot + lane;
  ms_vec v = {{{0}}};
  for (int c = 0; c < dims; c++) v.c[c] = ms_gather(x + (size_t)c * stride, j);
  return v;
}

/* The rows of a slice range, and the destination of its sums. */
typedef struct ms_place {
  size_t row;    /* of lane 0 */
  int is_part;   /* 1: of a split row, to which all lanes belong */
  double *sums;  /* the first sum of lane 0 */
  size_t stride; /* from there to the next sum of lane 0 */
} ms_place;

/* to: the sums of slices; NULL: not needed. */
MS_INLINE ms_place ms_place_of(const ms_halves *halves, int32_t segment, double *to,
                               size_t stride) {
  const int32_t part = segment - halves->ngroups;
  const size_t row = MS_GROUP * (size_t)segment;
  if (part < 0) return (ms_place){row, 0, to ? to + row : NULL, stride};
  return (ms_place){(size_t)halves->part_row[part], 1, halves->part_sums + MS_GROUP * (size_t)part,
                    MS_GROUP * (size_t)halves->nparts};
}

/* x of the slice range's own rows */
MS_INLINE ms_vec ms_load_own(int dims, ms_place p, size_t lane, const double *x, size_t stride) {
  if (!p.is_part) return ms_load_vec(dims, x + p.row + lane, stride);
  ms_vec v = {{{0}}};
  for (int c = 0; c < dims; c++) v.c[c] += x[(size_t)c * stride + p.row];
  return v;
}

#endif
