#include "sim/step_driver.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "contact/contact_set.h"
#include "contact/events.h"
#include "contact/shortened_step.h"
#include "integrate/interpolate.h"
#include "methods/methods.h"
#include "physics/moving_pins.h"
#include "physics/offender.h"
#include "physics/single.h"
#include "sim/conservation.h"
#include "sim/frames.h"
#include "sim/island_step.h"
#include "sim/rank_scene.h"
#include "sim/rank_sim.h"

/*------------------------------------- one island -----------------------------------------------*/

/* The step as it is planned, or else in 2, 4, ... times as many substeps. */
static msim_status make_fixed_step(const msim_sim *sim, ms_stepper *s, msim_error *err) {
  enum { MOST = 40 };
  const ms_integrator *method = sim->config.integrator;
  const int32_t retries = ms_island_step_count_retries(sim);
  const int64_t parts = ms_sim_selects(sim) ? sim->config.choice.substeps : 1;
  msim_status status = ms_island_step_make_substeps(sim, method, s, parts, err);
  for (int i = 1; i <= retries && i <= MOST && ms_island_step_may_retry(status); i++) {
    s->stats->rejected_steps++;
    status = ms_island_step_make_substeps(sim, method, s, parts << i, err);
  }
  return status;
}

/* 1: the step started at rest, stays there, meets no plane, no pinned particle or collider moves
 * from its start on, and no force depends on time. As x and v = 0 are unchanged all accelerations
 * are 0, and the next step has the same result; the vectors that the method carries follow from x
 * and v then. The comparison ends at the first unknown that differs. */
static int stays_at_rest(const msim_sim *sim, const ms_island_sim *m, int64_t contacts) {
  const ms_stepper *s = &m->stepper;
  const ms_shape shape = m->model.state_shape;
  if ((m->model.pins || ms_collider_motion_is_there(sim->scene)) &&
      ms_moving_pins_next_time(sim->scene, s->t) < INFINITY)
    return 0;
  if (ms_scene_function_has(sim->scene, MSIM_FORCE_TIME)) return 0;
  return !(sim->config.opt.skip_off & MSIM_SKIP_AT_REST) && s->stats->contacts == contacts &&
         ms_vector_is_zero(shape, s->v_next) && ms_vector_is_zero(shape, s->v) &&
         ms_vector_is_equal(shape, s->x, s->x_next);
}

/* Compute the next state of one island; the present one is kept. */
static msim_status step_island(const msim_sim *sim, ms_island_sim *m, msim_error *err) {
  const int64_t contacts = m->stepper.stats->contacts;
  const int verified = sim->config.choice.verification.allowed > 0;
  msim_status status;
  if (ms_sim_has_control(sim))
    status = ms_island_step_make_controlled(sim, sim->config.integrator, m, &sim->run.control, err);
  else if (verified) status = ms_step_verification_make_step(sim, m, err);
  else status = make_fixed_step(sim, &m->stepper, err);
  if (!status && m->self_contact)
    status = ms_self_contact_correct(m->self_contact, &m->stepper, err);
  m->at_rest_next = !status && !m->stepper.incomplete && stays_at_rest(sim, m, contacts);
  return status;
}

/*------------------------------------- all islands ----------------------------------------------*/

static void step_single_thread_island(void *data, int32_t i) {
  msim_sim *sim = data;
  ms_island_sim *m = &sim->islands[i];
  if (m->single_thread && !m->at_rest) m->status = step_island(sim, m, NULL);
}

/* Add the island's stats to the sim's. All threads spent its seconds at once. */
static msim_status collect_island_result(msim_sim *sim, ms_island_sim *m) {
  const double threads = ms_pool_thread_count(sim->pool);
  sim->stats.force_evaluations += m->stats.force_evaluations;
  sim->stats.spring_evaluations += m->stats.spring_evaluations;
  sim->stats.contacts += m->stats.contacts;
  sim->stats.rejected_steps += m->stats.rejected_steps;
  sim->stats.force_s += m->stats.force_s / threads;
  sim->stats.collide_s += m->stats.collide_s / threads;
  m->stats = (msim_stats){0};
  return m->status;
}

/* Result of a step: of the first island that failed; m NULL: none did */
typedef struct step_outcome {
  msim_status status;
  ms_island_sim *m;
  const msim_error *why; /* in the caller's memory */
} step_outcome;

/* Set the tolerances of a step. Solves may leave 1/20 of the error that the step may add.
 * Tolerances of events assume some tens of events in a run, whose errors add up at random. */
static void set_tolerances(const msim_sim *sim, ms_island_sim *m, double h, double allowed) {
  const double tol = ms_sim_selects(sim) ? sim->config.choice.tol : sim->config.opt.tol;
  const ms_norm_body least = tol > 0 ? ms_norm_find_smallest(&m->norm) : (ms_norm_body){0};
  ms_stepper *s = &m->stepper;
  s->h = h;
  s->t = ms_sim_has_control(sim) ? sim->run.t : ms_sim_time(sim);
  s->solve_tolerance = allowed > 0 ? fmax(1e-14, 0.05 * fmax(allowed, least.rounding)) : 0;
  s->x_tolerance = 0.1 * tol * least.extent;
  s->v_tolerance = 0.03 * tol * least.speed;
  s->path_tolerance = 0.1 * allowed * least.extent;
  s->dense_output = 0;
  s->incomplete = 0;
}

/* Compute a step of h by all islands that are not at rest; none is accepted yet. allowed: the error
 * that it may add; 0: there is no error control. */
static step_outcome try_all_islands(msim_sim *sim, double h, double allowed, msim_error *why) {
  step_outcome result = {.why = why};
  why->text[0] = 0;
  sim->contacts_known = 0;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    set_tolerances(sim, m, h, allowed);
  if (sim->any_single_thread) ms_pool_run(sim->pool, step_single_thread_island, sim, sim->nislands);
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands && !result.m; m++) {
    if (m->at_rest) continue;
    result.status = m->single_thread ? collect_island_result(sim, m) : step_island(sim, m, why);
    if (result.status) result.m = m;
  }
  return result;
}

static void accept_island(ms_island_sim *m) {
  ms_stepper *s = &m->stepper;
  if (s->events && s->events->moved) { /* for the dense output */
    ms_vector_copy(m->model.shape, s->events->begin[0], s->x);
    ms_vector_copy(m->model.shape, s->events->begin[1], s->v);
    s->events->moved = 0;
  }
  ms_stepper_swap(&s->x, &s->x_next);
  ms_stepper_swap(&s->v, &s->v_next);
  ms_contact_set_accept_step(s);
  s->h_before = s->h / (double)s->parts;
  m->at_rest = m->at_rest_next;
}

/* Add the work of moving pins on springs, of moving colliders, and of a force function. */
static void count_work(msim_sim *sim) {
  double sum = 0;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    if (!m->at_rest) sum += m->stepper.work_in_step;
  ms_ranks_sum(sim->ranks, 1, &sum);
  sim->run.work += sum, sim->run.moved += fabs(sum);
}

/* 1: something does work on the scene. */
static int has_work(const msim_sim *sim) {
  return sim->scene->nmotions || ms_collider_motion_is_there(sim->scene) ||
         ms_scene_has_function(sim->scene);
}

static void accept_step(msim_sim *sim) {
  int32_t resting = 0, incomplete = 0;
  if (has_work(sim)) count_work(sim);
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    resting += m->at_rest;
    incomplete |= m->stepper.incomplete;
    if (!m->at_rest) accept_island(m);
  }
  sim->contacts_known = 1;
  sim->run.step++;
  sim->stats.steps++;
  sim->stats.incomplete_steps += incomplete;
  sim->stats.islands_at_rest += resting;
  sim->stats.steps_at_rest += resting == sim->nislands;
  if (resting < sim->nislands) sim->state_is_current = 0;
}

/* Report step, time, particle and spring of the failure; t: the time at the end of the step. */
static msim_status report_failed_step(const msim_sim *sim, const ms_island_sim *m, double t,
                                      msim_status status, const char *why, msim_error *err) {
  char particle[32] = "", spring[32] = "";
  const ms_stepper *s = &m->stepper;
  const int32_t row = s->offender;
  const int32_t pull = row >= 0 && status == MSIM_NOT_FINITE
                           ? ms_offender_find_spring(&m->model, ms_single_get_x(&m->model, s->x),
                                                     ms_single_get_v(&m->model, s->v), row)
                           : -1;
  if (row >= 0)
    snprintf(particle, sizeof particle, ", particle %d",
             ms_rank_scene_get_particle(sim, m->model.unknowns.particle[row]));
  if (pull >= 0)
    snprintf(spring, sizeof spring, ", spring %d", ms_rank_scene_get_spring(sim, pull));
  return ms_error_set(err, status, "step %lld, t = %g s%s%s: %s", (long long)(sim->run.step + 1), t,
                      particle, spring, *why ? why : msim_status_text(status));
}

static msim_status make_fixed_sim_step(msim_sim *sim, msim_error *err) {
  msim_error why;
  const step_outcome o = try_all_islands(sim, sim->run.h, 0, &why);
  msim_status status = o.status;
  if (o.m) report_failed_step(sim, o.m, ms_sim_time(sim) + sim->run.h, o.status, o.why->text, err);
  status = ms_rank_sim_agree_on_step(sim, status, err);
  if (status) return status;
  const double t = ms_sim_time(sim);
  accept_step(sim);
  ms_sim_move_pins(sim, t);
  return MSIM_OK;
}

/*------------------------------------- error control --------------------------------------------*/

/* The next time at which a step has to end: the end of the run, or a time of a motion, where
 * velocities or their derivatives jump */
static double find_stop(const msim_sim *sim) {
  const double t_end = sim->config.plan.t_end,
               next = ms_moving_pins_next_time(sim->scene, sim->run.t);
  return t_end < 0 || (t_end - sim->run.t) + sim->run.t_rounding <= 0 ? next : fmin(t_end, next);
}

static double time_left(const msim_sim *sim, double stop) {
  return (stop - sim->run.t) + sim->run.t_rounding;
}

/* t += h by compensated summation: t_rounding carries the rounding error to the next sum (Kahan,
 * Commun. ACM 8 (1965) 40). */
static void advance_time(msim_sim *sim, double h, double stop) {
  const double left = time_left(sim, stop);
  const double add = h - sim->run.t_rounding, t = sim->run.t + add;
  sim->run.t_rounding = (t - sim->run.t) - add;
  sim->run.t = t;
  if (h == left) sim->run.t = stop, sim->run.t_rounding = 0;
  sim->run.t_shown = sim->run.t;
}

/* The first impact of all islands that are not at rest, and the first change of a contact, as
 * fractions of the step */
static void find_first_event(const msim_sim *sim, double *impact, double *change) {
  *impact = *change = MS_NOWHERE;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    if (m->at_rest) continue;
    *impact = fmin(*impact, m->stepper.impact);
    *change = fmin(*change, m->stepper.change);
  }
}

/* The largest error of all islands that are not at rest; *worst: the island that has it. */
static double largest_error(const msim_sim *sim, ms_island_sim **worst) {
  *worst = NULL;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    if (m->at_rest) continue;
    if (!*worst || !(m->error <= (*worst)->error)) *worst = m;
    if (isnan(m->error)) break;
  }
  return *worst ? (*worst)->error : 0;
}

/* Report that the shortest step failed; in t a shorter one is lost by rounding. */
static msim_status report_shortest_step(msim_sim *sim, const step_outcome *o, ms_island_sim *worst,
                                        double h, msim_error *err) {
  char why[256];
  if (o->m) {
    snprintf(why, sizeof why, "the step failed even with h = %.3g s: %.180s", h,
             *o->why->text ? o->why->text : msim_status_text(o->status));
    return report_failed_step(sim, o->m, sim->run.t + h, o->status, why, err);
  }
  worst->stepper.offender = ms_control_find_offender(sim->config.integrator, &worst->stepper);
  snprintf(
      why, sizeof why,
      "the error exceeds tol = %g even with h = %.3g s; use a larger tol or another integrator",
      sim->config.opt.tol, h);
  return report_failed_step(sim, worst, sim->run.t + h, MSIM_NOT_CONVERGED, why, err);
}

/* The largest of all islands. INFINITY, too, where something does work: that in a part of a step is
 * not known accurately. */
static double find_amplification(const msim_sim *sim) {
  double largest = sim->config.integrator->path && !has_work(sim) ? 0 : INFINITY;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    if (!m->at_rest) largest = fmax(largest, ms_island_step_find_amplification(m));
  return largest;
}

/* End the step just made at that share of its length, at an impact, or 1. */
static void end_step(const msim_sim *sim, double share) {
  const ms_integrator *method = sim->config.integrator;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands && method->path; m++)
    if (m->stepper.events && !m->at_rest) ms_shortened_step_end(method, &m->stepper, share);
}

/* On failure the step controller keeps its state, too. */
static msim_status make_controlled_sim_step(msim_sim *sim, msim_error *err) {
  const ms_control before = sim->run.control;
  const int64_t contacts = sim->stats.contacts;
  const double stop = find_stop(sim), left = time_left(sim, stop);
  ms_attempt a = ms_control_begin_attempt(&sim->run.control, sim->run.t, left);
  msim_error why;
  for (;;) {
    const double h = a.h;
    ms_island_sim *worst = NULL;
    const step_outcome o =
        try_all_islands(sim, h, ms_control_allowed_error(&sim->run.control, h), &why);
    ms_attempt_result result = {.status = o.status,
                                .error = o.m ? 0 : largest_error(sim, &worst),
                                .amplification = find_amplification(sim)};
    find_first_event(sim, &result.impact, &result.change);
    const ms_verdict verdict = ms_control_judge_attempt(&sim->run.control, &a, &result);
    if (verdict == MS_ACCEPTED || verdict == MS_SHORTENED) {
      const double t = sim->run.t;
      const msim_status status = ms_rank_sim_agree_on_step(sim, MSIM_OK, err);
      if (status) return status;
      end_step(sim, verdict == MS_SHORTENED ? result.impact : 1);
      accept_step(sim);
      advance_time(sim, a.h, stop);
      ms_sim_move_pins(sim, t);
      sim->run.h = sim->run.control.h;
      return MSIM_OK;
    }
    sim->stats.rejected_steps++;
    sim->stats.contacts = contacts;
    const int may_help = !o.m || ms_island_step_may_retry(o.status);
    if (may_help && verdict == MS_TRY_AGAIN) continue;
    sim->run.control = before;
    const msim_status status =
        may_help ? report_shortest_step(sim, &o, worst, h, err)
                 : report_failed_step(sim, o.m, sim->run.t + h, o.status, o.why->text, err);
    return ms_rank_sim_agree_on_step(sim, status, err);
  }
}

/* They are fewer than those with error control. */
static void list_uncontrolled_methods(size_t size, char *names) {
  const ms_integrator *method;
  names[0] = 0;
  for (int32_t i = 0; (method = ms_methods_at(i)) != NULL; i++) {
    const size_t used = strlen(names);
    if (!ms_control_is_supported(method))
      snprintf(names + used, size - used, "%s%s", used ? ", " : "", method->entry.name);
  }
}

/* dop853 has error control by default; `steps` switches it off. */
msim_status ms_step_driver_choose_control(msim_sim *sim, msim_error *err) {
  msim_options *opt = &sim->config.opt;
  char names[128];
  if (opt->tol == 0 && opt->steps < 0 && sim->config.integrator->chooses_steps)
    opt->tol = MS_DEFAULT_TOL;
  if (opt->tol == 0) return MSIM_OK;
  if (opt->steps >= 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "tol and steps exclude each other, because with tol error control "
                        "determines the number of steps; use t_end in place of steps");
  if (ms_control_is_supported(sim->config.integrator)) return MSIM_OK;
  list_uncontrolled_methods(sizeof names, names);
  return ms_error_set(err, MSIM_ERR_ARG,
                      "integrator '%s' has no error control; remove tol, or use another integrator "
                      "(not %s), for example dop853",
                      opt->integrator, names);
}

void ms_step_driver_start_control(msim_sim *sim) {
  sim->run.control =
      ms_control_make(sim->config.integrator, sim->config.opt.tol, ms_plan_span(&sim->config.plan));
  ms_step_driver_set_step(sim, sim->run.h);
  sim->run.t = sim->run.t_shown = sim->config.plan.t0;
  sim->run.t_rounding = 0;
  sim->run.frame = 1;
}

void ms_step_driver_set_step(msim_sim *sim, double h) {
  sim->run.control.h = sim->run.h = h;
  ms_control_reset(&sim->run.control);
}

void ms_step_driver_show_time(msim_sim *sim, double t) {
  if (t == sim->run.t_shown) return;
  sim->run.t_shown = t;
  sim->state_is_current = 0;
}

int ms_step_driver_has_frame_inside(const msim_sim *sim) {
  if (!ms_options_have_frame_times(&sim->config.opt) || sim->run.step == sim->run.step0) return 0;
  return sim->run.t_shown < sim->run.t ||
         ms_frames_time(&sim->config.plan, &sim->config.opt, sim->run.frame) < sim->run.t;
}

void ms_step_driver_prepare_dense_output(msim_sim *sim) {
  if (!ms_step_driver_has_frame_inside(sim)) return;
  for (int32_t i = 0; i < sim->nislands; i++) {
    ms_stepper *s = &sim->islands[i].stepper;
    ms_interpolate(sim->config.integrator, s, 1, s->x_spare[0], s->v_spare[0]);
  }
}

msim_status ms_step_driver_make_step(msim_sim *sim, msim_error *err) {
  const int has_control = ms_sim_has_control(sim);
  if (has_control)
    ms_step_driver_show_time(sim, sim->run.t); /* the dense output of the last step is lost now */
  const msim_status status =
      has_control ? make_controlled_sim_step(sim, err) : make_fixed_sim_step(sim, err);
  if (status) return status;
  ms_conservation_check(sim);
  ms_error_growth_follow(sim, has_control ? sim->islands->stepper.h : sim->run.h);
  return MSIM_OK;
}
