/* Kernels of pcg.h, for each instruction set MS_ISA: rounding a new matrix to floats. `dims` is a
 * constant where functions are inlined. */
#include <float.h>
#include <string.h>

#include "linear/pcg.h"
#include "physics/lanes.h"
#include "physics/particle_blocks.h"

/* t, wx, wy, wz of 8 half-edges, by entry, w = sqrt(g) d; dims = 0: a scalar matrix, w stays 0 */
MS_INLINE void pack_slice_range(int dims, ms_pcg *s, int32_t range) {
  const ms_coefficients *a = &s->base.system->a;
  const ms_model *model = s->base.system->model;
  const ms_half_edges *half_edges = &model->half_edges;
  const size_t stride = (size_t)model->unknowns.stride;
  const double by = 1 / s->jacobi.scale, root = sqrt(by);
  const ms_slice_range p = ms_slice_range_at(half_edges, range, NULL, 0);
  for (int32_t entry = half_edges->first[range]; entry < half_edges->first[range + 1]; entry++)
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      float *to = s->coefficients + 4 * MS_SLICE * (size_t)entry + lane;
      const size_t at = MS_SLICE * (size_t)entry + lane;
      ms_simd_store_floats(to, by * ms_simd_load(a->t + at));
      if (dims == 0) continue;
      const ms_lane_vectors xi = ms_load_own(dims, p, lane, a->x, stride);
      const ms_lane_vectors xj = ms_load_neighbours(dims, half_edges, entry, lane, a->x, stride);
      const ms_lane_vectors d = ms_subtract_vec(dims, xj, xi);
      const ms_lanes length = root * ms_simd_sqrt(ms_simd_load(a->g + at));
      for (int c = 0; c < dims; c++)
        ms_simd_store_floats(to + MS_SLICE * (size_t)(c + 1), length * d.c[c]);
    }
}

MS_INLINE void pack_slice_ranges(int dims, ms_pcg *s, int32_t begin, int32_t end) {
  for (int32_t range = begin; range < end; range++) pack_slice_range(dims, s, range);
}

/* Scale an inverse block that exceeds the range of floats, whereby it stays positive definite. The
 * largest entry of such a block is on its diagonal. */
static void shrink_to_float_range(ms_pcg *s, size_t block, size_t row) {
  const size_t stride = (size_t)s->base.system->model->unknowns.first_pinned;
  const double *from = s->jacobi.inverse + row;
  double largest = 0;
  for (size_t c = 0; c < block; c++) largest = fmax(largest, from[c * stride]);
  if (largest <= FLT_MAX) return;
  for (size_t q = 0; q < ms_coefficients_diagonal_size(block); q++)
    s->inverse[q * stride + row] = (float)(FLT_MAX / largest * from[q * stride]);
}

static void pack_unknowns(ms_pcg *s, size_t begin, size_t end) {
  const ms_model *model = s->base.system->model;
  const size_t dims = (size_t)model->unknowns.dims, stride = (size_t)model->unknowns.first_pinned;
  const size_t block = (size_t)s->jacobi.block, nfree = (size_t)model->unknowns.nfree;
  const double by = 1 / s->jacobi.scale;
  int beyond = 0;
  for (size_t r = begin; r < end; r++) /* masses of padding may exceed the range of floats */
    s->inertia[r] = r < nfree ? by * (model->mass[r] + s->base.system->a.drag) : 0;
  for (size_t r = begin; r < end && s->base.system->a.own; r++)
    s->inertia[r] += by * ms_particle_blocks_mean(model, s->base.system->a.own, (int32_t)r);
  for (size_t q = 0; q < ms_coefficients_diagonal_size(block); q++)
    for (size_t r = begin; r < end; r++) {
      s->inverse[q * stride + r] = (float)s->jacobi.inverse[q * stride + r];
      beyond |= s->jacobi.inverse[q * stride + r] > FLT_MAX;
    }
  for (size_t r = begin; r < end && beyond; r++) shrink_to_float_range(s, block, r);
  for (size_t c = 1; c < dims && block == 1; c++) /* repeat scalars along the diagonal of a block */
    memcpy(s->inverse + c * stride + begin, s->inverse + begin, (end - begin) * sizeof(float));
}

static void pack_slices(ms_pcg *s, int32_t begin, int32_t end) {
  const ms_model *model = s->base.system->model;
  const ms_half_edges *half_edges = &model->half_edges;
  /* split rows together with the last slices */
  const int32_t last = end < half_edges->nslices ? end : half_edges->nslices + half_edges->nparts;
  if (s->jacobi.block == 1) pack_slice_ranges(0, s, begin, last);
  else if (model->unknowns.dims == 3) pack_slice_ranges(3, s, begin, last);
  else pack_slice_ranges(2, s, begin, last);
  pack_unknowns(s, MS_SLICE * (size_t)begin, MS_SLICE * (size_t)end);
}

const ms_pcg_pack_kernels MS_TABLE(ms_pcg_pack_kernels) = {pack_slices};
