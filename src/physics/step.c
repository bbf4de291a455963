#include "physics/step.h"

#include <stdatomic.h>

MS_TABLES(ms_pass_kernels);

/* Slices in an item of work: some 5 us. */
enum { CHUNK = 64 };

typedef struct job {
  const ms_model *model;
  const ms_pass *pass;
  atomic_int suspect;
} job;

static void do_part(void *data, int32_t item) {
  const job *j = data;
  ms_pass_kernels_of[j->model->isa]->part(j->model, j->pass, item);
}

static void do_chunk(void *data, int32_t item) {
  job *j = data;
  const int32_t ngroups = j->model->halves.ngroups, begin = CHUNK * item;
  const int32_t end = ngroups - begin < CHUNK ? ngroups : begin + CHUNK;
  if (!ms_pass_kernels_of[j->model->isa]->groups(j->model, j->pass, begin, end))
    atomic_store_explicit(&j->suspect, 1, memory_order_relaxed);
}

/* part_force = spring forces on split rows */
static void sum_parts(const ms_model *model, job *j) {
  const ms_halves *halves = &model->halves;
  const size_t stride = (size_t)model->rows.stride;
  ms_pool_run(model->pool, do_part, j, halves->nparts);
  for (int32_t k = 0; k < halves->nparts; k++)
    for (size_t c = 0; c < (size_t)model->rows.dims; c++)
      model->part_force[c * stride + (size_t)halves->part_row[k]] = 0;
  ms_halves_add_parts(halves, model->rows.dims, stride, model->part_force);
}

int ms_pass_run(const ms_model *model, const ms_pass *pass) {
  job j = {.model = model, .pass = pass};
  if (model->part_force) sum_parts(model, &j);
  ms_pool_run(model->pool, do_chunk, &j, (model->halves.ngroups + CHUNK - 1) / CHUNK);
  return !atomic_load(&j.suspect);
}
