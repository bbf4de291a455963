/* run - the public functions that create a sim, set its state and step it (msim.h). With integrator
 * = auto they choose the method, and choose anew where a plane is close. */
#include <math.h>

#include "base/sized.h"
#include "checkpoint/fingerprint.h"
#include "choose/method_choice.h"
#include "choose/resonance.h"
#include "sim/frames.h"
#include "sim/rank_scene.h"
#include "sim/step_driver.h"

/*------------------------------------- creation and state ---------------------------------------*/

msim_status msim_sim_create(const msim_scene *scene, const msim_options *opt, msim_sim **sim,
                            msim_error *err) {
  if (!scene || !opt || !sim) return ms_error_set(err, MSIM_ERR_ARG, "scene, opt or sim is NULL");
  msim_status status = ms_sim_create(scene, opt, ms_method_choice_make, NULL, sim, err);
  if (status || !(*sim)->ranks) return status;
  ms_fingerprint_hash_scene(*sim);
  status = ms_ranks_agree((*sim)->ranks, MSIM_OK, err);
  if (!status) status = ms_rank_scene_divide(*sim, err);
  if (!status) return ms_error_clear(err);
  msim_sim_destroy(*sim);
  *sim = NULL;
  return status;
}

/* Start a run by a method chosen for that state; on failure the old method stays. */
static msim_status restart_with_choice(msim_sim *sim, const msim_state *state, msim_error *err) {
  const ms_config before = sim->config;
  msim_status status = ms_method_choice_make(sim, 0, state, err);
  if (!status) status = ms_sim_start(sim, state, err);
  if (status) sim->config = before;
  return status;
}

msim_status msim_sim_set_state(msim_sim *sim, const msim_state *state, msim_error *err) {
  if (!sim || !state) return ms_error_set(err, MSIM_ERR_ARG, "sim or state is NULL");
  msim_state full;
  msim_status status =
      ms_sized_check(state, sizeof full, MS_SIZE_THROUGH(msim_state, v), "state", "state", err);
  if (status) return status;
  ms_sized_read(&full, sizeof full, state);
  status = ms_rank_scene_gather(sim, err);
  if (status) return status;
  status = ms_ranks_agree(sim->ranks, ms_sim_check_state(sim, &full, err), err);
  if (status) return status;
  return ms_sim_selects(sim) ? restart_with_choice(sim, &full, err) : ms_sim_start(sim, &full, err);
}

/*------------------------------------- steps ----------------------------------------------------*/

/* Choose a method for impacts. The grid of steps and frames stays: its step is divided, by error
 * control or into equal parts. */
static msim_status choose_for_planes(msim_sim *sim, const msim_state *now, msim_error *err) {
  msim_status status = ms_method_choice_make(sim, 1, now, err);
  if (status) return status;
  if (ms_choice_best(&sim->config.choice)->control_tol == 0)
    sim->config.choice.substeps = (int64_t)fmax(1, ceil(sim->run.h / sim->config.opt.h - 1e-9));
  sim->config.opt.h = sim->run.h;
  return MSIM_OK;
}

/* Impacts cause errors that damping does not remove: error control continues with tol. */
static void control_with_tol(msim_sim *sim) {
  ms_method_choice *choice = &sim->config.choice;
  sim->config.opt.tol = choice->candidates[choice->best].control_tol = choice->tol;
}

/* From here on planes count: choose a method for impacts in the present state, with steps that
 * divide the planned ones. Under error control the method stays. */
static msim_status enable_planes(msim_sim *sim, msim_error *err) {
  const ms_config before = sim->config;
  msim_state now = {.size = sizeof now};
  msim_status status = MSIM_OK;
  msim_sim_state(sim, &now);
  sim->config.choice.verification.planes_far = 0;
  if (ms_sim_has_control(sim)) control_with_tol(sim);
  else status = choose_for_planes(sim, &now, err);
  if (!status) status = ms_sim_build_islands(sim, sim->islands->model.unknowns.dropped_axis, err);
  if (!status) {
    now.v_half = NULL;
    sim->run.control.tol = sim->config.opt.tol;
    ms_control_reset(&sim->run.control);
    ms_sim_start_islands(sim, &now);
    ms_energy_monitor_start(sim);
    return MSIM_OK;
  }
  sim->config = before;
  return status;
}

/* Continue by the same method with doubles in place of floats. */
static msim_status continue_with_doubles(msim_sim *sim, msim_error *err) {
  const ms_config before = sim->config;
  ms_method_choice *choice = &sim->config.choice;
  sim->config.opt.precision = choice->candidates[choice->best].precision = MSIM_PRECISION_DOUBLE;
  const msim_status status = ms_sim_rebuild_islands(sim, err);
  if (status) {
    sim->config = before;
    return status;
  }
  ms_step_verification_start_islands(sim);
  ms_energy_monitor_start(sim);
  return MSIM_OK;
}

/* 1: the method or its precision may change between steps. */
static int may_change(const msim_sim *sim) {
  const ms_step_verification *v = &sim->config.choice.verification;
  return v->planes_far || (v->allowed > 0 && sim->islands->model.single) ||
         ms_resonance_may_occur(sim);
}

/* As ms_sim_make_steps(), until a plane is close, from which on planes count, until verified steps
 * with floats need doubles (step_verification.h), and until respa is in resonance. */
static msim_status make_steps(msim_sim *sim, int64_t n, msim_error *err) {
  for (; n > 0 && may_change(sim); n--) {
    if (ms_sim_has_control(sim)) ms_step_driver_show_time(sim, sim->run.t);
    msim_status status = MSIM_OK;
    if (ms_step_verification_needs_doubles(sim)) status = continue_with_doubles(sim, err);
    if (!status && ms_step_verification_planes_due(sim)) status = enable_planes(sim, err);
    if (!status && ms_resonance_is_there(sim)) status = ms_resonance_leave(sim, err);
    if (!status) status = ms_sim_make_steps(sim, 1, err);
    if (status) return status;
  }
  return ms_sim_make_steps(sim, n, err);
}

/* The driver of a run must not be entered a second time. */
static msim_status refuse_in_observer(const msim_sim *sim, const char *function, msim_error *err) {
  if (!sim->in_observer) return MSIM_OK;
  return ms_error_set(
      err, MSIM_ERR_ARG,
      "%s must not be called in an observer of the same sim: the run continues when "
      "the observer has returned",
      function);
}

/* A later msim_sim_run does not show frames that these steps have passed. */
msim_status msim_sim_step(msim_sim *sim, int64_t n, msim_error *err) {
  if (!sim || n < 0) return ms_error_set(err, MSIM_ERR_ARG, "sim is NULL, or n is negative");
  msim_status status = refuse_in_observer(sim, "msim_sim_step", err);
  if (status) return status;
  status = make_steps(sim, n, err);
  if (ms_options_have_frame_times(&sim->config.opt))
    sim->run.frame = ms_frames_after(&sim->config.plan, &sim->config.opt, sim->run.t);
  return status ? status : ms_error_clear(err);
}

void msim_sim_stop(msim_sim *sim) { atomic_store(&sim->stop, 1); }

int64_t msim_sim_next_frame(const msim_sim *sim) {
  if (ms_options_have_frame_times(&sim->config.opt)) return sim->run.step + 1;
  return sim->run.step0 +
         ms_frames_next_step(&sim->config.plan, &sim->config.opt, sim->run.step - sim->run.step0);
}

static int is_at_end(const msim_sim *sim) {
  if (!ms_sim_has_control(sim)) return sim->run.step - sim->run.step0 >= sim->config.plan.steps;
  if (!ms_options_have_frame_times(&sim->config.opt)) return sim->run.t >= sim->config.plan.t_end;
  return ms_frames_time(&sim->config.plan, &sim->config.opt, sim->run.frame - 1) >=
         sim->config.plan.t_end;
}

static msim_status run_to_step(msim_sim *sim, int64_t due, msim_error *err) {
  msim_status status = MSIM_OK;
  if (!ms_sim_has_control(sim)) return make_steps(sim, due - sim->run.step, err);
  while (!status && sim->run.step < due && !is_at_end(sim)) status = make_steps(sim, 1, err);
  return status;
}

/* The frame may lie inside the last step. */
static msim_status run_to_time(msim_sim *sim, double due, msim_error *err) {
  msim_status status = MSIM_OK;
  while (!status && sim->run.t < due) status = make_steps(sim, 1, err);
  return status;
}

/* Run to the next frame. shown: an observer will get it, so that its state is checked first.
 * *is_there: the frame is reached, also where a request to stop takes effect exactly there; after
 * such a request the next run shows a frame that has a time of its own. */
static msim_status run_to_frame(msim_sim *sim, int shown, int *is_there, msim_error *err) {
  const int has_times = ms_options_have_frame_times(&sim->config.opt);
  const int64_t next = msim_sim_next_frame(sim);
  const double due =
      has_times ? ms_frames_time(&sim->config.plan, &sim->config.opt, sim->run.frame) : 0;
  msim_status status = has_times ? run_to_time(sim, due, err) : run_to_step(sim, next, err);
  if (!status && shown) status = ms_energy_monitor_check(sim, err);
  const int stopped_there = status == MSIM_STOPPED && (sim->run.step == next || is_at_end(sim));
  *is_there = !status || (stopped_there && !has_times);
  if (status || !has_times) return status;
  ms_step_driver_show_time(sim, due);
  sim->run.frame++;
  return MSIM_OK;
}

/* 1: the observer asks to stop, on any rank. */
static int observe(msim_sim *sim, msim_observer *observer, void *user) {
  double enough = 0;
  if (observer) {
    sim->in_observer = 1;
    enough = observer(sim, user) != 0;
    sim->in_observer = 0;
  }
  ms_ranks_maximum(sim->ranks, 1, &enough);
  return enough > 0;
}

msim_status msim_sim_run(msim_sim *sim, msim_observer *observer, void *user, msim_error *err) {
  if (!sim) return ms_error_set(err, MSIM_ERR_ARG, "sim is NULL");
  const msim_status refused = refuse_in_observer(sim, "msim_sim_run", err);
  if (refused) return refused;
  if (sim->config.plan.t_end < 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the run has no end: set options.steps or options.t_end");
  if (sim->run.step == sim->run.step0 && observe(sim, observer, user))
    return ms_error_set(err, MSIM_STOPPED, "stopped by the observer at the start");
  while (!is_at_end(sim)) {
    int is_there;
    const int shown = observer != NULL || sim->ranks; /* ranks may have observers or not */
    const msim_status status = run_to_frame(sim, shown, &is_there, err);
    const int enough = is_there && observe(sim, observer, user);
    if (status) return status;
    if (enough)
      return ms_error_set(err, MSIM_STOPPED, "stopped by the observer after step %lld, t = %g s",
                          (long long)sim->run.step, ms_sim_time(sim));
  }
  return ms_error_clear(err);
}
