/* This file is compiled once per instruction set, MS_ISA. */
#include "linear/coarse_kernels.h"

#include "base/simd.h"

/* K = t I + w w^T of one half-edge, in the layout of ms_coefficients.diagonal */
MS_INLINE void spring_block(size_t dims, const float *coefficients, int32_t at, int braced,
                            double K[6]) {
  const float *a = coefficients + 4 * MS_SLICE * (size_t)(at / MS_SLICE) + at % MS_SLICE;
  const double t = braced && a[0] < 0 ? 0 : (double)a[0];
  double w[3];
  for (size_t c = 0; c < dims; c++) w[c] = (double)a[MS_SLICE * (c + 1)];
  for (size_t c = 0; c < dims; c++)
    for (size_t d = c; d < dims; d++)
      K[ms_coefficients_diagonal_element(dims, c, d)] = w[c] * w[d] + (c == d ? t : 0);
}

/* block += left (x) right, with rows (c, mode) from left and columns (d, mode) from right */
MS_INLINE void add_outer(size_t dims, double *block, ms_quad left, const ms_quad right[6]) {
  for (size_t d = 0; d < dims; d++)
    for (size_t mode = 0; mode < MS_MODES; mode++)
      for (size_t c = 0; c < dims; c++) {
        double *to = block + (MS_MODES * d + mode) * MS_MODES * dims + MS_MODES * c;
        ms_simd_store_quad(to,
                           ms_simd_load_quad(to) +
                               left * right[ms_coefficients_diagonal_element(dims, c, d)][mode]);
      }
}

/* Contributions of unknown i of aggregate a, with modes w_i: to the diagonal block
 * w_i (x) (m_i w_i + sum K_ij (w_i - w_j)), where w_j = 0 outside a; to the block of a and b
 * -w_i (x) K_ij w_j for j in b. block: the next one of the aggregate. Returns that of the next
 * unknown. */
MS_INLINE const int32_t *assemble_unknown(size_t dims, ms_coarse *coarse, const float *coefficients,
                                          const double *inertia, int32_t row,
                                          const int32_t *block) {
  const ms_model *model = coarse->model;
  const float *weight = coarse->aggregates.weight;
  const int32_t aggregate = coarse->aggregates.of[row];
  const size_t area = MS_MODES * dims * MS_MODES * dims;
  const ms_quad own = ms_simd_load_float_quad(weight + MS_MODES * row);
  ms_quad sum[6];
  for (size_t q = 0; q < 6; q++) sum[q] = q < dims ? own * inertia[row] : (ms_quad){0};
  const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, row);
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t j = ms_half_edges_neighbour(&model->half_edges, at);
    if (model->half_edges.spring[at] < 0) continue;
    double K[6];
    spring_block(dims, coefficients, at, coarse->drops_negative_t, K);
    const int32_t at_j = ms_aggregates_find(model, &coarse->aggregates, j);
    const int same = at_j == aggregate, owns = ms_coarse_owns_block(coarse, aggregate, at_j);
    const ms_quad other = ms_simd_load_float_quad(weight + MS_MODES * (same || owns ? j : row));
    const ms_quad difference = same ? own - other : own;
    for (size_t q = 0; q < ms_coefficients_diagonal_size(dims); q++) sum[q] += difference * K[q];
    if (!owns) continue;
    ms_quad right[6];
    for (size_t q = 0; q < ms_coefficients_diagonal_size(dims); q++) right[q] = -other * K[q];
    add_outer(dims, coarse->value + area * (size_t)*block++, own, right);
  }
  add_outer(dims, coarse->value + area * (size_t)coarse->diagonal[aggregate], own, sum);
  return block;
}

static void assemble_aggregate(ms_coarse *coarse, const float *coefficients, const double *inertia,
                               int32_t aggregate) {
  const ms_aggregates *g = &coarse->aggregates;
  const int32_t *block = coarse->block + coarse->first_block[aggregate];
  for (int32_t i = g->first[aggregate]; i < g->first[aggregate + 1]; i++) {
    if (coarse->model->unknowns.dims == 3)
      block = assemble_unknown(3, coarse, coefficients, inertia, g->unknown[i], block);
    else block = assemble_unknown(2, coarse, coefficients, inertia, g->unknown[i], block);
  }
}

/* Consecutive rows are mostly of the same part. It starts from 0 where it is met first: parts are
 * numbered in that order. */
MS_INLINE void restrict_rows_of(size_t dims, int single, ms_coarse *coarse, const void *r,
                                size_t begin, size_t end) {
  const double *doubles = r;
  const float *floats = r;
  const float *weight = coarse->aggregates.weight;
  const uint16_t *part = coarse->restriction.part;
  const size_t first = (size_t)coarse->restriction.first[begin / MS_RESTRICTION_ROWS];
  const size_t stride = (size_t)coarse->model->unknowns.stride;
  for (size_t row = begin, met = 0; row < end;) {
    const size_t own = part[row];
    double *to = coarse->restriction.sums + MS_MODES * dims * (first + own);
    ms_quad sum[3] = {{0}};
    if (own < met)
      for (size_t c = 0; c < dims; c++) sum[c] = ms_simd_load_quad(to + MS_MODES * c);
    else met = own + 1;
    for (; row < end && part[row] == own; row++) {
      const ms_quad w = ms_simd_load_float_quad(weight + MS_MODES * row);
      for (size_t c = 0; c < dims; c++)
        sum[c] += w * (single ? (double)floats[c * stride + row] : doubles[c * stride + row]);
    }
    for (size_t c = 0; c < dims; c++) ms_simd_store_quad(to + MS_MODES * c, sum[c]);
  }
}

static void restrict_rows(ms_coarse *coarse, int single, const void *r, size_t begin, size_t end) {
  const int is_spatial = coarse->model->unknowns.dims == 3;
  if (single) {
    if (is_spatial) restrict_rows_of(3, 1, coarse, r, begin, end);
    else restrict_rows_of(2, 1, coarse, r, begin, end);
  } else if (is_spatial) restrict_rows_of(3, 0, coarse, r, begin, end);
  else restrict_rows_of(2, 0, coarse, r, begin, end);
}

/* The parts of an aggregate are far apart in memory: fetch those of a later one. */
MS_INLINE void prefetch_parts(size_t dims, const ms_coarse *coarse, int32_t aggregate) {
  const ms_buckets *parts = &coarse->restriction.of;
  if (aggregate >= coarse->aggregates.n) return;
  for (int32_t p = parts->first[aggregate]; p < parts->first[aggregate + 1]; p++) {
    const double *sums = coarse->restriction.sums + MS_MODES * dims * (size_t)parts->item[p];
    __builtin_prefetch(sums);
    __builtin_prefetch(sums + MS_MODES * dims - 1);
  }
}

MS_INLINE void add_parts_of(size_t dims, ms_coarse *coarse, int32_t aggregate) {
  enum { AHEAD = 2 }; /* aggregates */
  const ms_buckets *parts = &coarse->restriction.of;
  ms_quad sum[3] = {{0}};
  prefetch_parts(dims, coarse, aggregate + AHEAD);
  for (int32_t p = parts->first[aggregate]; p < parts->first[aggregate + 1]; p++) {
    const double *from = coarse->restriction.sums + MS_MODES * dims * (size_t)parts->item[p];
    for (size_t c = 0; c < dims; c++) sum[c] += ms_simd_load_quad(from + MS_MODES * c);
  }
  double *to = coarse->r + MS_MODES * dims * (size_t)aggregate;
  for (size_t c = 0; c < dims; c++) ms_simd_store_quad(to + MS_MODES * c, sum[c]);
}

static void add_parts(ms_coarse *coarse, int32_t aggregate) {
  if (coarse->model->unknowns.dims == 3) add_parts_of(3, coarse, aggregate);
  else add_parts_of(2, coarse, aggregate);
}

const ms_coarse_kernels MS_TABLE(ms_coarse_kernels) = {assemble_aggregate, restrict_rows,
                                                       add_parts};
