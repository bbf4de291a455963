/* The spring forces and the update, compiled once for each instruction set, with MS_ISA its name.
 */
#include "physics/kernels.h"
#include "physics/lanes.h"

/*------------------------------------- forces ---------------------------------------------------*/

/* k (l - L)/l + c (d.dv)/l^2: times d, the push of a spring. The root of MS_ZERO_LENGTH2 stands for
 * shorter lengths, so d = 0 is pushed by 0. Lengths are rounded as those of the scene are: a spring
 * at rest pushes by exactly 0. */
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
  for (int c = 0; c < dims; c++) f.c[c] = mass * m->scene->gravity[m->rows.axis[c]];
  if (!v || m->scene->drag == 0) return f;
  return ms_fma_vec(dims, (ms_lanes){0} - m->scene->drag,
                    ms_load_vec(dims, v + row, (size_t)m->rows.stride), f);
}

MS_INLINE ms_vec force(int dims, int damped, const ms_model *m, int32_t group, size_t lane,
                       const double *x, const double *v) {
  const size_t stride = (size_t)m->rows.stride, row = MS_GROUP * (size_t)group + lane;
  const ms_halves *halves = &m->halves;
  const ms_vec xi = ms_load_vec(dims, x + row, stride);
  const ms_vec vi = damped ? ms_load_vec(dims, v + row, stride) : xi;
  ms_vec sum = external(dims, m, row, v);
  for (int32_t slot = halves->first[group]; slot < halves->first[group + 1]; slot++) {
    const ms_vec xj = ms_load_neighbours(dims, halves, slot, lane, x, stride);
    const ms_vec vj = damped ? ms_load_neighbours(dims, halves, slot, lane, v, stride) : vi;
    const ms_vec d = ms_minus(dims, xj, xi), dv = ms_minus(dims, vj, vi);
    const ms_lanes scale = pull(dims, damped, d, dv, halves, MS_GROUP * (size_t)slot + lane);
    sum = ms_fma_vec(dims, scale, d, sum);
  }
  return sum;
}

/*------------------------------------- update ---------------------------------------------------*/

/* The results for one register of rows; returns |x_to|^2 + |v_to|^2. */
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
  }
  return size;
}

MS_INLINE int rows(int dims, int damped, const ms_model *m, const ms_pass *p, int32_t begin,
                   int32_t end) {
  ms_mask bad = {0};
  for (int32_t group = begin; group < end; group++) {
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const ms_vec f = force(dims, damped, m, group, lane, p->x, p->v);
      bad |= ~(update(dims, m, MS_GROUP * (size_t)group + lane, f, p) <= MS_HUGE * MS_HUGE);
    }
  }
  int any = 0;
  for (int l = 0; l < MS_LANES; l++) any |= bad[l] != 0;
  return !any;
}

int MS_FOR_ISA(ms_pass)(const ms_model *m, const ms_pass *p, int32_t begin, int32_t end) {
  const int damped = p->v && (m->passes & MSIM_SKIP_DAMPING);
  if (m->rows.dims == 2)
    return damped ? rows(2, 1, m, p, begin, end) : rows(2, 0, m, p, begin, end);
  return damped ? rows(3, 1, m, p, begin, end) : rows(3, 0, m, p, begin, end);
}
