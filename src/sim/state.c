/* state - plan a run and start it from a state */
#include <math.h>
#include <string.h>

#include "contact/contact_set.h"
#include "layout/planar.h"
#include "physics/moving_pins.h"
#include "physics/single.h"
#include "sim/precision_check.h"
#include "sim/rank_scene.h"
#include "sim/step_driver.h"

msim_status ms_sim_check_state(const msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_scene *scene = sim->scene;
  if (state->n != scene->nparticles)
    return ms_error_set(err, MSIM_ERR_ARG, "the state has %d particles, but the scene has %d",
                        state->n, scene->nparticles);
  if (!state->x || !state->v) return ms_error_set(err, MSIM_ERR_ARG, "the state has no x or no v");
  if (!isfinite(state->t) || state->step < 0)
    return ms_error_set(err, MSIM_ERR_ARG, "the state's t must be finite and its step >= 0");
  if (!isfinite(state->work))
    return ms_error_set(err, MSIM_ERR_ARG, "the state's work is %g; it must be finite",
                        state->work);
  for (size_t i = 0; i < 3 * (size_t)state->n; i++) {
    int pinned = scene->pinned[i / 3];
    if (!(fabs(state->x[i]) <= MS_LARGEST_VALID && fabs(state->v[i]) <= MS_LARGEST_VALID) ||
        (state->v_half && !(fabs(state->v_half[i]) <= MS_LARGEST_VALID)))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "x, v or v_half of particle %zu is not finite, or too large", i / 3);
    if (pinned && (state->x[i] != scene->x[i] || state->v[i] != 0) &&
        !ms_scene_has_motion(scene, (int32_t)(i / 3)))
      return ms_error_set(
          err, MSIM_ERR_ARG,
          "particle %zu is pinned: its x must be that of the scene, and its v must be 0", i / 3);
  }
  return MSIM_OK;
}

/*------------------------------------- start ----------------------------------------------------*/

/* A state outside the scene's plane needs three components. A split of the springs belongs to h. */
static msim_status fit_components(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_scene *scene = sim->scene;
  int32_t axis = ms_planar_find_axis(scene, sim->config.opt.skip_off);
  if (axis >= 0 &&
      !(ms_planar_is_in_plane(scene, axis, state->x, state->v) &&
        (!state->v_half || ms_planar_is_in_plane(scene, axis, state->x, state->v_half))))
    axis = -1;
  const int split_fits =
      !sim->config.integrator->is_multirate || sim->islands->stepper.h == sim->run.h;
  const int fits = split_fits && !sim->config.choice.out_of_date;
  if (axis == sim->islands->model.unknowns.dropped_axis && fits) return MSIM_OK;
  return ms_sim_build_islands(sim, axis, err);
}

static void start_island(msim_sim *sim, ms_island_sim *m, const msim_state *state) {
  ms_stepper *s = &m->stepper;
  ms_single_set_origin(&m->model, state->x);
  ms_single_gather_x(&m->model, state->x, s->x);
  ms_single_gather_x(&m->model, state->x, s->x_next); /* for the pinned particles */
  for (int i = 0; i < 2; i++)
    if (s->x_spare[i]) ms_single_gather_x(&m->model, state->x, s->x_spare[i]);
  ms_single_gather_v(&m->model, state->v, s->v);
  s->t = sim->config.plan.t0, s->c = 0;
  if (m->model.pins) ms_moving_pins_set(&m->model, (ms_instant){.t = s->t}, s->x, s->v);
  m->at_rest = 0;
  if (ms_sim_has_control(sim) || ms_sim_selects(sim))
    ms_norm_measure_scales(&m->model, ms_single_get_x(&m->model, s->x),
                           ms_single_get_v(&m->model, s->v), ms_plan_span(&sim->config.plan),
                           &m->norm);
  ms_error_growth_start_island(m);
  s->h = sim->run.h;
  s->cached_stage = 0;
  ms_contact_set_forget(s->events);
  if (s->solver) ms_solver_discard_factors(s->solver);
  if (sim->config.integrator->start) sim->config.integrator->start(s);
  if (sim->config.integrator->sync && state->v_half && state->h == sim->run.h) {
    ms_single_gather_v(&m->model, state->v_half, s->v);
    s->cached_stage = 0;
  }
}

void ms_sim_start_islands(msim_sim *sim, const msim_state *state) {
  sim->contacts_known = 0;
  for (int32_t i = 0; i < sim->nislands; i++) start_island(sim, &sim->islands[i], state);
}

void ms_sim_switch_method(msim_sim *sim, const ms_integrator *method, double h) {
  sim->config.integrator = method;
  sim->run.h = h;
  for (int32_t i = 0; i < sim->nislands; i++) {
    ms_stepper *s = &sim->islands[i].stepper;
    s->h = h;
    ms_stepper_set_bounds(method, s);
    if (method->start) method->start(s);
  }
}

msim_status ms_sim_rebuild_islands(msim_sim *sim, msim_error *err) {
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  msim_status status = ms_sim_build_islands(sim, sim->islands->model.unknowns.dropped_axis, err);
  if (!status) ms_sim_start_islands(sim, &now);
  return status;
}

/* Warn that the plan has lowered the given h, once for each h. */
static void warn_lowered_step(const msim_sim *sim, const ms_plan *plan) {
  if (sim->config.step_limit.from_auto || ms_sim_selects(sim)) return;
  if (plan->h == plan->h_asked || plan->h == sim->config.plan.h) return;
  ms_sim_warn(sim, "h is lowered from %g to %.17g s, so that %lld steps end at t_end = %g",
              plan->h_asked, plan->h, (long long)plan->steps, sim->config.opt.t_end);
}

typedef struct run_scales {
  double span;
  ms_scales scales;
} run_scales;

static msim_status compute_scales(const ms_scene *scene, void *data, msim_error *err) {
  run_scales *of = data;
  return ms_scales_compute(scene, scene->x, scene->v, of->span, &of->scales, err);
}

static msim_status find_first_step(const msim_sim *sim, const double *x, const double *v,
                                   ms_plan *plan, msim_error *err) {
  const ms_control control =
      ms_control_make(sim->config.integrator, sim->config.opt.tol, ms_plan_span(plan));
  run_scales of = {.span = control.span};
  if (plan->h > 0) return MSIM_OK;
  const msim_status status = sim->kept
                                 ? ms_rank_scene_compute(sim, compute_scales, sizeof of, &of, err)
                                 : ms_scales_compute(sim->scene, x, v, of.span, &of.scales, err);
  if (!status) plan->h = plan->h_asked = ms_control_first_step(&control, &of.scales);
  return status;
}

msim_status ms_sim_make_plan(msim_sim *sim, double t0, const double *x, const double *v,
                             msim_error *err) {
  ms_plan plan;
  msim_status status = ms_plan_create(&sim->config.opt, t0, &plan, err);
  if (!status && ms_sim_has_control(sim)) status = find_first_step(sim, x, v, &plan, err);
  if (status) return status;
  warn_lowered_step(sim, &plan);
  sim->config.plan = plan;
  sim->run.h = plan.h;
  return MSIM_OK;
}

void ms_sim_subtract_steps_made(msim_sim *sim) {
  int64_t *steps = &sim->config.opt.steps, made = sim->run.step - sim->run.step0;
  if (*steps < 0) return;
  if (made > *steps) made = *steps;
  sim->run.spent += made;
  *steps -= made;
}

static void set_arrays(msim_sim *sim, const msim_state *state) {
  const size_t bytes = 3 * (size_t)state->n * sizeof(double);
  if (!sim->state_x) return;
  memmove(sim->state_x, state->x, bytes);
  memmove(sim->state_v, state->v, bytes);
}

/* Ranks that have parts start in the state for which they were planned and built. */
msim_status ms_sim_start(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_plan plan = sim->config.plan;
  const ms_run_state run = sim->run;
  msim_status status = ms_precision_check(sim, err);
  if (!status && state->x != sim->scene->x) status = ms_sim_provide_arrays(sim, err);
  if (!status && !sim->kept) status = ms_sim_make_plan(sim, state->t, state->x, state->v, err);
  if (!status && !sim->kept) status = fit_components(sim, state, err);
  if (!status && sim->islands->self_contact)
    status = ms_self_contact_check(sim->islands->self_contact, state->n, state->x, err);
  if (status) {
    sim->config.plan = plan, sim->run = run;
    return status;
  }
  sim->run.step = sim->run.step0 = state->step;
  sim->run.work = state->work;
  if (ms_sim_has_control(sim)) ms_step_driver_start_control(sim);
  set_arrays(sim, state);
  ms_sim_start_islands(sim, state);
  ms_sim_start_v_half(sim);
  sim->state_is_current = 1;
  ms_sim_start_pins(sim);
  ms_energy_monitor_start(sim);
  ms_step_verification_start(sim);
  ms_error_growth_start(sim);
  ms_step_limit_warn(sim);
  return ms_error_clear(err);
}

msim_status ms_sim_set_state(msim_sim *sim, const msim_state *state, msim_error *err) {
  const msim_status status = ms_sim_check_state(sim, state, err);
  return status ? status : ms_sim_start(sim, state, err);
}
