/* state - read and set the state of a sim, its energies and forces */
#include <math.h>
#include <string.h>

#include "integrate/interpolate.h"
#include "layout/flat.h"
#include "physics/energy.h"
#include "physics/plain.h"
#include "sim/drive.h"

/* Interpolate inside the last step, in an island that is not at rest. */
static void refresh_within(msim_sim *sim, ms_motion *m) {
  ms_stepper *s = &m->stepper;
  const double theta = 1 - (sim->t - sim->t_shown) / s->h;
  ms_interpolate(sim->integrator, s, theta, s->x_spare[0], s->v_spare[0]);
  ms_rows_scatter(&m->model.rows, s->x_spare[0], sim->flat_x);
  ms_rows_scatter(&m->model.rows, s->v_spare[0], sim->flat_v);
}

static void refresh_island(msim_sim *sim, ms_motion *m) {
  const ms_stepper *s = &m->stepper;
  const ms_rows *rows = &m->model.rows;
  if (ms_sim_has_control(sim) && sim->t_shown != sim->t && !m->at_rest) {
    refresh_within(sim, m);
    return;
  }
  if (sim->integrator->show) {
    sim->integrator->show(s, s->x_next, s->v_next); /* free between steps */
    ms_rows_scatter(rows, s->x_next, sim->flat_x);
    ms_rows_scatter(rows, s->v_next, sim->flat_v);
    return;
  }
  ms_rows_scatter(rows, s->x, sim->flat_x);
  if (sim->integrator->sync) {
    ms_rows_scatter(rows, s->v, sim->flat_v_half);
    double *v = s->v_next; /* free between steps */
    sim->integrator->sync(s, v, s->scratch);
    ms_rows_scatter(rows, v, sim->flat_v);
  } else {
    ms_rows_scatter(rows, s->v, sim->flat_v);
  }
}

/* Copy the state to the arrays in particle order, at most once per step, and only on demand. */
static void refresh(msim_sim *sim) {
  for (int32_t i = 0; i < sim->nislands && !sim->flat_is_current; i++)
    refresh_island(sim, &sim->motion[i]);
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
                     .v_half = sim->integrator->sync ? sim->flat_v_half : NULL,
                     .h = sim->plan.h};
  MS_GIVE(state, full);
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

/* A state outside the scene's plane needs three components. A split of the springs belongs to h. */
static msim_status fit_state(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_scene *scene = sim->scene;
  int32_t flat = ms_flat_axis(scene, sim->opt.skip_off);
  if (flat >= 0 && !(ms_is_level(scene, flat, state->x, state->v) &&
                     (!state->v_half || ms_is_level(scene, flat, state->x, state->v_half))))
    flat = -1;
  const int split_fits = !sim->integrator->splits || sim->motion->stepper.h == sim->plan.h;
  const int fits = split_fits && !sim->selection.out_of_date;
  if (flat == sim->motion->model.rows.left_out && fits) return MSIM_OK;
  return ms_sim_build(sim, flat, err);
}

static void start_island(msim_sim *sim, ms_motion *m, const msim_state *state) {
  ms_stepper *s = &m->stepper;
  const ms_rows *rows = &m->model.rows;
  ms_rows_gather(rows, state->x, s->x);
  ms_rows_gather(rows, state->x, s->x_next); /* for the pinned particles */
  for (int i = 0; i < 2; i++)
    if (s->x_spare[i]) ms_rows_gather(rows, state->x, s->x_spare[i]);
  ms_rows_gather(rows, state->v, s->v);
  m->at_rest = 0;
  if (ms_sim_has_control(sim) || ms_sim_selects(sim))
    ms_norm_measure(&m->model, s->x, s->v, ms_plan_span(&sim->plan), &m->norm);
  ms_sensitivity_start_island(m);
  s->h = sim->plan.h;
  s->warm = 0;
  if (s->solver) ms_solver_restart(s->solver);
  if (sim->integrator->start) sim->integrator->start(s);
  if (sim->integrator->sync && state->v_half && state->h == sim->plan.h) {
    ms_rows_gather(rows, state->v_half, s->v);
    s->warm = 0;
  }
}

void ms_sim_start_islands(msim_sim *sim, const msim_state *state) {
  for (int32_t i = 0; i < sim->nislands; i++) start_island(sim, &sim->motion[i], state);
}

msim_status ms_sim_rebuild(msim_sim *sim, msim_error *err) {
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  msim_status status = ms_sim_build(sim, sim->motion->model.rows.left_out, err);
  if (!status) ms_sim_start_islands(sim, &now);
  return status;
}

msim_status ms_sim_start(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_plan before = sim->plan;
  msim_status status = ms_sim_make_plan(sim, state->t, state->x, state->v, err);
  if (!status) status = fit_state(sim, state, err);
  if (status) {
    sim->plan = before;
    return status;
  }
  const size_t flat = 3 * (size_t)state->n * sizeof(double);
  sim->step = sim->step0 = state->step;
  sim->t0 = state->t;
  if (ms_sim_has_control(sim)) ms_drive_start(sim);
  memmove(sim->flat_x, state->x, flat);
  memmove(sim->flat_v, state->v, flat);
  ms_sim_start_islands(sim, state);
  if (sim->integrator->sync) {
    memcpy(sim->flat_v_half, sim->flat_v, flat); /* 0 along an axis left out */
    for (int32_t i = 0; i < sim->nislands; i++)
      ms_rows_scatter(&sim->motion[i].model.rows, sim->motion[i].stepper.v, sim->flat_v_half);
  }
  sim->flat_is_current = 1;
  ms_watch_start(sim);
  ms_verify_start(sim);
  ms_sensitivity_start(sim);
  ms_sim_watch_step(sim);
  return ms_ok(err);
}

/* Start a run by a method chosen for that state; on failure the old method stays. */
static msim_status start_anew(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_selection selection = sim->selection;
  const ms_advice advice = sim->advice;
  const ms_integrator *integrator = sim->integrator;
  const msim_options opt = sim->opt;
  msim_status status = ms_sim_select(sim, 0, state->t, state->x, state->v, err);
  if (!status) status = ms_sim_start(sim, state, err);
  if (!status) return MSIM_OK;
  sim->selection = selection, sim->advice = advice, sim->integrator = integrator, sim->opt = opt;
  return status;
}

msim_status msim_sim_set_state(msim_sim *sim, const msim_state *state, msim_error *err) {
  if (!sim || !state) return ms_fail(err, MSIM_ERR_ARG, "sim or state is NULL");
  msim_status status = check_state(sim, state, err);
  if (status) return status;
  return ms_sim_selects(sim) ? start_anew(sim, state, err) : ms_sim_start(sim, state, err);
}

/* Choose a method for impacts. The grid of steps and frames stays: its step is divided. */
static msim_status choose_for_planes(msim_sim *sim, const msim_state *now, msim_error *err) {
  msim_status status = ms_sim_select(sim, 1, now->t, now->x, now->v, err);
  if (status) return status;
  sim->selection.parts = (int64_t)fmax(1, ceil(sim->plan.h / sim->opt.h - 1e-9));
  sim->opt.h = sim->plan.h;
  return MSIM_OK;
}

msim_status ms_sim_meet_planes(msim_sim *sim, msim_error *err) {
  const ms_selection selection = sim->selection;
  const ms_advice advice = sim->advice;
  const ms_integrator *integrator = sim->integrator;
  const msim_options opt = sim->opt;
  msim_state now = {.size = sizeof now};
  msim_status status = MSIM_OK;
  msim_sim_state(sim, &now);
  sim->selection.verification.away = 0;
  if (ms_sim_has_control(sim)) ms_control_forget(&sim->control);
  else status = choose_for_planes(sim, &now, err);
  if (!status) status = ms_sim_build(sim, sim->motion->model.rows.left_out, err);
  if (!status) {
    now.v_half = NULL;
    ms_sim_start_islands(sim, &now);
    ms_watch_start(sim);
    return MSIM_OK;
  }
  sim->selection = selection, sim->advice = advice, sim->integrator = integrator, sim->opt = opt;
  return status;
}

void msim_sim_energy(msim_sim *sim, msim_energy *energy) {
  refresh(sim);
  msim_energy full = {.size = energy->size};
  ms_energy(sim->scene, sim->flat_x, sim->flat_v, &full);
  MS_GIVE(energy, full);
}

void msim_sim_stats(const msim_sim *sim, msim_stats *stats) {
  msim_stats full = sim->stats;
  full.size = stats->size;
  MS_GIVE(stats, full);
}

void msim_sim_plan(const msim_sim *sim, msim_plan *plan) {
  const ms_solver *linear = ms_sim_largest(sim)->stepper.solver;
  msim_plan full = {.size = plan->size,
                    .h = sim->plan.h,
                    .steps = sim->plan.steps,
                    .integrator = sim->integrator->entry.name,
                    .solver = linear ? linear->linear->name : "none",
                    .threads = ms_pool_threads(sim->pool),
                    .tol = sim->opt.tol,
                    .t_end = sim->plan.t_end};
  MS_GIVE(plan, full);
}

static void put_island_force(const ms_motion *m, const double *x, const double *v, double *force) {
  const ms_stepper *s = &m->stepper;
  const ms_rows *rows = &m->model.rows;
  double *x_there = s->x_spare[0] ? s->x_spare[0] : s->x_next; /* dense output needs x_next */
  double *v_there = s->v_spare[0] ? s->v_spare[0] : s->v_next;
  ms_rows_gather(rows, x, x_there);
  ms_rows_gather(rows, v, v_there);
  ms_force(&m->model, x_there, v_there, s->scratch);
  ms_rows_scatter(rows, s->scratch, force);
  /* restore the pinned particles, as steps expect them */
  const size_t bytes = (size_t)rows->dims * (size_t)rows->stride * sizeof *x;
  memcpy(x_there, s->x, bytes);
  memset(v_there, 0, bytes);
}

void msim_sim_force(msim_sim *sim, const double *x, const double *v, double *force) {
  const ms_scene *scene = sim->scene;
  const int32_t left_out = sim->motion->model.rows.left_out;
  if (left_out >= 0 && !ms_is_level(scene, left_out, x, v)) {
    ms_plain_force(scene, x, v, force);
    return;
  }
  memset(force, 0, 3 * (size_t)scene->nparticles * sizeof *force);
  for (int32_t i = 0; i < sim->nislands; i++) put_island_force(&sim->motion[i], x, v, force);
  for (int32_t p = 0; p < scene->nparticles; p++)
    if (scene->pinned[p]) memset(force + 3 * (size_t)p, 0, 3 * sizeof *force);
}
