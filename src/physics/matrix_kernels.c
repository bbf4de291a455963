/* Compiled once for each instruction set MS_ISA; every loop is built for 2 and for 3 components. */
#include "physics/matrix_kernels.h"

#include <math.h>

#include "physics/lanes.h"
#include "physics/spring_law.h"

/*------------------------------------- matrix ---------------------------------------------------*/

/* Lanes with l2 = |d|^2 > MS_MIN_LENGTH2. NaN counts, so that it propagates to the result. */
MS_INLINE ms_mask has_direction(ms_lanes l2) { return (l2 > MS_MIN_LENGTH2) | (l2 != l2); }

/* 1/|d|; 0 where d has no direction */
MS_INLINE ms_lanes inverse_length(int dims, ms_lane_vectors d) {
  const ms_lanes zero = {0}, l2 = ms_dot_vec(dims, d, d);
  const ms_mask there = has_direction(l2);
  ms_lanes inverse;
  ms_simd_sqrt_and_inverse(ms_simd_select(there, l2, zero + 1), &inverse);
  return ms_simd_select(there, inverse, zero);
}

/* t and g of force.h */
MS_INLINE void half_edge_coefficients(int damped, const ms_coefficients_job *j, ms_lanes inverse,
                                      int32_t entry, size_t lane, ms_lanes *t, ms_lanes *g) {
  const ms_half_edges *half_edges = &j->model->half_edges;
  const size_t value = (size_t)half_edges->entry[entry].value + lane;
  const double h = j->h;
  const ms_lanes largest = (ms_lanes){0} + (j->clamp ? 1 : INFINITY);
  const ms_lanes hhk = h * h * ms_simd_load(half_edges->k + value);
  const ms_lanes full = ms_simd_load(half_edges->rest + value) * inverse;
  const ms_lanes ratio = ms_simd_select(full > largest, largest, full);
  ms_lanes gl2 = MS_SPRING_STIFFNESS_DIFFERENCE(hhk, ratio);
  if (damped) gl2 += h * ms_simd_load(half_edges->damping + value);
  *t = MS_SPRING_STIFFNESS_ACROSS(hhk, ratio);
  *g = gl2 * inverse * inverse;
}

/* sum += t I + g d d^T, in the order of ms_coefficients_diagonal_element */
MS_INLINE void add_diagonal_block(int dims, ms_lanes t, ms_lanes g, ms_lane_vectors d,
                                  ms_lanes sum[6]) {
  for (int b = 0; b < dims; b++) {
    const ms_lanes gd = g * d.c[b];
    sum[b] += ms_simd_fma(gd, d.c[b], t);
    for (int c = b + 1; c < dims; c++) {
      const size_t e = ms_coefficients_diagonal_element((size_t)dims, (size_t)b, (size_t)c);
      sum[e] = ms_simd_fma(gd, d.c[c], sum[e]);
    }
  }
}

/* Entries whose roots are computed ahead of what depends on them, to keep the divider busy */
enum { ENTRIES_AHEAD = 16 };

MS_INLINE void compute_coefficients_of(int dims, int damped, const ms_coefficients_job *j,
                                       int32_t begin, int32_t end) {
  const ms_model local = *j->model, *model = &local; /* stores cannot change it */
  const ms_coefficients_job job = {model, j->x, j->h, j->clamp, j->a};
  const ms_coefficients *a = j->a;
  const double *x = j->x;
  const size_t stride = (size_t)model->unknowns.stride, sd = (size_t)model->unknowns.first_pinned;
  const ms_half_edges *half_edges = &model->half_edges;
  double *to_t = a->t, *to_g = a->g;
  for (int32_t s = begin; s < end; s++) {
    const ms_slice_range p = ms_slice_range_at(half_edges, s, a->diagonal, sd);
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      const ms_lane_vectors xi = ms_load_own(dims, p, lane, x, stride);
      const ms_lanes zero = {0};
      const ms_lanes own = p.is_split ? zero : ms_simd_load(model->mass + p.row + lane) + a->drag;
      ms_lanes sum[6];
      for (int c = 0; c < 6; c++) sum[c] = c < dims ? own : zero;
      for (int32_t first = half_edges->first[s], next; first < half_edges->first[s + 1];
           first = next) {
        ms_lanes inverse[ENTRIES_AHEAD];
        next = half_edges->first[s + 1] - first < ENTRIES_AHEAD ? half_edges->first[s + 1]
                                                                : first + ENTRIES_AHEAD;
        for (int32_t entry = first; entry < next; entry++) {
          const ms_lane_vectors xj = ms_load_neighbours(dims, half_edges, entry, lane, x, stride);
          inverse[entry - first] = inverse_length(dims, ms_subtract_vec(dims, xj, xi));
        }
        for (int32_t entry = first; entry < next; entry++) {
          const size_t at = MS_SLICE * (size_t)entry + lane;
          const ms_lane_vectors xj = ms_load_neighbours(dims, half_edges, entry, lane, x, stride);
          const ms_lane_vectors d = ms_subtract_vec(dims, xj, xi);
          ms_lanes t, g;
          half_edge_coefficients(damped, &job, inverse[entry - first], entry, lane, &t, &g);
          ms_simd_store(to_t + at, t);
          ms_simd_store(to_g + at, g);
          add_diagonal_block(dims, t, g, d, sum);
        }
      }
      for (size_t e = 0; e < ms_coefficients_diagonal_size((size_t)dims); e++)
        ms_simd_store(p.sums + lane + e * p.stride, sum[e]);
    }
  }
}

static void compute_coefficients(const ms_coefficients_job *j, int32_t begin, int32_t end) {
  const int damped = (j->model->features & MS_HAS_DAMPING) != 0;
  if (j->model->unknowns.dims == 3) {
    if (damped) compute_coefficients_of(3, 1, j, begin, end);
    else compute_coefficients_of(3, 0, j, begin, end);
  } else {
    if (damped) compute_coefficients_of(2, 1, j, begin, end);
    else compute_coefficients_of(2, 0, j, begin, end);
  }
}

/*------------------------------------- products -------------------------------------------------*/

/* y_i = (share m_i + h b) x_i + sum over half-edges of (t I + g d d^T)(x_i - x_j): for a common
 * translation the sum is exactly 0. */
MS_INLINE void multiply_matrix_of(int dims, const ms_product_job *j, int32_t begin, int32_t end) {
  const ms_model *model = j->model;
  const ms_coefficients *a = j->a;
  const double share = j->share, *x = j->x;
  double *y = j->y;
  const size_t stride = (size_t)model->unknowns.stride;
  const ms_half_edges *half_edges = &model->half_edges;
  for (int32_t s = begin; s < end; s++) {
    const ms_slice_range p = ms_slice_range_at(half_edges, s, y, stride);
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      const ms_lane_vectors xi = ms_load_own(dims, p, lane, a->x, stride);
      const ms_lane_vectors own = ms_load_own(dims, p, lane, x, stride);
      ms_lane_vectors sum = {{{0}}};
      if (!p.is_split)
        sum =
            ms_fma_vec(dims, share * ms_simd_load(model->mass + p.row + lane) + a->drag, own, sum);
      for (int32_t entry = half_edges->first[s]; entry < half_edges->first[s + 1]; entry++) {
        const size_t at = MS_SLICE * (size_t)entry + lane;
        const ms_lane_vectors other = ms_load_neighbours(dims, half_edges, entry, lane, x, stride);
        const ms_lane_vectors xj = ms_load_neighbours(dims, half_edges, entry, lane, a->x, stride);
        const ms_lane_vectors e = ms_subtract_vec(dims, own, other),
                              d = ms_subtract_vec(dims, xj, xi);
        sum = ms_fma_vec(dims, ms_simd_load(a->t + at), e, sum);
        sum = ms_fma_vec(dims, ms_simd_load(a->g + at) * ms_dot_vec(dims, d, e), d, sum);
      }
      ms_store_vec(dims, p.sums + lane, p.stride, sum);
    }
  }
}

static void multiply_matrix(const ms_product_job *j, int32_t begin, int32_t end) {
  if (j->model->unknowns.dims == 3) multiply_matrix_of(3, j, begin, end);
  else multiply_matrix_of(2, j, begin, end);
}

/* y_i = (share m_i + h b) x_i + sum of t (x_i - x_j), for each component */
MS_INLINE void multiply_scalar_matrix_of(int dims, const ms_product_job *j, int32_t begin,
                                         int32_t end) {
  const ms_model *model = j->model;
  const ms_coefficients *a = j->a;
  const double share = j->share, *x = j->x;
  double *y = j->y;
  const size_t stride = (size_t)model->unknowns.stride;
  const ms_half_edges *half_edges = &model->half_edges;
  for (int32_t s = begin; s < end; s++) {
    const ms_slice_range p = ms_slice_range_at(half_edges, s, y, stride);
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      const ms_lane_vectors own = ms_load_own(dims, p, lane, x, stride);
      ms_lane_vectors sum = {{{0}}};
      if (!p.is_split)
        sum =
            ms_fma_vec(dims, share * ms_simd_load(model->mass + p.row + lane) + a->drag, own, sum);
      for (int32_t entry = half_edges->first[s]; entry < half_edges->first[s + 1]; entry++) {
        const ms_lanes t = ms_simd_load(a->t + MS_SLICE * (size_t)entry + lane);
        const ms_lane_vectors other = ms_load_neighbours(dims, half_edges, entry, lane, x, stride);
        sum = ms_fma_vec(dims, t, ms_subtract_vec(dims, own, other), sum);
      }
      ms_store_vec(dims, p.sums + lane, p.stride, sum);
    }
  }
}

static void multiply_scalar_matrix(const ms_product_job *j, int32_t begin, int32_t end) {
  if (j->components == 3) multiply_scalar_matrix_of(3, j, begin, end);
  else if (j->components == 2) multiply_scalar_matrix_of(2, j, begin, end);
  else multiply_scalar_matrix_of(1, j, begin, end);
}

/*------------------------------------- energy ---------------------------------------------------*/

/* One register of half-edges. With e = x_j - x_i, l = |e|, q = lambda h (d_j - d_i), a = q.e/l and
 * |e + q| = l + a + more, a spring contributes
 * E(l + a + more) - E(l) - f(l) a. */
MS_INLINE ms_lanes half_edge_nonlinearity(int dims, const ms_half_edges *half_edges, size_t value,
                                          ms_lane_vectors e, ms_lane_vectors q) {
  const ms_lanes zero = {0}, inverse = inverse_length(dims, e);
  const ms_lanes l = inverse * ms_dot_vec(dims, e, e), a = inverse * ms_dot_vec(dims, e, q);
  const ms_lanes across = ms_dot_vec(dims, q, q) - a * a, sum = l + a;
  const ms_lanes p2 = ms_simd_select(across > zero, across, zero);
  const ms_lanes next = ms_simd_sqrt(ms_simd_fma(sum, sum, p2));
  const ms_mask ahead = sum > zero;
  const ms_lanes more =
      ms_simd_select(ahead, p2 / ms_simd_select(ahead, next + sum, zero + 1), next - sum);
  const ms_lanes k = ms_simd_load(half_edges->k + value),
                 rest = ms_simd_load(half_edges->rest + value);
  return MS_SPRING_ENERGY_BEYOND(k, rest, l, a, more);
}

MS_INLINE double sum_nonlinearity_of(int dims, const ms_nonlinearity_job *j, int32_t begin,
                                     int32_t end) {
  const ms_model *model = j->model;
  const double *x = j->x, *d = j->d;
  const size_t stride = (size_t)model->unknowns.stride;
  const ms_half_edges *half_edges = &model->half_edges;
  double sums[MS_SLICE] = {0};
  for (int32_t s = begin; s < end; s++) {
    const ms_slice_range p = ms_slice_range_at(half_edges, s, NULL, 0);
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      const ms_lane_vectors xi = ms_load_own(dims, p, lane, x, stride);
      const ms_lane_vectors di = ms_load_own(dims, p, lane, d, stride);
      ms_lanes sum = ms_simd_load(sums + lane);
      for (int32_t entry = half_edges->first[s]; entry < half_edges->first[s + 1]; entry++) {
        const size_t at = MS_SLICE * (size_t)entry + lane;
        const ms_lane_vectors xj = ms_load_neighbours(dims, half_edges, entry, lane, x, stride);
        ms_lane_vectors q =
            ms_subtract_vec(dims, ms_load_neighbours(dims, half_edges, entry, lane, d, stride), di);
        for (int c = 0; c < dims; c++) q.c[c] *= j->lambda * j->h;
        double share[MS_LANES];
        for (size_t i = 0; i < MS_LANES; i++)
          share[i] =
              ms_half_edges_neighbour(half_edges, (int32_t)(at + i)) < model->unknowns.first_fixed
                  ? 0.5
                  : 1;
        sum = ms_simd_fma(
            ms_simd_load(share),
            half_edge_nonlinearity(dims, half_edges, (size_t)half_edges->entry[entry].value + lane,
                                   ms_subtract_vec(dims, xj, xi), q),
            sum);
      }
      ms_simd_store(sums + lane, sum);
    }
  }
  return ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]));
}

static double sum_nonlinearity(const ms_nonlinearity_job *j, int32_t begin, int32_t end) {
  return j->model->unknowns.dims == 3 ? sum_nonlinearity_of(3, j, begin, end)
                                      : sum_nonlinearity_of(2, j, begin, end);
}

const ms_matrix_kernels MS_TABLE(ms_matrix_kernels) = {compute_coefficients, multiply_matrix,
                                                       multiply_scalar_matrix, sum_nonlinearity};
