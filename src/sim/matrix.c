/* matrix - export the matrix of the next step (msim_sim_matrix)
 *
 * It has three components per particle, the scene's order of particles, and all islands, which the
 * sim's own matrices may not have. So it has a model of its own, built at the first request. */
#include "sim/sim.h"

#define WHOLE (MSIM_SKIP_TWO_D | MSIM_SKIP_ZERO_REST_LENGTH)

typedef struct ms_whole {
  ms_model model;
  ms_coefficients a;
  ms_matrix matrix;
  double *x;         /* positions, in the order of the model's unknowns */
  int32_t *particle; /* of each block row */
} ms_whole;

void ms_sim_drop_matrix(msim_sim *sim) {
  ms_whole *w = sim->whole;
  if (!w) return;
  ms_coefficients_destroy(&w->model, &w->a);
  ms_matrix_destroy(&w->model, &w->matrix);
  ms_model_destroy(&w->model);
  ms_delete(&sim->alloc, w->x);
  ms_delete(&sim->alloc, w->particle);
  ms_delete(&sim->alloc, w);
  sim->whole = NULL;
}

static msim_status make_pattern(msim_sim *sim, ms_whole *w, msim_error *err) {
  const ms_rows *rows = &w->model.rows;
  ms_graph graph = {0};
  const int32_t n = sim->scene->nparticles;
  int32_t *row = ms_new(&sim->alloc, (size_t)n, sizeof *row);
  w->particle = ms_new(&sim->alloc, (size_t)rows->nfree, sizeof *w->particle);
  msim_status status = row && w->particle ? ms_graph_create(&w->model, &graph, err)
                                          : ms_fail_memory(err, "the matrix");
  if (row) ms_rows_invert(rows, row);
  for (int32_t p = 0, k = 0; p < n && !status; p++) {
    if (sim->scene->pinned[p]) continue;
    row[k] = row[p]; /* k <= p */
    w->particle[k++] = p;
  }
  if (!status)
    status = ms_matrix_create(&w->model, &graph, row, MSIM_FORMAT_FULL, 3, &w->matrix, err);
  ms_graph_destroy(&w->model, &graph);
  ms_delete(&sim->alloc, row);
  return status;
}

static msim_status make_whole(msim_sim *sim, msim_error *err) {
  ms_whole *w = sim->whole = ms_new(&sim->alloc, 1, sizeof *w);
  if (!w) return ms_fail_memory(err, "the matrix");
  msim_status status = ms_model_create(sim->scene, sim->opt.skip_off | WHOLE, &w->model, err);
  if (!status) status = ms_coefficients_create(&w->model, &w->a, err);
  if (!status && !(w->x = ms_rows_vector(sim->scene, &w->model.rows)))
    status = ms_fail_memory(err, "the matrix");
  if (!status) status = make_pattern(sim, w, err);
  if (status) ms_sim_drop_matrix(sim);
  return status;
}

msim_status msim_sim_matrix(msim_sim *sim, msim_csr *A, msim_error *err) {
  if (!sim || !A) return ms_fail(err, MSIM_ERR_ARG, "sim or A is NULL");
  if (!sim->integrator->entry.implicit)
    return ms_fail(err, MSIM_ERR_ARG, "integrator '%s' needs no matrix",
                   sim->integrator->entry.name);
  msim_status status = sim->whole ? MSIM_OK : make_whole(sim, err);
  if (status) return status;
  ms_whole *w = sim->whole;
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  ms_rows_gather(&w->model.rows, now.x, w->x);
  ms_coefficients_compute(&w->model, w->x, sim->plan.h, sim->opt.jacobian == MSIM_JACOBIAN_CLAMP,
                          &w->a);
  ms_matrix_expand(&w->model, &w->a, &w->matrix);
  msim_csr full = {.size = A->size,
                   .n = 3 * w->matrix.n,
                   .rowptr = w->matrix.rowptr,
                   .colind = w->matrix.colind,
                   .val = w->matrix.val,
                   .particle = w->particle};
  MS_GIVE(A, full);
  return ms_ok(err);
}
