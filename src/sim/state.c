/* state - looking at a sim, and setting its state */
#include <math.h>
#include <string.h>

#include "physics/energy.h"
#include "sim/sim.h"

/* A plain struct of the caller's size. */
static void give(void *to, const void *from, size_t size) { memcpy(to, from, size); }
#define GIVE(to, full) give(to, &(full), (full).size < sizeof(full) ? (full).size : sizeof(full))

/* Rows to flat arrays, once a step at most, and only when somebody looks. */
static void refresh(msim_sim *sim) {
  if (sim->flat_is_current) return;
  const ms_stepper *s = &sim->stepper;
  const ms_rows *rows = &sim->model.rows;
  ms_rows_scatter(rows, s->x, sim->flat_x);
  if (sim->integrator->sync) {
    ms_rows_scatter(rows, s->v, sim->flat_v_half);
    double *v = s->v_next; /* free between steps */
    sim->integrator->sync(s, v, sim->scratch);
    ms_rows_scatter(rows, v, sim->flat_v);
  } else {
    ms_rows_scatter(rows, s->v, sim->flat_v);
  }
  sim->flat_is_current = 1;
}

void msim_sim_state(msim_sim *sim, msim_state *state) {
  refresh(sim);
  msim_state full = {.size = state->size,
                     .step = sim->step,
                     .t = ms_sim_time(sim),
                     .n = sim->scene->nparticles,
                     .x = sim->flat_x,
                     .v = sim->flat_v,
                     .v_half = sim->flat_v_half,
                     .h = sim->plan.h};
  GIVE(state, full);
}

static msim_status check_state(const msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_scene *scene = sim->scene;
  if (state->n != scene->nparticles)
    return ms_fail(err, MSIM_ERR_ARG, "the state has %d particles, the scene %d", state->n,
                   scene->nparticles);
  if (!state->x || !state->v) return ms_fail(err, MSIM_ERR_ARG, "the state has no x or no v");
  if (!isfinite(state->t) || state->step < 0)
    return ms_fail(err, MSIM_ERR_ARG, "the state's t must be finite and its step >= 0");
  for (size_t i = 0; i < 3 * (size_t)state->n; i++) {
    int pinned = scene->pinned[i / 3];
    if (!(fabs(state->x[i]) <= MS_HUGE && fabs(state->v[i]) <= MS_HUGE) ||
        (state->v_half && !(fabs(state->v_half[i]) <= MS_HUGE)))
      return ms_fail(err, MSIM_ERR_ARG, "particle %zu of the state is not finite", i / 3);
    if (pinned && (state->x[i] != scene->x[i] || state->v[i] != 0))
      return ms_fail(err, MSIM_ERR_ARG,
                     "particle %zu is pinned: it must stay in its place, at rest", i / 3);
  }
  return MSIM_OK;
}

msim_status msim_sim_set_state(msim_sim *sim, const msim_state *state, msim_error *err) {
  if (!sim || !state) return ms_fail(err, MSIM_ERR_ARG, "sim or state is NULL");
  msim_status status = check_state(sim, state, err);
  if (!status) status = ms_sim_make_plan(sim, state->t, err);
  if (status) return status;
  const ms_rows *rows = &sim->model.rows;
  const size_t flat = 3 * (size_t)state->n * sizeof(double);
  ms_stepper *s = &sim->stepper;
  sim->step = sim->step0 = state->step;
  sim->t0 = state->t;
  memmove(sim->flat_x, state->x, flat);
  memmove(sim->flat_v, state->v, flat);
  ms_rows_gather(rows, state->x, s->x);
  ms_rows_gather(rows, state->x, s->x_next); /* for its pinned rows */
  ms_rows_gather(rows, state->v, s->v);
  s->h = sim->plan.h;
  s->warm = 0;
  if (sim->linear) ms_solver_restart(sim->linear);
  if (sim->integrator->start) sim->integrator->start(s);
  if (sim->integrator->sync && state->v_half && state->h == sim->plan.h) {
    ms_rows_gather(rows, state->v_half, s->v);
    s->warm = 0;
  }
  if (sim->integrator->sync) ms_rows_scatter(rows, s->v, sim->flat_v_half);
  sim->flat_is_current = 1;
  return ms_ok(err);
}

void msim_sim_energy(msim_sim *sim, msim_energy *energy) {
  refresh(sim);
  msim_energy full = {.size = energy->size};
  ms_energy(sim->scene, sim->flat_x, sim->flat_v, &full);
  GIVE(energy, full);
}

void msim_sim_stats(const msim_sim *sim, msim_stats *stats) {
  msim_stats full = sim->stats;
  full.size = stats->size;
  GIVE(stats, full);
}

void msim_sim_plan(const msim_sim *sim, msim_plan *plan) {
  msim_plan full = {.size = plan->size,
                    .h = sim->plan.h,
                    .steps = sim->plan.steps,
                    .integrator = sim->integrator->entry.name,
                    .solver = sim->linear ? sim->linear->linear->name : "none",
                    .threads = ms_pool_threads(sim->pool)};
  GIVE(plan, full);
}

void msim_sim_force(msim_sim *sim, const double *x, const double *v, double *force) {
  ms_stepper *s = &sim->stepper;
  const ms_rows *rows = &sim->model.rows;
  ms_rows_gather(rows, x, s->x_next);
  ms_rows_gather(rows, v, s->v_next);
  ms_force(&sim->model, s->x_next, s->v_next, sim->scratch);
  ms_rows_scatter(rows, sim->scratch, force);
  for (int32_t p = 0; p < rows->n; p++)
    if (sim->scene->pinned[p]) memset(force + 3 * (size_t)p, 0, 3 * sizeof *force);
  /* leave the pinned rows as steps expect them */
  memcpy(s->x_next, s->x, 3 * (size_t)rows->stride * sizeof *x);
  memset(s->v_next, 0, 3 * (size_t)rows->stride * sizeof *v);
}

/*------------------------------------- matrix ---------------------------------------------------*/

static msim_status matrix_pattern(msim_sim *sim, msim_error *err) {
  const ms_rows *rows = &sim->model.rows;
  ms_graph graph = {0};
  int32_t *order = ms_new(&sim->alloc, (size_t)rows->nfree, sizeof *order);
  sim->csr_particle = ms_new(&sim->alloc, (size_t)rows->nfree, sizeof *sim->csr_particle);
  msim_status status = order && sim->csr_particle ? ms_graph_create(&sim->model, &graph, err)
                                                  : ms_fail_memory(err, "the matrix");
  for (int32_t p = 0, k = 0; p < rows->n && !status; p++) {
    if (sim->scene->pinned[p]) continue;
    order[k] = rows->row[p];
    sim->csr_particle[k++] = p;
  }
  if (!status)
    status = ms_matrix_create(&sim->model, &graph, order, MSIM_FORMAT_FULL, &sim->csr, err);
  ms_graph_destroy(&sim->model, &graph);
  ms_delete(&sim->alloc, order);
  if (!status) return status;
  ms_matrix_destroy(&sim->model, &sim->csr);
  ms_delete(&sim->alloc, sim->csr_particle);
  sim->csr_particle = NULL;
  return status;
}

msim_status msim_sim_matrix(msim_sim *sim, msim_csr *A, msim_error *err) {
  if (!sim || !A) return ms_fail(err, MSIM_ERR_ARG, "sim or A is NULL");
  if (!sim->linear)
    return ms_fail(err, MSIM_ERR_ARG, "integrator '%s' needs no matrix",
                   sim->integrator->entry.name);
  if (!sim->csr_particle) {
    msim_status status = matrix_pattern(sim, err);
    if (status) return status;
  }
  ms_coefficients *a = &sim->linear->system.a;
  ms_coefficients_compute(&sim->model, sim->stepper.x, sim->plan.h, sim->linear->clamp, a);
  ms_matrix_expand(&sim->model, a, &sim->csr);
  msim_csr full = {.size = A->size,
                   .n = 3 * sim->csr.n,
                   .rowptr = sim->csr.rowptr,
                   .colind = sim->csr.colind,
                   .val = sim->csr.val,
                   .particle = sim->csr_particle};
  GIVE(A, full);
  return ms_ok(err);
}
