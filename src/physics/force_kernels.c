/* Kernels for forces and the update of the state, compiled once for each instruction set MS_ISA,
 * and once more for single precision (single_force_kernels.c). */
#include "physics/external_force.h"
#include "physics/force.h"
#include "physics/fused_step.h"
#include "physics/lanes.h"
#include "physics/law_springs.h"
#include "physics/single.h"
#include "physics/spring_law.h"
#if defined(MS_SINGLE) && defined(__AVX512F__)
#  include "physics/slice_pair.h"
#endif

/* Where the model has k and masses in the precision of the lanes */
#ifdef MS_SINGLE
#  define SPRINGS_OF(m) ((m)->single)
#  define MASSES_OF(m)  ((m)->single)
#  define LARGEST_VALID MS_LARGEST_VALID_SINGLE
#  define FORCE_KERNELS ms_single_force_kernels
#else
#  define SPRINGS_OF(m) (&(m)->half_edges)
#  define MASSES_OF(m)  (m)
#  define LARGEST_VALID MS_LARGEST_VALID
#  define FORCE_KERNELS ms_force_kernels
#endif

/*------------------------------------- forces ---------------------------------------------------*/

/* What times d is the force of a spring (spring_law.h), the same for -d and -dv. l^2 is at least
 * the least normal number, MS_MIN_LENGTH2 of doubles, so that d = 0 has force 0. The damping,
 * c d.dv/l^2, is multiplied by 1/l last: little has to wait for the root and the division, so that
 * those of more springs overlap. */
#ifdef MS_SINGLE
/* f/l = k - (k L/2) (2/l): off by some k u, as d is by rounded positions */
MS_INLINE ms_lanes spring_force_factor(int dims, int damped, ms_lane_vectors d, ms_lane_vectors dv,
                                       const ms_model *m, size_t at) {
  const ms_single *of = m->single;
  const ms_lanes l2 = ms_simd_max(ms_dot_vec(dims, d, d), MS_LEAST_NORMAL);
  const ms_lanes two_over_l = ms_simd_two_over_sqrt(l2);
  const ms_lanes scale =
      ms_simd_fnma(ms_simd_load(of->half_k_rest + at), two_over_l, ms_simd_load(of->k + at));
  if (!damped) return scale;
  const ms_lanes rate = ms_dot_vec(dims, d, dv), c = ms_simd_load(of->quarter_damping + at);
  return ms_simd_fma(MS_DASHPOT_FORCE(c, rate) * two_over_l, two_over_l, scale);
}
#else
/* l is rounded as the rest lengths of the scene are (no fused multiply-add): the force of a spring
 * at rest length is exactly 0. */
MS_INLINE ms_lanes spring_force_factor(int dims, int damped, ms_lane_vectors d, ms_lane_vectors dv,
                                       const ms_model *m, size_t at) {
  ms_lanes l2 = d.c[0] * d.c[0], inverse;
  for (int c = 1; c < dims; c++) l2 += d.c[c] * d.c[c];
  const ms_lanes l = ms_simd_sqrt_and_inverse(ms_simd_max(l2, MS_LEAST_NORMAL), &inverse);
  const ms_lanes scale = MS_SPRING_FORCE_OVER_LENGTH(
      ms_simd_load(m->half_edges.k + at), ms_simd_load(m->half_edges.rest + at), l, inverse);
  if (!damped) return scale;
  const ms_lanes rate = ms_dot_vec(dims, d, dv), c = ms_simd_load(m->half_edges.damping + at);
  return ms_simd_fma(MS_DASHPOT_FORCE(c, rate) * inverse, inverse, scale);
}
#endif

MS_INLINE ms_lane_vectors external_force(int dims, const ms_model *m, const ms_external *external,
                                         size_t row, const ms_real *x, const ms_real *v) {
  const ms_lanes mass = ms_simd_load(MASSES_OF(m)->mass + row);
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_lane_vectors xi = ms_load_vec(dims, x + row, stride);
  ms_lane_vectors f = {{{0}}};
  for (int c = 0; c < dims; c++)
    f.c[c] = ms_external_position_force(external, m->unknowns.axis[c], mass, xi.c[c]);
  if (!v || !ms_external_has_velocity(external)) return f;
  const ms_lane_vectors vi = ms_load_vec(dims, v + row, stride);
  for (int c = 0; c < dims; c++) f.c[c] = ms_external_add_velocity_force(external, vi.c[c], f.c[c]);
  return f;
}

/* LINEAR: neither rest length nor damping, the force is k d; LAWS: all springs have a law that is
 * computed here (law_springs.h) */
typedef enum spring_kind { LINEAR, UNDAMPED, DAMPED, LAWS } spring_kind;

/* sum + the forces of a slice range's springs on its own rows */
MS_INLINE ms_lane_vectors add_spring_forces(int dims, spring_kind kind, const ms_model *m,
                                            int32_t range, ms_slice_range p, size_t lane,
                                            const ms_real *x, const ms_real *v,
                                            ms_lane_vectors sum) {
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_half_edges *half_edges = &m->half_edges;
  const ms_lane_vectors xi = ms_load_own(dims, p, lane, x, stride);
  const ms_lane_vectors vi = kind == DAMPED ? ms_load_own(dims, p, lane, v, stride) : xi;
  for (int32_t entry = half_edges->first[range]; entry < half_edges->first[range + 1]; entry++) {
    const size_t at = (size_t)half_edges->entry[entry].value + lane;
    const ms_lane_vectors d = ms_subtract_neighbours(dims, half_edges, entry, lane, x, stride, xi);
    const ms_lane_vectors dv =
        kind == DAMPED ? ms_subtract_neighbours(dims, half_edges, entry, lane, v, stride, vi) : vi;
    const ms_lanes scale = kind == LINEAR ? ms_simd_load(SPRINGS_OF(m)->k + at)
                                          : spring_force_factor(dims, kind == DAMPED, d, dv, m, at);
    sum = ms_fnma_vec(dims, scale, d, sum);
  }
  return sum;
}

#ifdef MS_SLICE_PAIR_H
/* Two slices with equally many entries share registers. */
MS_INLINE int may_be_pair(spring_kind kind, const ms_half_edges *half_edges, int32_t slice,
                          int32_t end) {
  const int32_t *first = half_edges->first + slice;
  return (kind == UNDAMPED || kind == DAMPED) && slice + 1 < end &&
         first[1] - first[0] == first[2] - first[1];
}

/* sum[0] and sum[1]: of a slice and of the next one */
MS_INLINE void add_forces_to_pair(int dims, int damped, const ms_model *m, int32_t slice,
                                  const float *x, const float *v, ms_lane_vectors sum[2]) {
  const size_t stride = (size_t)m->unknowns.stride, row = MS_SLICE * (size_t)slice;
  const ms_half_edges *half_edges = &m->half_edges;
  const int32_t end = half_edges->first[slice + 1], entries = end - half_edges->first[slice];
  ms_pair_vectors xi = {{{0}}}, vi = xi, of_both = xi;
  for (int c = 0; c < dims; c++) {
    xi.c[c] = ms_pair_load(x + row + (size_t)c * stride);
    vi.c[c] = damped ? ms_pair_load(v + row + (size_t)c * stride) : xi.c[c];
    of_both.c[c] = ms_pair_join(sum[0].c[c], sum[1].c[c]);
  }
  for (int32_t low = end - entries, high = end; low < end; low++, high++) {
    const ms_pair_vectors d =
        ms_pair_subtract_neighbours(dims, half_edges, low, high, x, stride, xi);
    const ms_pair_vectors dv =
        damped ? ms_pair_subtract_neighbours(dims, half_edges, low, high, v, stride, vi) : vi;
    const ms_pair scale =
        ms_pair_force_factor(dims, damped, d, dv, m->single, (size_t)half_edges->entry[low].value,
                             (size_t)half_edges->entry[high].value);
    for (int c = 0; c < dims; c++) of_both.c[c] = ms_pair_fnma(scale, d.c[c], of_both.c[c]);
  }
  for (int c = 0; c < dims; c++) {
    sum[0].c[c] = ms_pair_low(of_both.c[c]);
    sum[1].c[c] = ms_pair_high(of_both.c[c]);
  }
}
#endif

/* The sum of f/l d, with roundings and order of those of law_kernels.c: no reciprocal, no fused
 * multiply-add. Padding adds 0, as its stiffness is 0. */
MS_INLINE ms_lane_vectors sum_law_forces(int dims, const ms_model *m, int32_t slice,
                                         ms_slice_range own, size_t lane, const ms_real *x) {
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_half_edges *half_edges = &m->half_edges;
  const ms_lane_vectors xi = ms_load_own(dims, own, lane, x, stride);
  const ms_real least = MS_SQRT(MS_LEAST_NORMAL);
  ms_lane_vectors sum = {{{0}}};
  for (int32_t entry = half_edges->first[slice]; entry < half_edges->first[slice + 1]; entry++) {
    const size_t at = (size_t)half_edges->entry[entry].value + lane;
    const ms_lane_vectors d =
        ms_subtract_vec(dims, ms_load_neighbours(dims, half_edges, entry, lane, x, stride), xi);
    ms_lanes l2 = d.c[0] * d.c[0];
    for (int c = 1; c < dims; c++) l2 += d.c[c] * d.c[c];
    const ms_lanes l = ms_simd_sqrt(l2);
    const ms_lanes pull = MS_SPRING_FORCE(ms_simd_load_doubles(half_edges->stiffness + at),
                                          ms_simd_load_doubles(half_edges->rest + at), l) /
                          ms_simd_max(l, least);
    for (int c = 0; c < dims; c++) sum.c[c] += pull * d.c[c];
  }
  return sum;
}

/*------------------------------------- update ---------------------------------------------------*/

MS_INLINE ms_lane_vectors load_rows(int dims, const void *vec, size_t row, size_t stride) {
  return ms_load_vec(dims, (const ms_real *)vec + row, stride);
}

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
                          const ms_fused_step *p) {
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_lanes zero = {0};
  ms_lane_vectors a = f, v = f;
  ms_lanes size = zero;
  for (int c = 0; c < dims; c++) a.c[c] *= ms_simd_load(MASSES_OF(m)->inv_mass + row);
  if (p->f) ms_store_vec(dims, (ms_real *)p->f + row, stride, f);
  if (p->a) ms_store_vec(dims, (ms_real *)p->a + row, stride, a);
  if (p->v_to) {
    v = load_addend(dims, p->v_from, row, stride);
    if (p->a_before)
      v = ms_fma_vec(dims, zero + (ms_real)p->h_before, load_rows(dims, p->a_before, row, stride),
                     v);
    v = ms_fma_vec(dims, zero + (ms_real)p->h, a, v);
    v = store_sum(dims, p->v_from, v, p->v_to, row, stride);
    size += ms_dot_vec(dims, v, v);
  }
  if (p->x_to) {
    const ms_lane_vectors along = p->along ? load_rows(dims, p->along, row, stride) : v;
    const ms_lane_vectors change = ms_fma_vec(dims, zero + (ms_real)p->drift, along,
                                              load_addend(dims, p->x_from, row, stride));
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

/*------------------------------------- slices and parts -----------------------------------------*/

/* All forces but those of springs without a law */
MS_INLINE ms_lane_vectors sum_other_forces(int dims, spring_kind kind, const ms_model *m,
                                           const ms_external *external, const ms_fused_step *p,
                                           ms_slice_range own, size_t lane) {
  const size_t stride = (size_t)m->unknowns.stride, row = own.row + lane;
  const double *added = kind == LAWS ? m->base_force : m->added_force;
  const int32_t slice = (int32_t)(own.row / MS_SLICE);
  ms_lane_vectors f = external_force(dims, m, external, row, p->x, p->v), of_added = {{{0}}};
  for (int c = 0; c < dims && added; c++)
    of_added.c[c] = ms_simd_load_doubles(added + (size_t)c * stride + row);
  if (kind == LAWS)
    of_added = ms_add_vec(dims, sum_law_forces(dims, m, slice, own, lane, p->x), of_added);
  return added || kind == LAWS ? ms_add_vec(dims, f, of_added) : f;
}

/* Compute the results of a slice. Returns where they may be bad. */
MS_INLINE ms_mask step_slice(int dims, spring_kind kind, const ms_model *m,
                             const ms_external *external, const ms_fused_step *p, int32_t slice) {
  const ms_slice_range own = {.row = MS_SLICE * (size_t)slice};
  ms_mask bad = {0};
  for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
    ms_lane_vectors f = sum_other_forces(dims, kind, m, external, p, own, lane);
    if (kind != LAWS) f = add_spring_forces(dims, kind, m, slice, own, lane, p->x, p->v, f);
    bad |= check(update(dims, m, own.row + lane, f, p));
  }
  return bad;
}

#ifdef MS_SLICE_PAIR_H
MS_INLINE ms_mask step_pair(int dims, spring_kind kind, const ms_model *m,
                            const ms_external *external, const ms_fused_step *p, int32_t slice) {
  const ms_slice_range low = {.row = MS_SLICE * (size_t)slice};
  const ms_slice_range high = {.row = low.row + MS_SLICE};
  ms_lane_vectors f[] = {sum_other_forces(dims, kind, m, external, p, low, 0),
                         sum_other_forces(dims, kind, m, external, p, high, 0)};
  add_forces_to_pair(dims, kind == DAMPED, m, slice, p->x, p->v, f);
  return check(update(dims, m, low.row, f[0], p)) | check(update(dims, m, high.row, f[1], p));
}
#endif

MS_INLINE int step_slices_of(int dims, spring_kind kind, const ms_model *m, const ms_fused_step *p,
                             int32_t begin, int32_t end) {
  const ms_external external = m->external; /* local, as results could alias the model */
  ms_mask bad = {0};
  for (int32_t slice = begin; slice < end; slice++) {
#ifdef MS_SLICE_PAIR_H
    if (may_be_pair(kind, &m->half_edges, slice, end)) {
      bad |= step_pair(dims, kind, m, &external, p, slice++);
      continue;
    }
#endif
    bad |= step_slice(dims, kind, m, &external, p, slice);
  }
  int any = 0;
  for (int l = 0; l < MS_LANES; l++) any |= bad[l] != 0;
  return !any;
}

MS_INLINE void sum_part_of(int dims, spring_kind kind, const ms_model *m, const ms_fused_step *p,
                           int32_t part) {
  const int32_t range = m->half_edges.nslices + part;
  const ms_slice_range own = ms_slice_range_at(&m->half_edges, range, NULL, 0);
  for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
    ms_lane_vectors sum = {{{0}}};
    sum = add_spring_forces(dims, kind, m, range, own, lane, p->x, p->v, sum);
    for (int c = 0; c < dims; c++)
      ms_simd_store_doubles(own.sums + (size_t)c * own.stride + lane, sum.c[c]);
  }
}

static spring_kind find_spring_kind(const ms_model *m, const ms_fused_step *p) {
  if (ms_law_springs_are_in_sweep(m, p->v)) return LAWS;
  if (!(m->features & MS_HAS_DIRECTIONS)) return LINEAR;
  return p->v && (m->features & MS_HAS_DAMPING) ? DAMPED : UNDAMPED;
}

static int step_slices(const ms_model *m, const ms_fused_step *p, int32_t begin, int32_t end) {
  const spring_kind kind = find_spring_kind(m, p);
  if (m->unknowns.dims == 2) {
    if (kind == LINEAR) return step_slices_of(2, LINEAR, m, p, begin, end);
    if (kind == UNDAMPED) return step_slices_of(2, UNDAMPED, m, p, begin, end);
    if (kind == LAWS) return step_slices_of(2, LAWS, m, p, begin, end);
    return step_slices_of(2, DAMPED, m, p, begin, end);
  }
  if (kind == LINEAR) return step_slices_of(3, LINEAR, m, p, begin, end);
  if (kind == UNDAMPED) return step_slices_of(3, UNDAMPED, m, p, begin, end);
  if (kind == LAWS) return step_slices_of(3, LAWS, m, p, begin, end);
  return step_slices_of(3, DAMPED, m, p, begin, end);
}

/* Few scenes have split rows, but for filled meshes, which are spatial. */
static void sum_part(const ms_model *m, const ms_fused_step *p, int32_t k) {
  const spring_kind kind = find_spring_kind(m, p);
  if (m->unknowns.dims == 3 && kind == UNDAMPED) sum_part_of(3, UNDAMPED, m, p, k);
  else if (m->unknowns.dims == 3 && kind == DAMPED) sum_part_of(3, DAMPED, m, p, k);
  else sum_part_of(m->unknowns.dims, kind, m, p, k);
}

const ms_force_kernels MS_TABLE(FORCE_KERNELS) = {step_slices, sum_part};
