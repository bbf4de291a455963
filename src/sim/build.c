/* build - model, solver and vectors of a plan */
#include "sim/sim.h"

static msim_status allocate(msim_sim *sim, msim_error *err) {
  ms_stepper *s = &sim->stepper;
  double **vectors[5 + MS_MAX_WORK] = {&s->x, &s->v, &s->x_next, &s->v_next, &s->scratch};
  int count = 5;
  for (int i = 0; i < sim->integrator->nwork; i++) vectors[count++] = &s->work[i];
  for (int i = 0; i < count; i++) {
    *vectors[i] = ms_rows_vector(sim->scene, &sim->model->rows);
    if (!*vectors[i]) return ms_fail_memory(err, "the state");
  }
  return MSIM_OK;
}

/* Started once, by the first plan. */
static void use_threads(msim_sim *sim) {
  if (!sim->threads_planned) {
    sim->threads_planned = ms_plan_threads(&sim->opt, sim->model);
    sim->pool = ms_pool_create(&sim->alloc, sim->threads_planned);
  }
  sim->model->pool = sim->pool;
}

static msim_status build(msim_sim *sim, unsigned skip_off, msim_error *err) {
  sim->model = ms_new(&sim->alloc, 1, sizeof *sim->model);
  if (!sim->model) return ms_fail_memory(err, "the model");
  msim_status status = ms_model_create(sim->scene, skip_off, sim->model, err);
  if (!status) use_threads(sim);
  if (!status) status = allocate(sim, err);
  if (!status && sim->integrator->entry.implicit)
    status = ms_solver_create(sim->model, &sim->opt, sim->plan.h, &sim->stats, &sim->linear, err);
  sim->stepper.model = sim->model;
  sim->stepper.opt = &sim->opt;
  sim->stepper.solver = sim->linear;
  sim->stepper.stats = &sim->stats;
  return status;
}

static void take_down(const msim_allocator *alloc, ms_model *model, ms_solver *linear,
                      const ms_stepper *s) {
  ms_solver_destroy(linear);
  if (model) ms_model_destroy(model);
  ms_delete(alloc, model);
  double *vectors[] = {s->x, s->v, s->x_next, s->v_next, s->scratch};
  for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) ms_delete(alloc, vectors[i]);
  for (int i = 0; i < MS_MAX_WORK; i++) ms_delete(alloc, s->work[i]);
}

void ms_sim_take_down(msim_sim *sim) {
  take_down(&sim->alloc, sim->model, sim->linear, &sim->stepper);
}

msim_status ms_sim_build(msim_sim *sim, unsigned skip_off, msim_error *err) {
  ms_model *model = sim->model;
  ms_solver *linear = sim->linear;
  const ms_stepper stepper = sim->stepper;
  sim->model = NULL, sim->linear = NULL, sim->stepper = (ms_stepper){0};
  msim_status status = build(sim, skip_off, err);
  if (!status) {
    take_down(&sim->alloc, model, linear, &stepper);
    return MSIM_OK;
  }
  ms_sim_take_down(sim);
  sim->model = model, sim->linear = linear, sim->stepper = stepper;
  return status;
}
