#include "physics/excess.h"

#include "physics/kernels.h"

MS_TABLES(ms_kernels);

typedef struct job {
  const ms_model *model;
  const double *x, *d;
  double h, lambda;
  int32_t chunk; /* slice ranges in an item of work */
  double *sums;  /* one per item */
} job;

static void sum_chunk(void *data, int32_t item) {
  const job *j = data;
  j->sums[item] =
      ms_kernels_of[j->model->isa]->excess(j->model, j->x, j->h, j->d, j->lambda, j->chunk * item,
                                           ms_chunk_end(&j->model->halves, j->chunk, item));
}

double ms_excess(const ms_model *model, const double *x, double h, const double *d, double lambda,
                 double *work) {
  enum { CHUNK = 64 };
  job j = {model, x, d, h, lambda, CHUNK, work};
  double sum = 0;
  while (ms_chunks(&model->halves, j.chunk) > model->rows.stride) j.chunk *= 2;
  const int32_t items = ms_chunks(&model->halves, j.chunk);
  ms_pool_run(model->pool, sum_chunk, &j, items);
  for (int32_t i = 0; i < items; i++) sum += work[i];
  return sum;
}
