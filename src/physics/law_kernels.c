/* Compiled once for each instruction set MS_ISA; every loop is built for 2 and for 3 components. */
#include "physics/law_kernels.h"

#include <math.h>

#include "base/simd.h"

/*------------------------------------- lengths --------------------------------------------------*/

MS_INLINE void measure_of(int dims, const ms_model *model, const ms_law_run *run, const double *x,
                          ms_law_lengths *to) {
  const struct ms_law_springs *s = model->laws;
  const int32_t *i = s->i + run->begin, *j = s->j + run->begin, n = run->end - run->begin;
  const double *rest = s->rest + run->begin;
  const double *y = x + model->unknowns.stride, *z = y + model->unknowns.stride;
  for (int32_t e = 0; e < n; e++) {
    const double dx = x[j[e]] - x[i[e]], dy = y[j[e]] - y[i[e]];
    const double dz = dims == 3 ? z[j[e]] - z[i[e]] : 0;
    to->d[0][e] = dx, to->d[1][e] = dy, to->d[2][e] = dz;
    to->l2[e] = dx * dx + dy * dy + dz * dz;
  }
  for (int32_t e = 0; e < n; e++) {
    to->l[e] = sqrt(to->l2[e]);
    to->at.stretch[e] = to->l[e] - rest[e];
  }
}

static void measure(const ms_model *model, const ms_law_run *run, const double *x,
                    ms_law_lengths *to) {
  if (model->unknowns.dims == 3) measure_of(3, model, run, x, to);
  else measure_of(2, model, run, x, to);
}

/*------------------------------------- forces ---------------------------------------------------*/

static void compute_forces(const ms_model *model, const ms_law_run *run, const double *x) {
  const struct ms_law_springs *s = model->laws;
  const double least = sqrt(MS_MIN_LENGTH2);
  const int32_t n = run->end - run->begin;
  double *to = s->scratch + 2 * MS_LAW_RECORD * (size_t)run->begin, pull[MS_LAW_BATCH];
  ms_law_lengths at;
  at.at.only_force = 1;
  measure(model, run, x, &at);
  ms_law_springs_evaluate(model, run, &at.at);
  for (int32_t e = 0; e < n; e++) pull[e] = at.at.force[e] / (at.l[e] < least ? least : at.l[e]);
  for (int32_t e = 0; e < n; e++, to += 2 * MS_LAW_RECORD)
    for (int c = 0; c < 3; c++) {
      to[c] = pull[e] * at.d[c][e];
      to[MS_LAW_RECORD + c] = -to[c];
    }
}

MS_INLINE void add_forces_of(int dims, const ms_model *model, int32_t begin, int32_t end) {
  const struct ms_law_springs *s = model->laws;
  const int32_t *first_part = model->half_edges.first_part, *first = s->first;
  const size_t stride = (size_t)model->unknowns.stride;
  for (int32_t r = begin; r < end; r++) {
    double *to = model->added_force + s->row[r], sum[3];
    const double *force = s->scratch + MS_LAW_RECORD * (size_t)s->end[first[r]].number;
    for (int c = 0; c < dims; c++) sum[c] = force[c];
    for (int32_t at = first[r] + 1; at < first[r + 1]; at++) {
      force = s->scratch + MS_LAW_RECORD * (size_t)s->end[at].number;
      for (int c = 0; c < dims; c++) sum[c] += force[c];
    }
    const double *others = first_part[s->row[r]] >= 0 ? to
                           : model->base_force        ? model->base_force + s->row[r]
                                                      : NULL;
    for (int c = 0; c < dims && others; c++) sum[c] += others[(size_t)c * stride];
    for (int c = 0; c < dims; c++) to[(size_t)c * stride] = sum[c];
  }
}

static void add_forces(const ms_model *model, int32_t begin, int32_t end) {
  if (model->unknowns.dims == 3) add_forces_of(3, model, begin, end);
  else add_forces_of(2, model, begin, end);
}

const ms_law_kernels MS_TABLE(ms_law_kernels) = {measure, compute_forces, add_forces};
