/* state - read and set the state of a sim, its energies and forces */
#include <math.h>
#include <string.h>

#include "integrate/interpolate.h"
#include "layout/planar.h"
#include "physics/energy.h"
#include "physics/reference.h"
#include "sim/step_driver.h"

/* Interpolate inside the last step, in an island that is not at rest. */
static void interpolate_island(msim_sim *sim, ms_island_sim *m) {
  ms_stepper *s = &m->stepper;
  const double theta = 1 - (sim->t - sim->t_shown) / s->h;
  ms_interpolate(sim->integrator, s, theta, s->x_spare[0], s->v_spare[0]);
  ms_unknowns_scatter(&m->model.unknowns, s->x_spare[0], sim->state_x);
  ms_unknowns_scatter(&m->model.unknowns, s->v_spare[0], sim->state_v);
}

static void copy_island_state(msim_sim *sim, ms_island_sim *m) {
  const ms_stepper *s = &m->stepper;
  const ms_unknowns *rows = &m->model.unknowns;
  if (ms_sim_has_control(sim) && sim->t_shown != sim->t && !m->at_rest) {
    interpolate_island(sim, m);
    return;
  }
  if (sim->integrator->convert_state) {
    sim->integrator->convert_state(s, s->x_next, s->v_next); /* free between steps */
    ms_unknowns_scatter(rows, s->x_next, sim->state_x);
    ms_unknowns_scatter(rows, s->v_next, sim->state_v);
    return;
  }
  ms_unknowns_scatter(rows, s->x, sim->state_x);
  if (sim->integrator->sync) {
    ms_unknowns_scatter(rows, s->v, sim->state_v_half);
    double *v = s->v_next; /* free between steps */
    sim->integrator->sync(s, v, s->scratch);
    ms_unknowns_scatter(rows, v, sim->state_v);
  } else {
    ms_unknowns_scatter(rows, s->v, sim->state_v);
  }
}

/* Copy the state to the arrays in particle order, at most once per step, and only on demand. */
static void update_state_arrays(msim_sim *sim) {
  for (int32_t i = 0; i < sim->nislands && !sim->state_is_current; i++)
    copy_island_state(sim, &sim->islands[i]);
  sim->state_is_current = 1;
}

void msim_sim_state(msim_sim *sim, msim_state *state) {
  update_state_arrays(sim);
  msim_state full = {.size = state->size,
                     .step = sim->step,
                     .t = ms_sim_time(sim),
                     .n = sim->scene->nparticles,
                     .x = sim->state_x,
                     .v = sim->state_v,
                     .v_half = sim->integrator->sync ? sim->state_v_half : NULL,
                     .h = sim->plan.h};
  MS_COPY_SIZED(state, full);
}

static msim_status check_state(const msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_scene *scene = sim->scene;
  if (state->n != scene->nparticles)
    return ms_error_set(err, MSIM_ERR_ARG, "the state has %d particles, the scene %d", state->n,
                        scene->nparticles);
  if (!state->x || !state->v) return ms_error_set(err, MSIM_ERR_ARG, "the state has no x or no v");
  if (!isfinite(state->t) || state->step < 0)
    return ms_error_set(err, MSIM_ERR_ARG, "the state's t must be finite and its step >= 0");
  for (size_t i = 0; i < 3 * (size_t)state->n; i++) {
    int pinned = scene->pinned[i / 3];
    if (!(fabs(state->x[i]) <= MS_LARGEST_VALID && fabs(state->v[i]) <= MS_LARGEST_VALID) ||
        (state->v_half && !(fabs(state->v_half[i]) <= MS_LARGEST_VALID)))
      return ms_error_set(err, MSIM_ERR_ARG, "particle %zu of the state is not finite", i / 3);
    if (pinned && (state->x[i] != scene->x[i] || state->v[i] != 0))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "particle %zu is pinned: it must stay in its place, at rest", i / 3);
  }
  return MSIM_OK;
}

/* A state outside the scene's plane needs three components. A split of the springs belongs to h. */
static msim_status fit_components(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_scene *scene = sim->scene;
  int32_t flat = ms_planar_find_axis(scene, sim->opt.skip_off);
  if (flat >= 0 &&
      !(ms_planar_is_in_plane(scene, flat, state->x, state->v) &&
        (!state->v_half || ms_planar_is_in_plane(scene, flat, state->x, state->v_half))))
    flat = -1;
  const int split_fits = !sim->integrator->is_multirate || sim->islands->stepper.h == sim->plan.h;
  const int fits = split_fits && !sim->choice.out_of_date;
  if (flat == sim->islands->model.unknowns.dropped_axis && fits) return MSIM_OK;
  return ms_sim_build_islands(sim, flat, err);
}

static void start_island(msim_sim *sim, ms_island_sim *m, const msim_state *state) {
  ms_stepper *s = &m->stepper;
  const ms_unknowns *rows = &m->model.unknowns;
  ms_unknowns_gather(rows, state->x, s->x);
  ms_unknowns_gather(rows, state->x, s->x_next); /* for the pinned particles */
  for (int i = 0; i < 2; i++)
    if (s->x_spare[i]) ms_unknowns_gather(rows, state->x, s->x_spare[i]);
  ms_unknowns_gather(rows, state->v, s->v);
  m->at_rest = 0;
  if (ms_sim_has_control(sim) || ms_sim_selects(sim))
    ms_norm_measure_scales(&m->model, s->x, s->v, ms_plan_span(&sim->plan), &m->norm);
  ms_error_growth_start_island(m);
  s->h = sim->plan.h;
  s->cached_stage = 0;
  if (s->solver) ms_solver_discard_factors(s->solver);
  if (sim->integrator->start) sim->integrator->start(s);
  if (sim->integrator->sync && state->v_half && state->h == sim->plan.h) {
    ms_unknowns_gather(rows, state->v_half, s->v);
    s->cached_stage = 0;
  }
}

void ms_sim_start_islands(msim_sim *sim, const msim_state *state) {
  for (int32_t i = 0; i < sim->nislands; i++) start_island(sim, &sim->islands[i], state);
}

msim_status ms_sim_rebuild_islands(msim_sim *sim, msim_error *err) {
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  msim_status status = ms_sim_build_islands(sim, sim->islands->model.unknowns.dropped_axis, err);
  if (!status) ms_sim_start_islands(sim, &now);
  return status;
}

msim_status ms_sim_start(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_plan before = sim->plan;
  msim_status status = ms_sim_make_plan(sim, state->t, state->x, state->v, err);
  if (!status) status = fit_components(sim, state, err);
  if (status) {
    sim->plan = before;
    return status;
  }
  const size_t flat = 3 * (size_t)state->n * sizeof(double);
  sim->step = sim->step0 = state->step;
  sim->t0 = state->t;
  if (ms_sim_has_control(sim)) ms_step_driver_start_control(sim);
  memmove(sim->state_x, state->x, flat);
  memmove(sim->state_v, state->v, flat);
  ms_sim_start_islands(sim, state);
  if (sim->integrator->sync) {
    memcpy(sim->state_v_half, sim->state_v, flat); /* 0 along an axis left out */
    for (int32_t i = 0; i < sim->nislands; i++)
      ms_unknowns_scatter(&sim->islands[i].model.unknowns, sim->islands[i].stepper.v,
                          sim->state_v_half);
  }
  sim->state_is_current = 1;
  ms_energy_monitor_start(sim);
  ms_step_verification_start(sim);
  ms_error_growth_start(sim);
  ms_step_limit_warn(sim);
  return ms_error_clear(err);
}

/* Start a run by a method chosen for that state; on failure the old method stays. */
static msim_status restart_with_choice(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_method_choice selection = sim->choice;
  const ms_step_limit advice = sim->step_limit;
  const ms_integrator *integrator = sim->integrator;
  const msim_options opt = sim->opt;
  msim_status status = ms_method_choice_make(sim, 0, state->t, state->x, state->v, err);
  if (!status) status = ms_sim_start(sim, state, err);
  if (!status) return MSIM_OK;
  sim->choice = selection, sim->step_limit = advice, sim->integrator = integrator, sim->opt = opt;
  return status;
}

msim_status msim_sim_set_state(msim_sim *sim, const msim_state *state, msim_error *err) {
  if (!sim || !state) return ms_error_set(err, MSIM_ERR_ARG, "sim or state is NULL");
  msim_status status = check_state(sim, state, err);
  if (status) return status;
  return ms_sim_selects(sim) ? restart_with_choice(sim, state, err) : ms_sim_start(sim, state, err);
}

/* Choose a method for impacts. The grid of steps and frames stays: its step is divided. */
static msim_status choose_for_planes(msim_sim *sim, const msim_state *now, msim_error *err) {
  msim_status status = ms_method_choice_make(sim, 1, now->t, now->x, now->v, err);
  if (status) return status;
  sim->choice.substeps = (int64_t)fmax(1, ceil(sim->plan.h / sim->opt.h - 1e-9));
  sim->opt.h = sim->plan.h;
  return MSIM_OK;
}

msim_status ms_sim_enable_planes(msim_sim *sim, msim_error *err) {
  const ms_method_choice selection = sim->choice;
  const ms_step_limit advice = sim->step_limit;
  const ms_integrator *integrator = sim->integrator;
  const msim_options opt = sim->opt;
  msim_state now = {.size = sizeof now};
  msim_status status = MSIM_OK;
  msim_sim_state(sim, &now);
  sim->choice.verification.planes_far = 0;
  if (ms_sim_has_control(sim)) ms_control_reset(&sim->control);
  else status = choose_for_planes(sim, &now, err);
  if (!status) status = ms_sim_build_islands(sim, sim->islands->model.unknowns.dropped_axis, err);
  if (!status) {
    now.v_half = NULL;
    ms_sim_start_islands(sim, &now);
    ms_energy_monitor_start(sim);
    return MSIM_OK;
  }
  sim->choice = selection, sim->step_limit = advice, sim->integrator = integrator, sim->opt = opt;
  return status;
}

void msim_sim_energy(msim_sim *sim, msim_energy *energy) {
  update_state_arrays(sim);
  msim_energy full = {.size = energy->size};
  ms_energy_compute(sim->scene, sim->state_x, sim->state_v, &full);
  MS_COPY_SIZED(energy, full);
}

void msim_sim_stats(const msim_sim *sim, msim_stats *stats) {
  msim_stats full = sim->stats;
  full.size = stats->size;
  MS_COPY_SIZED(stats, full);
}

void msim_sim_plan(const msim_sim *sim, msim_plan *plan) {
  const ms_solver *linear = ms_sim_largest_island(sim)->stepper.solver;
  msim_plan full = {.size = plan->size,
                    .h = sim->plan.h,
                    .steps = sim->plan.steps,
                    .integrator = sim->integrator->entry.name,
                    .solver = linear ? linear->linear->name : "none",
                    .threads = ms_pool_thread_count(sim->pool),
                    .tol = sim->opt.tol,
                    .t_end = sim->plan.t_end};
  MS_COPY_SIZED(plan, full);
}

static void add_island_force(const ms_island_sim *m, const double *x, const double *v,
                             double *force) {
  const ms_stepper *s = &m->stepper;
  const ms_unknowns *rows = &m->model.unknowns;
  double *x_there = s->x_spare[0] ? s->x_spare[0] : s->x_next; /* dense output needs x_next */
  double *v_there = s->v_spare[0] ? s->v_spare[0] : s->v_next;
  ms_unknowns_gather(rows, x, x_there);
  ms_unknowns_gather(rows, v, v_there);
  ms_force_compute(&m->model, x_there, v_there, s->scratch);
  ms_unknowns_scatter(rows, s->scratch, force);
  /* restore the pinned particles, as steps expect them */
  const size_t bytes = (size_t)rows->dims * (size_t)rows->stride * sizeof *x;
  memcpy(x_there, s->x, bytes);
  memset(v_there, 0, bytes);
}

void msim_sim_force(msim_sim *sim, const double *x, const double *v, double *force) {
  const ms_scene *scene = sim->scene;
  const int32_t left_out = sim->islands->model.unknowns.dropped_axis;
  if (left_out >= 0 && !ms_planar_is_in_plane(scene, left_out, x, v)) {
    ms_reference_compute_force(scene, x, v, force);
    return;
  }
  memset(force, 0, 3 * (size_t)scene->nparticles * sizeof *force);
  for (int32_t i = 0; i < sim->nislands; i++) add_island_force(&sim->islands[i], x, v, force);
  for (int32_t p = 0; p < scene->nparticles; p++)
    if (scene->pinned[p]) memset(force + 3 * (size_t)p, 0, 3 * sizeof *force);
}
