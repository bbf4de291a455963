#include "physics/nonlinearity.h"

#include "base/ranks.h"
#include "physics/angle_springs.h"
#include "physics/law_springs.h"
#include "physics/matrix_kernels.h"

MS_TABLES(ms_matrix_kernels);

typedef struct sums_job {
  ms_nonlinearity_job of;
  int32_t chunk; /* slice ranges in a chunk */
  double *sums;  /* one per chunk */
} sums_job;

static void sum_nonlinearity_chunk(void *data, int32_t begin, int32_t end) {
  const sums_job *j = data;
  j->sums[begin / j->chunk] =
      ms_matrix_kernels_of[j->of.model->isa]->nonlinearity(&j->of, begin, end);
}

double ms_nonlinearity_compute(const ms_model *model, const double *x, double h, const double *d,
                               double lambda, double *work) {
  enum { CHUNK = 64 };
  sums_job j = {{model, x, d, h, lambda}, CHUNK, work};
  double sum = 0;
  const int32_t n = ms_half_edges_count_ranges(&model->half_edges);
  while (ms_pool_count_chunks(n, j.chunk) > model->unknowns.stride) j.chunk *= 2;
  const int32_t chunks = ms_pool_run_chunks(model->pool, sum_nonlinearity_chunk, &j, n, j.chunk);
  for (int32_t i = 0; i < chunks; i++) sum += work[i];
  if (model->laws) sum += ms_law_springs_nonlinearity(model, x, d, lambda * h);
  sum += ms_angle_springs_nonlinearity(model, x, d, lambda * h);
  ms_ranks_sum(model->shape.ranks, 1, &sum);
  return sum;
}
