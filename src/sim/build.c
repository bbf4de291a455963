/* build - create the model, the solver and the vectors of each island */
#include "integrate/constrain.h"
#include "integrate/split.h"
#include "sim/drive.h"

static msim_status allocate(msim_sim *sim, ms_motion *m, msim_error *err) {
  ms_stepper *s = &m->stepper;
  double **vectors[9 + MS_MAX_WORK] = {&s->x, &s->v, &s->x_next, &s->v_next, &s->scratch};
  int count = 5;
  const int events =
      sim->opt.collision == MSIM_COLLISION_EVENT && m->model.passes & MSIM_SKIP_PLANES;
  const int nwork = events && sim->integrator->entry.implicit ? MS_CONSTRAIN_WORK : 0;
  for (int i = 0; i < sim->integrator->nwork || i < nwork; i++) vectors[count++] = &s->work[i];
  const int halves = ms_sim_has_control(sim) || ms_sim_selects(sim) || ms_drive_retries(sim) > 1;
  const int spare = halves ? 2 : ms_drive_retries(sim) > 0;
  for (int i = 0; i < spare; i++)
    vectors[count++] = &s->x_spare[i], vectors[count++] = &s->v_spare[i];
  for (int i = 0; i < count; i++) {
    *vectors[i] = ms_rows_vector(sim->scene, &m->model.rows);
    if (!*vectors[i]) return ms_fail_memory(err, "the state");
  }
  msim_status status = ms_watch_create(sim, &m->model, &m->guard, err);
  if (!status && (ms_sim_has_control(sim) || ms_sim_selects(sim)))
    status = ms_norm_create(&m->model, &m->norm, err);
  if (!status) status = ms_verify_create(sim, &m->model, &m->check, err);
  if (!status) status = ms_sensitivity_create(sim, &m->model, &m->disturbance, err);
  if (status) return status;
  return events ? ms_events_create(&m->model, &s->events, err) : MSIM_OK;
}

static msim_status make_models(msim_sim *sim, int32_t left_out, msim_error *err) {
  ms_islands islands;
  const int whole = (sim->opt.skip_off & MSIM_SKIP_ISLANDS) != 0;
  msim_status status = ms_islands_create(sim->scene, whole, &islands, err);
  if (status) return status;
  sim->motion = ms_new(&sim->alloc, (size_t)islands.n, sizeof *sim->motion);
  if (sim->motion) sim->nislands = islands.n;
  else status = ms_fail_memory(err, "the islands");
  for (int32_t i = 0; i < islands.n && !status; i++) {
    const ms_island island = ms_island_at(&islands, i);
    status = ms_model_create_island(sim->scene, &island, left_out, sim->opt.skip_off,
                                    &sim->motion[i].model, err);
    if (sim->selection.verification.away)
      sim->motion[i].model.passes &= ~(unsigned)MSIM_SKIP_PLANES;
  }
  ms_islands_destroy(sim->scene, &islands);
  return status;
}

/* Threads are started once, when islands are built for the first time. */
static void start_threads(msim_sim *sim) {
  int64_t slots = 0;
  if (sim->threads_planned) return;
  for (int32_t i = 0; i < sim->nislands; i++) slots += sim->motion[i].model.halves.nslots;
  sim->threads_planned = ms_plan_threads(&sim->opt, slots);
  sim->pool = ms_pool_create(&sim->alloc, sim->threads_planned);
}

/* All threads share the work of a large island. If there are at least two small islands per thread,
 * each thread steps small islands by itself, with explicit methods only: solvers may allocate, and
 * so stay in the caller's thread. */
static void use_threads(msim_sim *sim) {
  enum { SMALL = 512 }; /* slices */
  int32_t nsmall = 0;
  start_threads(sim);
  for (int32_t i = 0; i < sim->nislands; i++) nsmall += sim->motion[i].model.halves.ngroups < SMALL;
  sim->any_by_one =
      sim->pool && !sim->integrator->entry.implicit && nsmall >= 2 * ms_pool_threads(sim->pool);
  for (int32_t i = 0; i < sim->nislands; i++) {
    ms_motion *m = &sim->motion[i];
    m->by_one = sim->any_by_one && m->model.halves.ngroups < SMALL;
    m->model.pool = m->by_one ? NULL : sim->pool;
  }
}

static msim_status make_stepper(msim_sim *sim, ms_motion *m, msim_error *err) {
  ms_stepper *s = &m->stepper;
  s->model = &m->model;
  s->opt = &sim->opt;
  s->stats = m->by_one ? &m->stats : &sim->stats;
  s->h = sim->plan.h;
  ms_bound_stages(sim->integrator, s);
  msim_status status = allocate(sim, m, err);
  if (!status && sim->integrator->splits)
    status = ms_split_create(&m->model, &sim->opt, s->h, &s->split, err);
  if (status || !sim->integrator->entry.implicit) return status;
  return ms_solver_create(&m->model, &sim->opt, sim->plan.h, sim->integrator->nonlinear,
                          &sim->stats, &s->solver, err);
}

/* Constraints act on blocks: the matrix must not become scalar, identical for each component. */
static void keep_blocks(msim_sim *sim) {
  if (sim->opt.collision == MSIM_COLLISION_EVENT && sim->scene->nplanes &&
      sim->integrator->entry.implicit)
    sim->opt.skip_off |= MSIM_SKIP_ZERO_REST_LENGTH;
}

msim_status ms_sim_make_motions(msim_sim *sim, int32_t left_out, msim_error *err) {
  keep_blocks(sim);
  msim_status status = make_models(sim, left_out, err);
  if (!status) use_threads(sim);
  for (int32_t i = 0; i < sim->nislands && !status; i++)
    status = make_stepper(sim, &sim->motion[i], err);
  return status;
}

static void take_down(const msim_allocator *alloc, ms_motion *motion, int32_t nislands) {
  for (int32_t i = 0; i < nislands; i++) {
    ms_stepper *s = &motion[i].stepper;
    ms_solver_destroy(s->solver);
    ms_split_destroy(&motion[i].model, s->split);
    ms_events_destroy(&motion[i].model, s->events);
    ms_watch_destroy(&motion[i].model, &motion[i].guard);
    ms_norm_destroy(&motion[i].model, &motion[i].norm);
    ms_sensitivity_destroy(&motion[i].model, &motion[i].disturbance);
    ms_verify_destroy(&motion[i].model, &motion[i].check);
    ms_model_destroy(&motion[i].model);
    double *vectors[] = {s->x,          s->v,          s->x_next,     s->v_next,    s->scratch,
                         s->x_spare[0], s->x_spare[1], s->v_spare[0], s->v_spare[1]};
    for (size_t k = 0; k < sizeof vectors / sizeof *vectors; k++) ms_delete(alloc, vectors[k]);
    for (int k = 0; k < MS_MAX_WORK; k++) ms_delete(alloc, s->work[k]);
  }
  ms_delete(alloc, motion);
}

void ms_sim_take_down(msim_sim *sim) { take_down(&sim->alloc, sim->motion, sim->nislands); }

ms_motions ms_sim_put_aside(msim_sim *sim) {
  const ms_motions old = {sim->nislands, sim->motion, sim->any_by_one};
  sim->motion = NULL, sim->nislands = 0;
  return old;
}

void ms_sim_drop(msim_sim *sim, const ms_motions *old) {
  take_down(&sim->alloc, old->motion, old->n);
}

void ms_sim_put_back(msim_sim *sim, const ms_motions *old) {
  ms_sim_take_down(sim);
  sim->nislands = old->n, sim->motion = old->motion, sim->any_by_one = old->any_by_one;
}

void ms_sim_choose_for(msim_sim *sim, ms_scene *scene) {
  ms_scene_release(sim->chosen_for);
  sim->chosen_for = scene;
}

msim_status ms_sim_build(msim_sim *sim, int32_t left_out, msim_error *err) {
  const ms_motions old = ms_sim_put_aside(sim);
  const msim_status status = ms_sim_make_motions(sim, left_out, err);
  if (status) {
    ms_sim_put_back(sim, &old);
    return status;
  }
  ms_sim_drop(sim, &old);
  ms_sim_choose_for(sim, NULL);
  sim->selection.out_of_date = 0;
  return MSIM_OK;
}

const ms_motion *ms_sim_largest(const msim_sim *sim) {
  const ms_motion *largest = sim->motion;
  for (int32_t i = 1; i < sim->nislands; i++)
    if (sim->motion[i].model.rows.nfree > largest->model.rows.nfree) largest = &sim->motion[i];
  return largest;
}
