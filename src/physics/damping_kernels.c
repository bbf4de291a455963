/* Compiled once for each instruction set MS_ISA, for 2 and for 3 components. */
#include "physics/damping_kernels.h"

#include "physics/lanes.h"

/* a.b, not by ms_dot_vec(), which fuses */
MS_INLINE ms_lanes dot(int dims, ms_lane_vectors a, ms_lane_vectors b) {
  ms_lanes sum = a.c[0] * b.c[0];
  for (int c = 1; c < dims; c++) sum += a.c[c] * b.c[c];
  return sum;
}

/* sum += h^2 K (z_j - z_i) of an entry; x, v and z of its rows. With z for z_j - z_i
 *   h^2 K z = h^2 c/l^2 ((d.w) z + (w.z - 2 (d.w)(d.z)/l^2) d). */
MS_INLINE void add_entry(int dims, const ms_damping_job *j, int32_t entry, size_t lane,
                         const ms_lane_vectors own[3], ms_lane_vectors *sum) {
  const ms_half_edges *half_edges = &j->model->half_edges;
  const size_t stride = (size_t)j->model->unknowns.stride;
  const ms_damping_derivative *t = j->t;
  const ms_lanes damping =
      ms_simd_load(half_edges->damping + (size_t)half_edges->entry[entry].value + lane);
  const ms_lane_vectors xj = ms_load_neighbours(dims, half_edges, entry, lane, t->x, stride),
                        vj = ms_load_neighbours(dims, half_edges, entry, lane, t->v, stride),
                        zj = ms_load_neighbours(dims, half_edges, entry, lane, j->z, stride);
  const ms_lane_vectors d = ms_subtract_vec(dims, xj, own[0]),
                        w = ms_subtract_vec(dims, vj, own[1]),
                        along = ms_subtract_vec(dims, zj, own[2]);
  const ms_lanes zero = {0}, l2 = dot(dims, d, d), rate = dot(dims, d, w);
  const ms_mask acts = (damping != 0) & ((l2 > MS_MIN_LENGTH2) | (l2 != l2));
  const ms_lanes inverse = 1 / l2, by = t->h * t->h * damping * inverse,
                 turn = dot(dims, w, along) - 2 * rate * inverse * dot(dims, d, along);
  for (int c = 0; c < dims; c++)
    sum->c[c] += ms_simd_select(acts, by * (rate * along.c[c] + turn * d.c[c]), zero);
}

/* y -= the sums of slices; the negative sums of parts go to part_sums. */
MS_INLINE void apply_of(int dims, const ms_damping_job *j, int32_t begin, int32_t end) {
  const ms_half_edges *half_edges = &j->model->half_edges;
  const size_t stride = (size_t)j->model->unknowns.stride;
  const double *const vectors[3] = {j->t->x, j->t->v, j->z};
  for (int32_t range = begin; range < end; range++) {
    const ms_slice_range p = ms_slice_range_at(half_edges, range, j->y, stride);
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      ms_lane_vectors own[3], sum = {{{0}}}, y = sum;
      for (int k = 0; k < 3; k++) own[k] = ms_load_own(dims, p, lane, vectors[k], stride);
      for (int32_t entry = half_edges->first[range]; entry < half_edges->first[range + 1]; entry++)
        add_entry(dims, j, entry, lane, own, &sum);
      if (!p.is_split) y = ms_load_vec(dims, p.sums + lane, p.stride);
      ms_store_vec(dims, p.sums + lane, p.stride, ms_subtract_vec(dims, y, sum));
    }
  }
}

static void apply(const ms_damping_job *j, int32_t begin, int32_t end) {
  if (j->model->unknowns.dims == 3) apply_of(3, j, begin, end);
  else apply_of(2, j, begin, end);
}

const ms_damping_kernels MS_TABLE(ms_damping_kernels) = {apply};
