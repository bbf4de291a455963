#include "physics/step.h"

#include <stdatomic.h>

#include "physics/kernels.h"

/* Groups to an item of work: some 5 us. */
enum { CHUNK = 64 };

typedef struct job {
  const ms_model *model;
  const ms_pass *pass;
  atomic_int suspect;
} job;

static void do_chunk(void *data, int32_t item) {
  job *j = data;
  const int32_t ngroups = j->model->halves.ngroups, begin = CHUNK * item;
  const int32_t end = ngroups - begin < CHUNK ? ngroups : begin + CHUNK;
  if (!j->model->kernels->pass(j->model, j->pass, begin, end))
    atomic_store_explicit(&j->suspect, 1, memory_order_relaxed);
}

int ms_pass_run(const ms_model *model, const ms_pass *pass) {
  job j = {.model = model, .pass = pass};
  ms_pool_run(model->pool, do_chunk, &j, (model->halves.ngroups + CHUNK - 1) / CHUNK);
  return !atomic_load(&j.suspect);
}
