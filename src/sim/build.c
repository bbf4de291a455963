/* build - create the model, the solver and the vectors of each island */
#include "contact/contact_log.h"
#include "contact/implicit_contact.h"
#include "integrate/multirate.h"
#include "layout/rank_order.h"
#include "layout/spring_values.h"
#include "physics/law_springs.h"
#include "physics/rank_model.h"
#include "physics/single.h"
#include "sim/breaking.h"
#include "sim/island_step.h"
#include "sim/rank_section.h"
#include "sim/reuse.h"
#include "sim/step_driver.h"

static msim_status allocate_vectors(msim_sim *sim, ms_island_sim *m, msim_error *err) {
  ms_stepper *s = &m->stepper;
  double **vectors[9 + MS_MAX_WORK] = {&s->x, &s->v, &s->x_next, &s->v_next, &s->scratch};
  int count = 5;
  const int constrains = sim->config.integrator->entry.implicit &&
                         ms_scene_constrains(sim->scene, sim->config.opt.collision);
  const int events = (constrains || sim->config.opt.collision == MSIM_COLLISION_EVENT) &&
                     m->model.features & MS_HAS_PLANES;
  const int of_contact =
      events && sim->config.integrator->entry.implicit ? MS_IMPLICIT_CONTACT_WORK : 0;
  const int of_substeps = ms_step_verification_work(sim);
  for (int i = 0; i < sim->config.integrator->nwork || i < of_contact || i < of_substeps; i++)
    vectors[count++] = &s->work[i];
  const int half_edges =
      ms_sim_has_control(sim) || ms_sim_selects(sim) || ms_island_step_count_retries(sim) > 1;
  const int spare = half_edges ? 2 : ms_island_step_count_retries(sim) > 0;
  for (int i = 0; i < spare; i++)
    vectors[count++] = &s->x_spare[i], vectors[count++] = &s->v_spare[i];
  if (!ms_unknowns_new_vectors(sim->scene, &m->model.unknowns, (size_t)count, vectors))
    return ms_error_set_memory(err, "the state");
  msim_status status = ms_energy_monitor_create(sim, &m->model, &m->last_good, err);
  if (!status && (ms_sim_has_control(sim) || ms_sim_selects(sim)))
    status = ms_norm_create(&m->model, &m->norm, err);
  if (!status) status = ms_step_verification_create(sim, &m->model, &m->verification, err);
  if (!status) status = ms_error_growth_create(sim, &m->model, &m->disturbance, err);
  if (!status && sim->config.opt.contacts && m->model.features & MS_HAS_PLANES) {
    s->contact_log = ms_contact_log_create(&m->model);
    if (!s->contact_log) status = ms_error_set_memory(err, "the contacts");
  }
  if (status) return status;
  if (ms_scene_has_self_contact(sim->scene))
    status = ms_self_contact_create(sim->config.integrator, &m->model, &m->self_contact, err);
  if (status) return status;
  return events ? ms_contact_set_create(&m->model, &s->events, err) : MSIM_OK;
}

/* Those of the scene, or the part of this rank as one, which is collective. order: lasts as long as
 * they do */
static msim_status create_islands(const msim_sim *sim, ms_rank_order *order, ms_islands *islands,
                                  msim_error *err) {
  const int whole = (sim->config.opt.skip_off & MSIM_SKIP_ISLANDS) != 0;
  if (!sim->part) return ms_islands_create(sim->scene, whole, islands, err);
  if (sim->kept) {
    ms_rank_scene_take_order(&sim->alloc, sim->kept, order);
    return ms_rank_part_create_island(sim->scene, sim->part, order, islands, err);
  }
  const msim_status status = ms_rank_order_create(sim->scene, sim->part, whole, order, err);
  return status ? status : ms_rank_part_create_island(sim->scene, sim->part, order, islands, err);
}

/* 1: there are islands whose models the new ones can share. */
static int has_like(const msim_sim *sim, int32_t left_out) {
  const ms_island_sims *like = sim->like;
  return like && like->n > 0 && like->islands->model.scene == sim->scene &&
         like->islands->model.unknowns.dropped_axis == left_out;
}

static msim_status create_models_like(msim_sim *sim, msim_error *err) {
  msim_status status = MSIM_OK;
  sim->islands = ms_memory_allocate(&sim->alloc, (size_t)sim->like->n, sizeof *sim->islands);
  if (!sim->islands) return ms_error_set_memory(err, "the islands");
  sim->nislands = sim->like->n;
  for (int32_t i = 0; i < sim->nislands && !status; i++)
    status = ms_model_create_like(&sim->like->islands[i].model, sim->config.opt.skip_off,
                                  &sim->islands[i].model, err);
  return status;
}

static msim_status divide_into_models(msim_sim *sim, int32_t left_out, msim_error *err) {
  ms_islands islands = {0};
  ms_rank_order order = {0};
  msim_status status = create_islands(sim, &order, &islands, err);
  if (status) {
    ms_rank_order_destroy(sim->scene, &order);
    return status;
  }
  sim->islands = ms_memory_allocate(&sim->alloc, (size_t)islands.n, sizeof *sim->islands);
  if (sim->islands) sim->nislands = islands.n;
  else status = ms_error_set_memory(err, "the islands");
  for (int32_t i = 0; i < islands.n && !status; i++) {
    const ms_island island = ms_islands_get(&islands, i);
    if (ms_reuse_island(sim, &island, left_out, &sim->islands[i])) continue;
    status = ms_model_create_island(sim->scene, &island, left_out, sim->config.opt.skip_off,
                                    &sim->islands[i].model, err);
  }
  ms_islands_destroy(sim->scene, &islands);
  if (sim->part && !status) ms_rank_part_keep_order(&sim->alloc, sim->part, &order);
  ms_rank_order_destroy(sim->scene, &order);
  return status;
}

static msim_status create_island_models(msim_sim *sim, int32_t left_out, msim_error *err) {
  msim_status status = has_like(sim, left_out) ? create_models_like(sim, err)
                                               : divide_into_models(sim, left_out, err);
  for (int32_t i = 0; i < sim->nislands && !status; i++) {
    ms_island_sim *m = &sim->islands[i];
    if (m->is_reused) continue;
    if (sim->config.opt.precision == MSIM_PRECISION_SINGLE)
      status = ms_single_create(&m->model, err);
    if (sim->config.choice.verification.planes_far) m->model.features &= ~(unsigned)MS_HAS_PLANES;
  }
  return status;
}

/* Threads are started once, when islands are built for the first time. */
static void start_threads(msim_sim *sim) {
  int64_t slots = 0;
  if (sim->threads_planned) return;
  for (int32_t i = 0; i < sim->nislands; i++)
    slots += sim->islands[i].model.half_edges.nentries + sim->islands[i].model.angles.n;
  sim->threads_planned = ms_plan_count_threads(&sim->config.opt, slots);
  sim->pool = ms_pool_create(&sim->alloc, sim->threads_planned);
}

/* All threads share the work of a large island. If there are at least two small islands per thread,
 * each thread steps small islands by itself, with explicit methods only: solvers may allocate, and
 * so stay in the caller's thread, as force functions do. */
static void assign_threads(msim_sim *sim) {
  enum { SMALL = 512 }; /* slices */
  int32_t nsmall = 0;
  start_threads(sim);
  for (int32_t i = 0; i < sim->nislands; i++)
    nsmall += sim->islands[i].model.half_edges.nslices < SMALL;
  sim->any_single_thread = sim->pool && !sim->config.integrator->entry.implicit &&
                           !ms_scene_has_function(sim->scene) &&
                           nsmall >= 2 * ms_pool_thread_count(sim->pool);
  for (int32_t i = 0; i < sim->nislands; i++) {
    ms_island_sim *m = &sim->islands[i];
    m->single_thread = sim->any_single_thread && m->model.half_edges.nslices < SMALL;
    m->model.pool = m->single_thread ? NULL : sim->pool;
  }
}

msim_status ms_sim_create_solver(msim_sim *sim, const ms_island_sim *m, double h,
                                 ms_solver **solver, msim_error *err) {
  msim_status status = ms_solver_create(&m->model, &sim->config.opt, h, &sim->stats, solver, err);
  const int is_nonlinear = sim->config.integrator->nonlinear;
  if (!status && (is_nonlinear || m->stepper.events)) /* whose steps may be of implicit Euler */
    status = ms_solver_prepare_descent(*solver, err);
  return status || !is_nonlinear ? status : ms_solver_create_unsymmetric(*solver, err);
}

static msim_status create_island_stepper(msim_sim *sim, ms_island_sim *m, msim_error *err) {
  ms_stepper *s = &m->stepper;
  if (m->is_reused) return MSIM_OK;
  s->model = &m->model;
  s->opt = &sim->config.opt;
  s->stats = m->single_thread ? &m->stats : &sim->stats;
  s->h = sim->run.h;
  ms_stepper_set_bounds(sim->config.integrator, s);
  msim_status status = allocate_vectors(sim, m, err);
  if (!status && sim->config.integrator->is_multirate)
    status = ms_multirate_create(&m->model, &sim->config.opt, s->h, &s->split, err);
  if (status || !sim->config.integrator->entry.implicit) return status;
  return ms_sim_create_solver(sim, m, sim->run.h, &s->solver, err);
}

/* Constraints and contact act on blocks: the matrix must not become scalar, identical for each
 * component. The derivatives of a force function are not kept: a lagged factor could not be
 * computed again. */
static void require_block_matrix(msim_sim *sim) {
  if (ms_scene_has_function(sim->scene)) sim->config.opt.skip_off |= MSIM_SKIP_KEPT_FACTOR;
  const int acts = ms_scene_constrains(sim->scene, sim->config.opt.collision) ||
                   ms_scene_has_self_contact(sim->scene);
  if (acts && sim->config.integrator->entry.implicit)
    sim->config.opt.skip_off |= MSIM_SKIP_ZERO_REST_LENGTH;
}

msim_status ms_sim_create_islands(msim_sim *sim, int32_t left_out, msim_error *err) {
  require_block_matrix(sim);
  msim_status status = create_island_models(sim, left_out, err);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status && sim->part) status = ms_rank_model_connect(&sim->islands->model, sim->part, err);
  if (!status) assign_threads(sim);
  for (int32_t i = 0; i < sim->nislands && !status; i++)
    status = create_island_stepper(sim, &sim->islands[i], err);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (status || !sim->part) return status;
  ms_island_sim *m = sim->islands;
  if (ms_sim_has_control(sim)) status = ms_norm_connect(&m->model, &m->norm, err);
  if (!status && m->stepper.events) ms_contact_set_connect(&m->model, m->stepper.events);
  return status || !m->stepper.solver ? status : ms_solver_connect(m->stepper.solver, err);
}

/* Leaves the model. */
static void destroy_state(const msim_allocator *alloc, ms_island_sim *m) {
  ms_stepper *s = &m->stepper;
  ms_solver_destroy(s->solver);
  ms_multirate_destroy(&m->model, s->split);
  ms_contact_set_destroy(&m->model, s->events);
  ms_contact_log_destroy(&m->model, s->contact_log);
  ms_self_contact_destroy(&m->model, m->self_contact);
  ms_energy_monitor_destroy(&m->model, &m->last_good);
  ms_norm_destroy(&m->model, &m->norm);
  ms_error_growth_destroy(&m->model, &m->disturbance);
  ms_step_verification_destroy(&m->model, &m->verification);
  MS_FREE(alloc, s->x, s->v, s->x_next, s->v_next, s->scratch, s->x_spare[0], s->x_spare[1],
          s->v_spare[0], s->v_spare[1]);
  for (int k = 0; k < MS_MAX_WORK; k++) ms_memory_free(alloc, s->work[k]);
  *m = (ms_island_sim){.model = m->model};
}

static void destroy_islands(const msim_allocator *alloc, ms_island_sim *motion, int32_t nislands) {
  for (ms_island_sim *m = motion; m < motion + nislands; m++) {
    if (m->is_reused) continue;
    destroy_state(alloc, m);
    ms_model_destroy(&m->model);
  }
  ms_memory_free(alloc, motion);
}

void ms_sim_destroy_islands(msim_sim *sim) {
  destroy_islands(&sim->alloc, sim->islands, sim->nislands);
}

ms_island_sims ms_sim_detach_islands(msim_sim *sim) {
  const ms_island_sims old = {sim->nislands, sim->islands, sim->any_single_thread};
  sim->islands = NULL, sim->nislands = 0;
  return old;
}

void ms_sim_take_models(msim_sim *sim, msim_sim *from) {
  for (int32_t i = 0; i < from->nislands; i++) destroy_state(&from->alloc, &from->islands[i]);
  sim->islands = from->islands, sim->nislands = from->nislands;
  from->islands = NULL, from->nislands = 0;
}

void ms_sim_destroy_detached(msim_sim *sim, const ms_island_sims *old) {
  destroy_islands(&sim->alloc, old->islands, old->n);
}

void ms_sim_restore_islands(msim_sim *sim, const ms_island_sims *old) {
  ms_sim_destroy_islands(sim);
  sim->nislands = old->n, sim->islands = old->islands, sim->any_single_thread = old->any_by_one;
}

void ms_sim_set_solver_scene(msim_sim *sim, ms_scene *scene) {
  ms_scene_release(sim->chosen_for);
  sim->chosen_for = scene;
}

msim_status ms_sim_build_islands(msim_sim *sim, int32_t left_out, msim_error *err) {
  const ms_island_sims old = ms_sim_detach_islands(sim);
  if (sim->reuse) sim->reuse->old = &old;
  if (ms_sim_selects(sim)) sim->like = &old; /* else components or springs have changed */
  const msim_status status = ms_sim_create_islands(sim, left_out, err);
  sim->like = NULL;
  if (status) {
    ms_sim_restore_islands(sim, &old);
    return status;
  }
  if (sim->reuse) ms_reuse_finish(sim);
  ms_rank_section_destroy(sim); /* its unknowns may be others now */
  ms_breaking_set_before(sim->scene);
  ms_sim_destroy_detached(sim, &old);
  ms_sim_set_solver_scene(sim, NULL);
  sim->config.choice.out_of_date = 0;
  return MSIM_OK;
}

msim_status ms_sim_replace_forces(msim_sim *sim, ms_scene *scene, msim_error *err) {
  ms_scene *before = sim->scene;
  msim_status status = MSIM_OK;
  int32_t i = 0;
  sim->scene = scene;
  for (; i < sim->nislands && !status; i++) {
    ms_model *model = &sim->islands[i].model;
    model->scene = scene;
    if (model->laws) ms_law_springs_update(model);
    status = ms_model_update_forces(model, sim->config.opt.skip_off, err);
  }
  if (!status) return MSIM_OK;
  ms_sim_replace_forces(sim, before, NULL); /* has no forces, and so needs no memory */
  return status;
}

void ms_sim_set_created_scene(msim_sim *sim, ms_scene *before) {
  if ((sim->created_from || sim->edited_from) && before) return;
  ms_scene_release(sim->created_from);
  sim->created_from = before ? ms_scene_retain(before) : NULL;
}

void ms_sim_set_edited_from(msim_sim *sim, ms_scene *before) {
  ms_scene_release(sim->edited_from);
  sim->edited_from = before;
}

msim_status ms_sim_reserve_springs(msim_sim *sim, msim_error *err) {
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < sim->nislands && !status; i++) {
    ms_model *m = &sim->islands[i].model;
    status = ms_spring_values_reserve(sim->scene, &m->springs, &m->half_edges, err);
    if (!status) status = ms_single_reserve_springs(m, err);
  }
  return status;
}

void ms_sim_replace_scene(msim_sim *sim, ms_scene *scene) {
  sim->scene = scene;
  sim->scene_is_hashed = 0;
  for (int32_t i = 0; i < sim->nislands; i++) {
    sim->islands[i].model.scene = scene;
    ms_model_update_springs(&sim->islands[i].model, sim->config.opt.skip_off);
  }
}

void ms_sim_set_bounds(msim_sim *sim) {
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    ms_stepper_set_bounds(sim->config.integrator, &m->stepper);
}
