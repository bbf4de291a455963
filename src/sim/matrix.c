/* matrix - export the matrix of the next step (msim_sim_matrix)
 *
 * It has three components per particle, the scene's order of particles, and all islands, which the
 * sim's own matrices may not have. So it has a model of its own, built at the first request. */
#include "base/sized.h"
#include "physics/force_function.h"
#include "sim/rank_sim.h"

#define WHOLE (MSIM_SKIP_TWO_D | MSIM_SKIP_ZERO_REST_LENGTH)

typedef struct ms_matrix_export {
  ms_model model;
  ms_coefficients a;
  ms_sparse_matrix matrix;
  double *x;         /* positions, in the order of the model's unknowns */
  int32_t *particle; /* of each block row */
} ms_matrix_export;

void ms_sim_free_matrix(msim_sim *sim) {
  ms_matrix_export *w = sim->matrix_export;
  if (!w) return;
  ms_coefficients_destroy(&w->model, &w->a);
  ms_sparse_matrix_destroy(&w->model, &w->matrix);
  ms_model_destroy(&w->model);
  MS_FREE(&sim->alloc, w->x, w->particle, w);
  sim->matrix_export = NULL;
}

static msim_status create_export_pattern(msim_sim *sim, ms_matrix_export *w, msim_error *err) {
  const ms_unknowns *rows = &w->model.unknowns;
  ms_sparse_graph graph = {0};
  const int32_t n = sim->scene->nparticles;
  int32_t *row = ms_memory_allocate(&sim->alloc, (size_t)n, sizeof *row);
  w->particle = ms_memory_allocate(&sim->alloc, (size_t)rows->nfree, sizeof *w->particle);
  msim_status status = row && w->particle ? ms_sparse_matrix_create_graph(&w->model, &graph, err)
                                          : ms_error_set_memory(err, "the matrix");
  if (row) ms_unknowns_find_rows(rows, row);
  for (int32_t p = 0, k = 0; p < n && !status; p++) {
    if (sim->scene->pinned[p]) continue;
    row[k] = row[p]; /* k <= p */
    w->particle[k++] = p;
  }
  if (!status)
    status = ms_sparse_matrix_create(&w->model, &graph,
                                     (ms_sparse_layout){MSIM_FORMAT_FULL, 3, row}, &w->matrix, err);
  ms_sparse_matrix_destroy_graph(&w->model, &graph);
  ms_memory_free(&sim->alloc, row);
  return status;
}

static msim_status create_export(msim_sim *sim, msim_error *err) {
  ms_matrix_export *w = sim->matrix_export = ms_memory_allocate(&sim->alloc, 1, sizeof *w);
  if (!w) return ms_error_set_memory(err, "the matrix");
  msim_status status =
      ms_model_create(sim->scene, sim->config.opt.skip_off | WHOLE, &w->model, err);
  if (!status) status = ms_coefficients_create(&w->model, &w->a, err);
  if (!status && !MS_NEW_VECTORS(sim->scene, &w->model.unknowns, &w->x))
    status = ms_error_set_memory(err, "the matrix");
  if (!status) status = create_export_pattern(sim, w, err);
  if (status) ms_sim_free_matrix(sim);
  return status;
}

/* Linearize the force function in the present state; `a.x` is scratch. */
static msim_status linearize_function(const msim_sim *sim, ms_matrix_export *w, const double *v,
                                      msim_error *err) {
  ms_force_function *function = w->model.function;
  int32_t row;
  if (!function) return MSIM_OK;
  function->status = MSIM_OK;
  ms_unknowns_gather(&w->model.unknowns, v, w->a.x);
  ms_force_function_linearize(&w->model, ms_sim_time(sim), w->x, w->a.x);
  return function->status ? ms_force_function_report(&w->model, &row, err) : MSIM_OK;
}

msim_status msim_sim_matrix(msim_sim *sim, msim_csr *A, msim_error *err) {
  if (!sim || !A) return ms_error_set(err, MSIM_ERR_ARG, "sim or A is NULL");
  const msim_status refused = ms_rank_sim_refuse(sim, "msim_sim_matrix", err);
  if (refused) return refused;
  if (!sim->config.integrator->entry.implicit)
    return ms_error_set(err, MSIM_ERR_ARG, "integrator '%s' needs no matrix",
                        sim->config.integrator->entry.name);
  msim_status status = sim->matrix_export ? MSIM_OK : create_export(sim, err);
  if (status) return status;
  ms_matrix_export *w = sim->matrix_export;
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  ms_unknowns_gather(&w->model.unknowns, now.x, w->x);
  status = linearize_function(sim, w, now.v, err);
  if (status) return status;
  ms_coefficients_compute(&w->model, w->x, sim->run.h,
                          sim->config.opt.jacobian == MSIM_JACOBIAN_CLAMP, &w->a);
  ms_sparse_matrix_assemble(&w->model, &w->a, &w->matrix);
  msim_csr full = {.n = 3 * w->matrix.n,
                   .rowptr = w->matrix.rowptr,
                   .colind = w->matrix.colind,
                   .val = w->matrix.val,
                   .particle = w->particle};
  if (ms_sized_write(A, &full, sizeof full))
    return ms_error_set(err, MSIM_ERR_SIZE, "A.size is %zu; it must be sizeof(msim_csr), %zu",
                        A->size, sizeof full);
  return ms_error_clear(err);
}
