/* Kernels for forces and the update of the state, compiled once for each instruction set MS_ISA. */
#include "physics/force.h"
#include "physics/lanes.h"
#include "physics/step.h"

/*------------------------------------- forces ---------------------------------------------------*/

/* k (l - L)/l + c (d.dv)/l^2, which times d is the force of a spring. l^2 is at least
 * MS_ZERO_LENGTH2, so that d = 0 has force 0. l is rounded as the rest lengths of the scene are (no
 * fused multiply-add): the force of a spring at rest length is exactly 0. */
MS_INLINE ms_lanes pull(int dims, int damped, ms_vec d, ms_vec dv, const ms_halves *halves,
                        size_t at) {
  ms_lanes l2 = d.c[0] * d.c[0], inverse;
  for (int c = 1; c < dims; c++) l2 += d.c[c] * d.c[c];
  const ms_lanes l = ms_root(ms_at_least(l2, MS_ZERO_LENGTH2), &inverse);
  const ms_lanes scale = ms_load(halves->k + at) * ((l - ms_load(halves->rest + at)) * inverse);
  if (!damped) return scale;
  for (int c = 0; c < dims; c++) d.c[c] *= inverse;
  return ms_fma(ms_load(halves->damping + at) * ms_dot_vec(dims, d, dv), inverse, scale);
}

/* m g - b v */
MS_INLINE ms_vec external(int dims, const ms_model *m, size_t row, const double *v) {
  const ms_lanes mass = ms_load(m->mass + row);
  ms_vec f = {{{0}}};
  for (int c = 0; c < dims; c++) f.c[c] = mass * m->gravity[m->rows.axis[c]];
  if (!v || m->drag == 0) return f;
  return ms_fma_vec(dims, (ms_lanes){0} - m->drag,
                    ms_load_vec(dims, v + row, (size_t)m->rows.stride), f);
}

/* LINEAR: neither rest length nor damping, the force is k d */
typedef enum spring_kind { LINEAR, UNDAMPED, DAMPED } spring_kind;

/* sum + the forces of a slice range's springs on its own rows */
MS_INLINE ms_vec add_springs(int dims, spring_kind kind, const ms_model *m, int32_t segment,
                             ms_place p, size_t lane, const double *x, const double *v,
                             ms_vec sum) {
  const size_t stride = (size_t)m->rows.stride;
  const ms_halves *halves = &m->halves;
  const ms_vec xi = ms_load_own(dims, p, lane, x, stride);
  const ms_vec vi = kind == DAMPED ? ms_load_own(dims, p, lane, v, stride) : xi;
  for (int32_t slot = halves->first[segment]; slot < halves->first[segment + 1]; slot++) {
    const size_t at = MS_GROUP * (size_t)slot + lane;
    const ms_vec xj = ms_load_neighbours(dims, halves, slot, lane, x, stride);
    const ms_vec vj = kind == DAMPED ? ms_load_neighbours(dims, halves, slot, lane, v, stride) : vi;
    const ms_vec d = ms_minus(dims, xj, xi), dv = ms_minus(dims, vj, vi);
    const ms_lanes scale =
        kind == LINEAR ? ms_load(halves->k + at) : pull(dims, kind == DAMPED, d, dv, halves, at);
    sum = ms_fma_vec(dims, scale, d, sum);
  }
  return sum;
}

/*------------------------------------- update ---------------------------------------------------*/

/* Compute the results for one register of rows. Returns |x|^2 + |v|^2 of those that ms_pass_run
 * checks. */
MS_INLINE ms_lanes update(int dims, const ms_model *m, size_t row, ms_vec f, const ms_pass *p) {
  const size_t stride = (size_t)m->rows.stride;
  const ms_lanes zero = {0};
  ms_vec a = f, v = f;
  ms_lanes size = zero;
  for (int c = 0; c < dims; c++) a.c[c] *= ms_load(m->inv_mass + row);
  if (p->f) ms_store_vec(dims, p->f + row, stride, f);
  if (p->a) ms_store_vec(dims, p->a + row, stride, a);
  if (p->v_to) {
    v = ms_load_vec(dims, p->v_from + row, stride);
    if (p->a_before)
      v = ms_fma_vec(dims, zero + p->h_before, ms_load_vec(dims, p->a_before + row, stride), v);
    v = ms_fma_vec(dims, zero + p->h, a, v);
    ms_store_vec(dims, p->v_to + row, stride, v);
    size += ms_dot_vec(dims, v, v);
  }
  if (p->x_to) {
    const ms_vec along = p->along ? ms_load_vec(dims, p->along + row, stride) : v;
    const ms_vec x =
        ms_fma_vec(dims, zero + p->drift, along, ms_load_vec(dims, p->x_from + row, stride));
    ms_store_vec(dims, p->x_to + row, stride, x);
    size += ms_dot_vec(dims, x, x);
  } else if (p->v_to) {
    const ms_vec x = ms_load_vec(dims, p->x + row, stride);
    size += ms_dot_vec(dims, x, x);
  }
  return size;
}

/*------------------------------------- slices and parts -----------------------------------------*/

MS_INLINE int groups_of(int dims, spring_kind kind, const ms_model *m, const ms_pass *p,
                        int32_t begin, int32_t end) {
  const size_t stride = (size_t)m->rows.stride;
  ms_mask bad = {0};
  for (int32_t group = begin; group < end; group++) {
    const ms_place place = {.row = MS_GROUP * (size_t)group};
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const size_t row = place.row + lane;
      ms_vec f = external(dims, m, row, p->v);
      if (m->part_force) f = ms_plus(dims, f, ms_load_vec(dims, m->part_force + row, stride));
      f = add_springs(dims, kind, m, group, place, lane, p->x, p->v, f);
      bad |= ~(update(dims, m, row, f, p) <= MS_HUGE * MS_HUGE);
    }
  }
  int any = 0;
  for (int l = 0; l < MS_LANES; l++) any |= bad[l] != 0;
  return !any;
}

MS_INLINE void part_of(int dims, spring_kind kind, const ms_model *m, const ms_pass *p,
                       int32_t part) {
  const int32_t segment = m->halves.ngroups + part;
  const ms_place place = ms_place_of(&m->halves, segment, NULL, 0);
  for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
    ms_vec sum = {{{0}}};
    sum = add_springs(dims, kind, m, segment, place, lane, p->x, p->v, sum);
    ms_store_vec(dims, place.sums + lane, place.stride, sum);
  }
}

static spring_kind kind_of(const ms_model *m, const ms_pass *p) {
  if (!(m->passes & MSIM_SKIP_ZERO_REST_LENGTH)) return LINEAR;
  return p->v && (m->passes & MSIM_SKIP_DAMPING) ? DAMPED : UNDAMPED;
}

static int groups(const ms_model *m, const ms_pass *p, int32_t begin, int32_t end) {
  const spring_kind kind = kind_of(m, p);
  if (m->rows.dims == 2) {
    if (kind == LINEAR) return groups_of(2, LINEAR, m, p, begin, end);
    if (kind == UNDAMPED) return groups_of(2, UNDAMPED, m, p, begin, end);
    return groups_of(2, DAMPED, m, p, begin, end);
  }
  if (kind == LINEAR) return groups_of(3, LINEAR, m, p, begin, end);
  if (kind == UNDAMPED) return groups_of(3, UNDAMPED, m, p, begin, end);
  return groups_of(3, DAMPED, m, p, begin, end);
}

/* Few scenes have split rows: one function serves all dims and kinds. */
static void part(const ms_model *m, const ms_pass *p, int32_t k) {
  part_of(m->rows.dims, kind_of(m, p), m, p, k);
}

const ms_pass_kernels MS_TABLE(ms_pass_kernels) = {groups, part};
