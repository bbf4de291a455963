#include "physics/totals.h"

#include <math.h>

#include "physics/angle_springs.h"
#include "physics/law_springs.h"
#include "physics/rank_model.h"

MS_TABLES(ms_totals_kernels);

/* Slice ranges in a chunk of work. */
enum { CHUNK = 64 };

static void compute_totals_chunk(void *data, int32_t begin, int32_t end) {
  const ms_totals_job *j = data;
  j->parts[begin / CHUNK] = ms_totals_kernels_of[j->model->isa]->slice_ranges(j, begin, end);
}

int32_t ms_totals_count_parts(const ms_model *model) {
  return ms_pool_count_chunks(ms_half_edges_count_ranges(&model->half_edges), CHUNK);
}

ms_totals ms_totals_identity(void) {
  return (ms_totals){.low = {INFINITY, INFINITY, INFINITY},
                     .high = {-INFINITY, -INFINITY, -INFINITY}};
}

void ms_totals_add(const ms_totals *more, ms_totals *to) {
  to->kinetic += more->kinetic;
  to->elastic += more->elastic;
  to->force_work += more->force_work;
  for (int c = 0; c < 3; c++) {
    to->moment[c] += more->moment[c];
    to->low[c] = fmin(to->low[c], more->low[c]);
    to->high[c] = fmax(to->high[c], more->high[c]);
  }
}

void ms_totals_sum_ranks(ms_ranks *ranks, ms_totals *t) {
  double sums[] = {t->kinetic, t->elastic, t->force_work, t->moment[0], t->moment[1], t->moment[2]};
  double most[] = {-t->low[0], -t->low[1], -t->low[2], t->high[0], t->high[1], t->high[2]};
  if (!ranks) return;
  ms_ranks_sum(ranks, 6, sums);
  ms_ranks_maximum(ranks, 6, most);
  t->kinetic = sums[0], t->elastic = sums[1], t->force_work = sums[2];
  for (int c = 0; c < 3; c++)
    t->moment[c] = sums[3 + c], t->low[c] = -most[c], t->high[c] = most[3 + c];
}

ms_totals ms_totals_compute(const ms_model *model, const double *x, const double *v,
                            ms_totals *parts) {
  ms_totals_job j = {.model = model, .x = x, .v = v, .parts = parts};
  ms_totals sum = ms_totals_identity();
  ms_rank_model_refresh(model, x, NULL);
  const int32_t n = ms_pool_run_chunks(model->pool, compute_totals_chunk, &j,
                                       ms_half_edges_count_ranges(&model->half_edges), CHUNK);
  for (int32_t i = 0; i < n; i++) ms_totals_add(&parts[i], &sum);
  if (model->laws) sum.elastic += ms_law_springs_energy(model, x);
  sum.elastic += ms_angle_springs_energy(model, x);
  if (model->rank_model) sum.elastic -= ms_rank_model_foreign_energy(model, x);
  ms_shape own = model->shape;
  own.ranks = NULL;
  if (model->force) sum.force_work = ms_vector_dot(own, model->force, x);
  return sum;
}
