#include "physics/nonlinearity.h"

#include "physics/matrix_kernels.h"

MS_TABLES(ms_matrix_kernels);

typedef struct sums_job {
  ms_nonlinearity_job of;
  int32_t chunk; /* slice ranges in an item of work */
  double *sums;  /* one per item */
} sums_job;

static void sum_nonlinearity_chunk(void *data, int32_t item) {
  const sums_job *j = data;
  const ms_model *model = j->of.model;
  j->sums[item] = ms_matrix_kernels_of[model->isa]->nonlinearity(
      &j->of, j->chunk * item, ms_half_edges_chunk_end(&model->half_edges, j->chunk, item));
}

double ms_nonlinearity_compute(const ms_model *model, const double *x, double h, const double *d,
                               double lambda, double *work) {
  enum { CHUNK = 64 };
  sums_job j = {{model, x, d, h, lambda}, CHUNK, work};
  double sum = 0;
  while (ms_half_edges_count_chunks(&model->half_edges, j.chunk) > model->unknowns.stride)
    j.chunk *= 2;
  const int32_t items = ms_half_edges_count_chunks(&model->half_edges, j.chunk);
  ms_pool_run(model->pool, sum_nonlinearity_chunk, &j, items);
  for (int32_t i = 0; i < items; i++) sum += work[i];
  return sum;
}
