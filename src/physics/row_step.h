/* row_step - what a fused step computes of one register of rows, in the precision and with the
 * lanes of the file that includes this: kernels of single slices and of pairs of slices */
#ifndef MS_ROW_STEP_H
#define MS_ROW_STEP_H

#include "physics/external_force.h"
#include "physics/fused_step.h"
#include "physics/lanes.h"
#include "physics/single.h"
#include "physics/spring_law.h"

/* Where the model has masses in the precision of the lanes; and the arrays of each component of x
 * and v: with floats one more, for what their sums lack (vector.h) */
#ifdef MS_SINGLE
#  define MASSES_OF(m)  ((m)->single)
#  define LARGEST_VALID MS_LARGEST_VALID_SINGLE
#  define ARRAYS        2
#else
#  define MASSES_OF(m)  (m)
#  define LARGEST_VALID MS_LARGEST_VALID
#  define ARRAYS        1
#endif

/*------------------------------------- what all rows share --------------------------------------*/

/* In all lanes; copies, as results could alias the model */
typedef struct sweep_lanes {
  ms_external_lanes external;
  ms_lanes h, h_before, drift;
} sweep_lanes;

MS_INLINE sweep_lanes spread_sweep(int dims, const ms_model *m, const ms_fused_step *p) {
  const ms_lanes zero = {0};
  return (sweep_lanes){.external = ms_external_spread(dims, &m->external, m->unknowns.axis),
                       .h = zero + (ms_real)p->h,
                       .h_before = zero + (ms_real)p->h_before,
                       .drift = zero + (ms_real)p->drift};
}

/*------------------------------------- memory ---------------------------------------------------*/

enum { ROWS_IN_LINE = MS_CACHE_LINE / sizeof(ms_real) };

/* What a step fetches ahead: rows, if x, v and the next x have more bytes than MS_CACHE; and
 * springs, if k and rest of those that are not alike have. A constant of the callers of functions
 * with this argument */
typedef enum prefetch { NOTHING, ROWS, ROWS_AND_SPRINGS } prefetch;

MS_INLINE prefetch choose_prefetch(const ms_model *m) {
  const size_t numbers = (size_t)m->unknowns.dims * (size_t)m->unknowns.stride;
  if (2 * sizeof(ms_real) * m->half_edges.nvalues > MS_CACHE) return ROWS_AND_SPRINGS;
  return 3 * sizeof(double) * numbers > MS_CACHE ? ROWS : NOTHING;
}

/* The line that begins with a row, of some arrays of a vector */
MS_INLINE void prefetch_row(int arrays, const void *vec, size_t row, size_t stride) {
  for (int c = 0; c < arrays; c++)
    ms_simd_prefetch(vec, 1, ((size_t)c * stride + row) * sizeof(ms_real));
}

/* The same of the vectors of a sum; to: nullable */
MS_INLINE void prefetch_sum(int dims, const void *from, const void *to, size_t row, size_t stride) {
  if (!to) return;
  prefetch_row(ARRAYS * dims, from, row, stride);
  if (to != from) prefetch_row(ARRAYS * dims, to, row, stride);
}

/* Fetch what a step needs some rows later. It reads and writes up to two dozen arrays, which are
 * more than prefetchers of processors follow. damped: springs have damping */
MS_INLINE void prefetch_rows(int dims, int damped, const ms_model *m, const ms_fused_step *p,
                             size_t row) {
  enum { AHEAD = 128, NEIGHBOURS = 2048 }; /* rows; neighbours are further on */
  const size_t stride = (size_t)m->unknowns.stride, own = row + AHEAD, of_others = own + NEIGHBOURS;
  prefetch_row(dims, p->x, of_others, stride);
  if (damped) prefetch_row(dims, p->v, of_others, stride);
  prefetch_row(1, MASSES_OF(m)->mass, own, stride);
  prefetch_row(1, MASSES_OF(m)->inv_mass, own, stride);
  if (p->f) prefetch_row(dims, p->f, own, stride);
  if (p->a) prefetch_row(dims, p->a, own, stride);
  if (p->a_before) prefetch_row(dims, p->a_before, own, stride);
  if (p->along) prefetch_row(dims, p->along, own, stride);
  prefetch_sum(dims, p->v_from, p->v_to, own, stride);
  prefetch_sum(dims, p->x_from, p->x_to, own, stride);
}

/*------------------------------------- forces ---------------------------------------------------*/

/* Of the springs in a register: k; L, or in single precision k L/2; c, or c/4 */
typedef struct spring_lanes {
  ms_lanes k, rest, damping;
} spring_lanes;

/* Of the entry MS_AHEAD later. damping: nullable */
MS_INLINE void prefetch_springs(const ms_half_edges *half_edges, int32_t entry, const ms_real *k,
                                const ms_real *rest, const ms_real *damping) {
  const size_t values = MS_SLICE * sizeof(ms_real), neighbours = MS_SLICE * sizeof(int32_t);
  const ms_half_edge_entry at = half_edges->entry[entry];
  ms_simd_prefetch(k + at.value, values, MS_AHEAD * values);
  ms_simd_prefetch(rest + at.value, values, MS_AHEAD * values);
  if (damping) ms_simd_prefetch(damping + at.value, values, MS_AHEAD * values);
  if (at.start < 0)
    ms_simd_prefetch(ms_half_edges_scattered(half_edges, at.start), neighbours,
                     MS_AHEAD * neighbours);
}

/* What times d is the force of a spring (spring_law.h), the same for -d and -dv. l^2 is at least
 * the least normal number, MS_MIN_LENGTH2 of doubles, so that d = 0 has force 0. Little has to wait
 * for the root and the division, so that those of more springs overlap. */
#ifdef MS_SINGLE
/* f/l = k - (k L/2 - c/4 d.dv 2/l) 2/l: off by some k u, as d is by rounded positions */
MS_INLINE ms_lanes spring_force_factor(int dims, int damped, ms_lane_vectors d, ms_lane_vectors dv,
                                       spring_lanes of) {
  const ms_lanes l2 = ms_simd_max(ms_dot_vec(dims, d, d), MS_LEAST_NORMAL);
  const ms_lanes two_over_l = ms_simd_two_over_sqrt(l2);
  ms_lanes push = of.rest;
  if (damped)
    push = ms_simd_fnma(MS_DASHPOT_FORCE(of.damping, ms_dot_vec(dims, d, dv)), two_over_l, push);
  return ms_simd_fnma(push, two_over_l, of.k);
}
#else
/* f/l = (k (l - L) + c d.dv/l)/l. l is rounded as the rest lengths of the scene are (no fused
 * multiply-add): the force of a spring at rest length is exactly 0. */
MS_INLINE ms_lanes spring_force_factor(int dims, int damped, ms_lane_vectors d, ms_lane_vectors dv,
                                       spring_lanes of) {
  ms_lanes l2 = d.c[0] * d.c[0], inverse;
  for (int c = 1; c < dims; c++) l2 += d.c[c] * d.c[c];
  const ms_lanes l = ms_simd_sqrt_and_inverse(ms_simd_max(l2, MS_LEAST_NORMAL), &inverse);
  ms_lanes f = MS_SPRING_FORCE(of.k, of.rest, l);
  if (damped) f = ms_simd_fma(MS_DASHPOT_FORCE(of.damping, ms_dot_vec(dims, d, dv)), inverse, f);
  return f * inverse;
}
#endif

MS_INLINE ms_lane_vectors load_rows(int dims, const void *vec, size_t row, size_t stride) {
  return ms_load_vec(dims, (const ms_real *)vec + row, stride);
}

/* Of one register of rows */
MS_INLINE ms_lane_vectors external_force(int dims, const ms_model *m,
                                         const ms_external_lanes *external, size_t row,
                                         const ms_fused_step *p) {
  const ms_lanes mass = ms_simd_load(MASSES_OF(m)->mass + row);
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_lane_vectors xi = load_rows(dims, p->x, row, stride);
  ms_lane_vectors f = {{{0}}};
  for (int c = 0; c < dims; c++) f.c[c] = ms_external_position_force(external, c, mass, xi.c[c]);
  if (!p->v || !external->has_velocity) return f;
  const ms_lane_vectors vi = load_rows(dims, p->v, row, stride);
  for (int c = 0; c < dims; c++) f.c[c] = ms_external_add_velocity_force(external, vi.c[c], f.c[c]);
  return f;
}

/* Forces that were computed before */
MS_INLINE ms_lane_vectors load_added_force(int dims, const double *added, size_t row,
                                           size_t stride) {
  ms_lane_vectors f = {{{0}}};
  for (int c = 0; c < dims; c++) f.c[c] = ms_simd_load_doubles(added + (size_t)c * stride + row);
  return f;
}

/*------------------------------------- update ---------------------------------------------------*/

/* Sums x' = x + change + ...: where they begin, at x itself, or in single precision at the error of
 * the last sum (vector.h); and how they end. */
#ifdef MS_SINGLE
MS_INLINE ms_lane_vectors load_addend(int dims, const void *x, size_t row, size_t stride) {
  return load_rows(dims, x, (size_t)dims * stride + row, stride);
}

MS_INLINE ms_lane_vectors store_sum(int dims, const void *x, ms_lane_vectors change, void *to,
                                    size_t row, size_t stride) {
  const ms_lane_vectors before = load_rows(dims, x, row, stride);
  const ms_lane_vectors after = ms_add_vec(dims, before, change);
  const ms_lane_vectors error = ms_subtract_vec(dims, change, ms_subtract_vec(dims, after, before));
  ms_store_vec(dims, (ms_real *)to + row, stride, after);
  ms_store_vec(dims, (ms_real *)to + (size_t)dims * stride + row, stride, error);
  return after;
}
#else
MS_INLINE ms_lane_vectors load_addend(int dims, const void *x, size_t row, size_t stride) {
  return load_rows(dims, x, row, stride);
}

MS_INLINE ms_lane_vectors store_sum(int dims, const void *x, ms_lane_vectors sum, void *to,
                                    size_t row, size_t stride) {
  (void)x;
  ms_store_vec(dims, (ms_real *)to + row, stride, sum);
  return sum;
}
#endif

/* Compute the results for one register of rows. Returns |x|^2 + |v|^2 of those that
 * ms_fused_step_run checks. */
MS_INLINE ms_lanes update(int dims, const ms_model *m, size_t row, ms_lane_vectors f,
                          const ms_fused_step *p, const sweep_lanes *by) {
  const size_t stride = (size_t)m->unknowns.stride;
  ms_lane_vectors a = f, v = f;
  ms_lanes size = {0};
  for (int c = 0; c < dims; c++) a.c[c] *= ms_simd_load(MASSES_OF(m)->inv_mass + row);
  if (p->f) ms_store_vec(dims, (ms_real *)p->f + row, stride, f);
  if (p->a) ms_store_vec(dims, (ms_real *)p->a + row, stride, a);
  if (p->v_to) {
    v = load_addend(dims, p->v_from, row, stride);
    if (p->a_before)
      v = ms_fma_vec(dims, by->h_before, load_rows(dims, p->a_before, row, stride), v);
    v = ms_fma_vec(dims, by->h, a, v);
    v = store_sum(dims, p->v_from, v, p->v_to, row, stride);
    size += ms_dot_vec(dims, v, v);
  }
  if (p->x_to) {
    const ms_lane_vectors along = p->along ? load_rows(dims, p->along, row, stride) : v;
    const ms_lane_vectors change =
        ms_fma_vec(dims, by->drift, along, load_addend(dims, p->x_from, row, stride));
    const ms_lane_vectors x = store_sum(dims, p->x_from, change, p->x_to, row, stride);
    size += ms_dot_vec(dims, x, x);
  } else if (p->v_to) {
    const ms_lane_vectors x = load_rows(dims, p->x, row, stride);
    size += ms_dot_vec(dims, x, x);
  }
  return size;
}

/* Where a result may be bad */
MS_INLINE ms_mask check(ms_lanes size) { return ~(size <= LARGEST_VALID * LARGEST_VALID); }

MS_INLINE int is_nowhere(ms_mask bad) {
  int any = 0;
  for (int l = 0; l < MS_LANES; l++) any |= bad[l] != 0;
  return !any;
}

#endif
