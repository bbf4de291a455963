/* Compiled once for each instruction set MS_ISA; every loop is built for 2 and for 3 components.
 * The slots between the end of a run and the next multiple of a register hold no spring: their
 * results are not read. */
#include "physics/law_kernels.h"

#include <float.h>

#include "physics/lanes.h"

/*------------------------------------- lengths --------------------------------------------------*/

/* x_j - x_i of one spring per lane */
MS_INLINE ms_lane_vectors difference(int dims, const double *x, size_t stride, const int32_t *i,
                                     const int32_t *j) {
  ms_lane_vectors d = {{{0}}};
  for (int c = 0; c < dims; c++) {
    const double *from = x + (size_t)c * stride;
    d.c[c] = ms_simd_gather(from, j) - ms_simd_gather(from, i);
  }
  return d;
}

MS_INLINE ms_lanes squared_length(int dims, ms_lane_vectors d) {
  ms_lanes l2 = d.c[0] * d.c[0];
  for (int c = 1; c < dims; c++) l2 += d.c[c] * d.c[c];
  return l2;
}

MS_INLINE void measure_of(int dims, const ms_model *model, const ms_law_run *run, const double *x,
                          ms_law_lengths *to) {
  const struct ms_law_springs *s = model->laws;
  const size_t stride = (size_t)model->unknowns.stride;
  const int32_t *i = s->i + run->begin, *j = s->j + run->begin, n = run->end - run->begin;
  const double *rest = s->rest + run->begin;
  for (int32_t e = 0; e < n; e += MS_LANES) {
    const ms_lane_vectors d = difference(dims, x, stride, i + e, j + e);
    const ms_lanes l2 = squared_length(dims, d), l = ms_simd_sqrt(l2);
    for (int c = 0; c < dims; c++) ms_simd_store(to->d[c] + e, d.c[c]);
    ms_simd_store(to->l2 + e, l2);
    ms_simd_store(to->l + e, l);
    ms_simd_store(to->at.stretch + e, l - ms_simd_load(rest + e));
  }
}

static void measure(const ms_model *model, const ms_law_run *run, const double *x,
                    ms_law_lengths *to) {
  if (model->unknowns.dims == 3) measure_of(3, model, run, x, to);
  else measure_of(2, model, run, x, to);
}

/*------------------------------------- forces ---------------------------------------------------*/

MS_INLINE void store_forces_of(int dims, const ms_law_lengths *at, int32_t n, size_t stride,
                               double *to) {
  const double least = sqrt(MS_MIN_LENGTH2);
  for (int32_t e = 0; e < n; e += MS_LANES) {
    const ms_lanes pull =
        ms_simd_load(at->at.force + e) / ms_simd_max(ms_simd_load(at->l + e), least);
    for (int c = 0; c < dims; c++)
      ms_simd_store(to + (size_t)c * stride + e, pull * ms_simd_load(at->d[c] + e));
  }
}

static void compute_forces(const ms_model *model, const ms_law_run *run, const double *x) {
  const struct ms_law_springs *s = model->laws;
  const int32_t n = run->end - run->begin;
  const size_t stride = (size_t)s->nslots;
  ms_law_lengths at;
  at.at.only_force = 1;
  measure(model, run, x, &at);
  ms_law_springs_evaluate(model, run, &at.at);
  if (model->unknowns.dims == 3) store_forces_of(3, &at, n, stride, s->scratch + run->begin);
  else store_forces_of(2, &at, n, stride, s->scratch + run->begin);
}

/* Rows of one end, none of them split: most, where few springs have a law */
MS_INLINE void set_single_rows_of(int dims, int has_base, const ms_model *model, int32_t begin,
                                  int32_t end) {
  const struct ms_law_springs *s = model->laws;
  const size_t stride = (size_t)model->unknowns.stride, slots = (size_t)s->nslots;
  const int32_t *row = s->row;
  const ms_law_end *ends = s->end;
  const double *from = s->scratch, *base = model->base_force;
  double *added = model->added_force;
  for (int32_t r = begin; r < end; r++) {
    const double *force = from + ends[r].slot, sign = ends[r].sign;
    const size_t to = (size_t)row[r];
    for (size_t c = 0; c < (size_t)dims; c++) {
      const double own = sign * force[c * slots];
      added[c * stride + to] = has_base ? own + base[c * stride + to] : own;
    }
  }
}

MS_INLINE void set_rows_of(int dims, const ms_model *model, int32_t begin, int32_t end) {
  const struct ms_law_springs *s = model->laws;
  const int32_t *first = s->first;
  const size_t stride = (size_t)model->unknowns.stride, slots = (size_t)s->nslots;
  const double *scratch = s->scratch, *base = model->base_force;
  double *added = model->added_force;
  for (int32_t r = begin; r < end; r++) {
    const ms_law_end *at = s->end + first[r], *last = s->end + first[r + 1];
    const double *others = ms_half_edges_is_split(&model->half_edges, s->row[r]) ? added : base;
    const size_t to = (size_t)s->row[r];
    double sum[3];
    for (size_t c = 0; c < (size_t)dims; c++) sum[c] = at->sign * (scratch + at->slot)[c * slots];
    while (++at < last)
      for (size_t c = 0; c < (size_t)dims; c++)
        sum[c] += at->sign * (scratch + at->slot)[c * slots];
    for (size_t c = 0; c < (size_t)dims; c++)
      added[c * stride + to] = others ? sum[c] + others[c * stride + to] : sum[c];
  }
}

MS_INLINE void add_forces_of(int dims, const ms_model *model, int32_t begin, int32_t end) {
  const int32_t nsingle = model->laws->nsingle, middle = end < nsingle ? end : nsingle;
  if (model->base_force) set_single_rows_of(dims, 1, model, begin, middle);
  else set_single_rows_of(dims, 0, model, begin, middle);
  set_rows_of(dims, model, begin > nsingle ? begin : nsingle, end);
}

static void add_forces(const ms_model *model, int32_t begin, int32_t end) {
  if (model->unknowns.dims == 3) add_forces_of(3, model, begin, end);
  else add_forces_of(2, model, begin, end);
}

/*------------------------------------- breaking -------------------------------------------------*/

static inline int is_any(ms_mask mask) {
  int any = 0;
  for (int l = 0; l < MS_LANES; l++) any |= mask[l] != 0;
  return any;
}

MS_INLINE double slack_of(int dims, const ms_model *model, const ms_law_run *run, const double *x) {
  const struct ms_law_springs *s = model->laws;
  const size_t stride = (size_t)model->unknowns.stride;
  ms_lanes least = (ms_lanes){0} + DBL_MAX;
  ms_mask beyond = {0};
  for (int32_t e = run->begin; e < run->end; e += MS_LANES) {
    const ms_lanes slack =
        ms_simd_load(s->limit + e) -
        ms_simd_sqrt(squared_length(dims, difference(dims, x, stride, s->i + e, s->j + e)));
    beyond |= ~(slack >= 0);
    least = ms_simd_select(slack < least, slack, least);
  }
  double result = least[0];
  for (int l = 1; l < MS_LANES; l++) result = least[l] < result ? least[l] : result;
  return is_any(beyond) ? -1 : result;
}

static double find_slack(const ms_model *model, const ms_law_run *run, const double *x) {
  return model->unknowns.dims == 3 ? slack_of(3, model, run, x) : slack_of(2, model, run, x);
}

MS_INLINE int has_moved_of(int dims, const ms_model *model, int32_t begin, int32_t end,
                           const double *seen, const double *x, double most) {
  const size_t stride = (size_t)model->unknowns.stride;
  ms_mask moved = {0};
  for (int32_t r = begin; r < end; r += MS_LANES)
    moved |= ~(squared_length(dims, ms_subtract_vec(dims, ms_load_vec(dims, x + r, stride),
                                                    ms_load_vec(dims, seen + r, stride))) <=
               most * most);
  return is_any(moved);
}

static int has_moved(const ms_model *model, int32_t begin, int32_t end, const double *seen,
                     const double *x, double most) {
  return model->unknowns.dims == 3 ? has_moved_of(3, model, begin, end, seen, x, most)
                                   : has_moved_of(2, model, begin, end, seen, x, most);
}

const ms_law_kernels MS_TABLE(ms_law_kernels) = {measure, compute_forces, add_forces, find_slack,
                                                 has_moved};
