/* Kernels for forces and the update of the state, compiled once for each instruction set MS_ISA,
 * and once more for single precision (single_force_kernels.c). */
#include "physics/force.h"
#include "physics/law_springs.h"
#include "physics/row_step.h"
#include "physics/slice_pair.h"

#ifdef MS_SINGLE
#  define SPRINGS_OF(m) ((m)->single)
#  define REST          half_k_rest
#  define DAMPING       quarter_damping
#  define FORCE_KERNELS ms_single_force_kernels
#else
#  define SPRINGS_OF(m) (&(m)->half_edges)
#  define REST          rest
#  define DAMPING       damping
#  define FORCE_KERNELS ms_force_kernels
#endif

/*------------------------------------- forces ---------------------------------------------------*/

/* LINEAR: neither rest length nor damping, the force is k d; LAWS: all springs have a law that is
 * computed here (law_springs.h) */
typedef enum spring_kind { LINEAR, UNDAMPED, DAMPED, LAWS } spring_kind;

MS_INLINE spring_lanes load_springs(int damped, const ms_model *m, size_t at) {
  return (spring_lanes){
      .k = ms_simd_load(SPRINGS_OF(m)->k + at),
      .rest = ms_simd_load(SPRINGS_OF(m)->REST + at),
      .damping = damped ? ms_simd_load(SPRINGS_OF(m)->DAMPING + at) : (ms_lanes){0}};
}

/* sum + the forces of a slice range's springs on its own rows */
MS_INLINE ms_lane_vectors add_spring_forces(int dims, spring_kind kind, prefetch ahead,
                                            const ms_model *m, int32_t range, ms_slice_range p,
                                            size_t lane, const ms_real *x, const ms_real *v,
                                            ms_lane_vectors sum) {
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_half_edges *half_edges = &m->half_edges;
  const ms_lane_vectors xi = ms_load_own(dims, p, lane, x, stride);
  const ms_lane_vectors vi = kind == DAMPED ? ms_load_own(dims, p, lane, v, stride) : xi;
  for (int32_t entry = half_edges->first[range]; entry < half_edges->first[range + 1]; entry++) {
    const size_t at = (size_t)half_edges->entry[entry].value + lane;
    if (ahead == ROWS_AND_SPRINGS && lane == 0)
      prefetch_springs(half_edges, entry, SPRINGS_OF(m)->k, SPRINGS_OF(m)->REST,
                       kind == DAMPED ? SPRINGS_OF(m)->DAMPING : NULL);
    const ms_lane_vectors d = ms_subtract_neighbours(dims, half_edges, entry, lane, x, stride, xi);
    const ms_lane_vectors dv =
        kind == DAMPED ? ms_subtract_neighbours(dims, half_edges, entry, lane, v, stride, vi) : vi;
    const ms_lanes scale =
        kind == LINEAR
            ? ms_simd_load(SPRINGS_OF(m)->k + at)
            : spring_force_factor(dims, kind == DAMPED, d, dv, load_springs(kind == DAMPED, m, at));
    sum = ms_fnma_vec(dims, scale, d, sum);
  }
  return sum;
}

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

/*------------------------------------- slices and parts -----------------------------------------*/

/* All forces but those of springs without a law */
MS_INLINE ms_lane_vectors sum_other_forces(int dims, spring_kind kind, const ms_model *m,
                                           const ms_external_lanes *external,
                                           const ms_fused_step *p, ms_slice_range own,
                                           size_t lane) {
  const size_t stride = (size_t)m->unknowns.stride, row = own.row + lane;
  const double *added = kind == LAWS ? m->base_force : m->added_force;
  const int32_t slice = (int32_t)(own.row / MS_SLICE);
  ms_lane_vectors f = external_force(dims, m, external, row, p), of_added = {{{0}}};
  if (added) of_added = load_added_force(dims, added, row, stride);
  if (kind == LAWS)
    of_added = ms_add_vec(dims, sum_law_forces(dims, m, slice, own, lane, p->x), of_added);
  return added || kind == LAWS ? ms_add_vec(dims, f, of_added) : f;
}

/* The forces on the rows of one register, from `row` on */
MS_INLINE ms_lane_vectors sum_forces(int dims, spring_kind kind, prefetch ahead, const ms_model *m,
                                     const ms_external_lanes *external, const ms_fused_step *p,
                                     size_t row) {
  const int32_t slice = (int32_t)(row / MS_SLICE);
  const ms_slice_range own = {.row = MS_SLICE * (size_t)slice};
  const size_t lane = row % MS_SLICE;
  const ms_lane_vectors f = sum_other_forces(dims, kind, m, external, p, own, lane);
  if (kind == LAWS) return f;
  return add_spring_forces(dims, kind, ahead, m, slice, own, lane, p->x, p->v, f);
}

/* The results for a register of rows wait for the root and the division of its last spring. They
 * are computed after the forces on the next register, so that its roots do not wait behind them. */
MS_INLINE int step_slices_of(int dims, spring_kind kind, prefetch ahead, const ms_model *m,
                             const ms_fused_step *p, int32_t begin, int32_t end) {
  const sweep_lanes by = spread_sweep(dims, m, p);
  const size_t first = MS_SLICE * (size_t)begin, last = MS_SLICE * (size_t)end;
  ms_lane_vectors before = {{{0}}};
  ms_mask bad = {0};
  for (size_t row = first; row <= last; row += MS_LANES) {
    ms_lane_vectors f = {{{0}}};
    if (ahead != NOTHING && row % ROWS_IN_LINE == 0) prefetch_rows(dims, kind == DAMPED, m, p, row);
    if (row < last) f = sum_forces(dims, kind, ahead, m, &by.external, p, row);
    if (row > first) bad |= check(update(dims, m, row - MS_LANES, before, p, &by));
    before = f;
  }
  return is_nowhere(bad);
}

MS_INLINE void sum_part_of(int dims, spring_kind kind, const ms_model *m, const ms_fused_step *p,
                           int32_t part) {
  const int32_t range = m->half_edges.nslices + part;
  const ms_slice_range own = ms_slice_range_at(&m->half_edges, range, NULL, 0);
  for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
    ms_lane_vectors sum = {{{0}}};
    sum = add_spring_forces(dims, kind, NOTHING, m, range, own, lane, p->x, p->v, sum);
    for (int c = 0; c < dims; c++)
      ms_simd_store_doubles(own.sums + (size_t)c * own.stride + lane, sum.c[c]);
  }
}

static spring_kind find_spring_kind(const ms_model *m, const ms_fused_step *p) {
  if (ms_law_springs_are_in_sweep(m, p->v)) return LAWS;
  if (!(m->features & MS_HAS_DIRECTIONS)) return LINEAR;
  return p->v && (m->features & MS_HAS_DAMPING) ? DAMPED : UNDAMPED;
}

/* Of linear springs with rest lengths or damping */
MS_INLINE int step_directed_slices(int dims, int damped, prefetch ahead, const ms_model *m,
                                   const ms_fused_step *p, int32_t begin, int32_t end) {
  return damped ? step_slices_of(dims, DAMPED, ahead, m, p, begin, end)
                : step_slices_of(dims, UNDAMPED, ahead, m, p, begin, end);
}

MS_INLINE int step_slices_in(int dims, spring_kind kind, const ms_model *m, const ms_fused_step *p,
                             int32_t begin, int32_t end) {
  const prefetch ahead = choose_prefetch(m);
  const int damped = kind == DAMPED;
  if (kind == LINEAR) return step_slices_of(dims, LINEAR, NOTHING, m, p, begin, end);
  if (kind == LAWS) return step_slices_of(dims, LAWS, NOTHING, m, p, begin, end);
  if (ahead == NOTHING) return step_directed_slices(dims, damped, NOTHING, m, p, begin, end);
  if (ahead == ROWS) return step_directed_slices(dims, damped, ROWS, m, p, begin, end);
  return step_directed_slices(dims, damped, ROWS_AND_SPRINGS, m, p, begin, end);
}

static int step_slices_alone(const ms_model *m, const ms_fused_step *p, spring_kind kind,
                             int32_t begin, int32_t end) {
  return m->unknowns.dims == 2 ? step_slices_in(2, kind, m, p, begin, end)
                               : step_slices_in(3, kind, m, p, begin, end);
}

static int step_slices(const ms_model *m, const ms_fused_step *p, int32_t begin, int32_t end) {
  const spring_kind kind = find_spring_kind(m, p);
#ifdef MS_HAS_SLICE_PAIRS /* they read springs from two places, which takes longer from memory */
  if ((kind == UNDAMPED || kind == DAMPED) && choose_prefetch(m) != ROWS_AND_SPRINGS) {
    const int32_t paired = begin + (end - begin) / 2 * 2;
    const int good = ms_slice_pairs_step(m, p, kind == DAMPED, begin, paired);
    return step_slices_alone(m, p, kind, paired, end) && good;
  }
#endif
  return step_slices_alone(m, p, kind, begin, end);
}

/* Few scenes have split rows, but for filled meshes, which are spatial. */
static void sum_part(const ms_model *m, const ms_fused_step *p, int32_t k) {
  const spring_kind kind = find_spring_kind(m, p);
  if (m->unknowns.dims == 3 && kind == UNDAMPED) sum_part_of(3, UNDAMPED, m, p, k);
  else if (m->unknowns.dims == 3 && kind == DAMPED) sum_part_of(3, DAMPED, m, p, k);
  else sum_part_of(m->unknowns.dims, kind, m, p, k);
}

const ms_force_kernels MS_TABLE(FORCE_KERNELS) = {step_slices, sum_part};
