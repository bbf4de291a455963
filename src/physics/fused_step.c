#include "physics/fused_step.h"

#include <stdatomic.h>

#include "physics/angle_springs.h"
#include "physics/force_function.h"
#include "physics/law_springs.h"
#include "physics/rank_model.h"

MS_TABLES(ms_force_kernels);
MS_TABLES(ms_single_force_kernels);

/* Slices in a chunk of work: some 5 us. */
enum { CHUNK = 64 };

typedef struct fused_step_job {
  const ms_force_kernels *kernels;
  const ms_model *model;
  const ms_fused_step *sweep;
  atomic_int may_be_bad;
} fused_step_job;

static void do_split_row_part(void *data, int32_t item) {
  const fused_step_job *j = data;
  j->kernels->part(j->model, j->sweep, item);
}

static void do_slices_chunk(void *data, int32_t begin, int32_t end) {
  fused_step_job *j = data;
  if (!j->kernels->slices(j->model, j->sweep, begin, end))
    atomic_store_explicit(&j->may_be_bad, 1, memory_order_relaxed);
}

/* On split rows added_force = base forces + spring forces. */
static void sum_split_rows(const ms_model *model, fused_step_job *j) {
  const ms_half_edges *half_edges = &model->half_edges;
  const size_t stride = (size_t)model->unknowns.stride;
  ms_pool_run(model->pool, do_split_row_part, j, half_edges->nparts);
  for (int32_t k = 0; k < half_edges->nparts; k++)
    for (size_t c = 0; c < (size_t)model->unknowns.dims; c++) {
      const size_t at = c * stride + (size_t)half_edges->part_row[k];
      model->added_force[at] = model->base_force ? model->base_force[at] : 0;
    }
  ms_half_edges_add_part_sums(half_edges, model->unknowns.dims, stride, model->added_force);
}

/* Evaluate the program's force, and set the rows that no spring sets. */
static void evaluate_function(const ms_model *model, const ms_fused_step *sweep) {
  const void *v = sweep->function_v ? sweep->function_v : sweep->v;
  ms_force_function_evaluate(model, sweep->t, sweep->x, v);
  if (model->added_force != model->base_force)
    ms_vector_copy_all(model->shape, model->base_force, model->added_force);
}

int ms_fused_step_run(const ms_model *model, const ms_fused_step *sweep) {
  fused_step_job j = {.kernels = model->single ? ms_single_force_kernels_of[model->isa]
                                               : ms_force_kernels_of[model->isa],
                      .model = model,
                      .sweep = sweep};
  ms_rank_model_refresh(model, sweep->x, model->features & MS_HAS_DAMPING ? sweep->v : NULL);
  if (model->function) evaluate_function(model, sweep);
  ms_angle_springs_reset_forces(model);
  if (model->half_edges.nparts) sum_split_rows(model, &j);
  if (model->laws && !ms_law_springs_are_in_sweep(model, sweep->v))
    ms_law_springs_add_forces(model, sweep->x);
  ms_angle_springs_add_forces(model, sweep->x, sweep->v);
  ms_pool_run_chunks(model->pool, do_slices_chunk, &j, model->half_edges.nslices, CHUNK);
  return !atomic_load(&j.may_be_bad);
}
