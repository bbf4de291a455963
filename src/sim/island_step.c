#include "sim/island_step.h"

#include <math.h>

#include "contact/contact_log.h"
#include "contact/contact_set.h"
#include "contact/events.h"
#include "contact/shortened_step.h"
#include "physics/force_function.h"
#include "physics/moving_pins.h"

/* Make one step of s->h by the method; all steps go through here. MSIM_NOT_FINITE: x or v is NaN or
 * huge. */
static msim_status step_checked(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  s->offender = -1;
  s->finite = 0;
  s->c = 0;
  ms_force_function *function = s->model->function;
  if (function) function->status = MSIM_OK;
  msim_status status = ms_events_step(method, s, err);
  if (!method->counts_work) ms_stepper_add_trapezoidal_work(s, s->v);
  if (function && function->status) return ms_force_function_report(s->model, &s->offender, err);
  if (status || s->finite) return status;
  s->offender = ms_vector_find_invalid(s->model->state_shape, s->x_next);
  if (s->offender < 0) s->offender = ms_vector_find_invalid(s->model->state_shape, s->v_next);
  return s->offender < 0 ? MSIM_OK : MSIM_NOT_FINITE;
}

/* Continue from the state between two substeps: x_next becomes x. The state at the start of the
 * step stays where it is: x_next takes the first spare pair in place of its memory. */
static void begin_next_substep(ms_stepper *s, const ms_stepper *start) {
  ms_stepper_swap(&s->x, &s->x_next);
  ms_stepper_swap(&s->v, &s->v_next);
  s->t += s->h;
  if (s->model->pins) ms_moving_pins_set(s->model, (ms_instant){.t = s->t}, s->x, s->v);
  if (s->x_next == start->x)
    ms_stepper_swap(&s->x_next, &s->x_spare[0]), ms_stepper_swap(&s->v_next, &s->v_spare[0]);
  ms_contact_set_accept_step(s);
  s->h_before = s->h;
}

/* Make the state at the start the present one again; its cached stages may be overwritten. */
static void restore_step_start(ms_stepper *s, const ms_stepper *start) {
  s->h = start->h;
  s->h_before = start->h_before;
  s->t = start->t;
  if (s->model->pins) ms_moving_pins_set(s->model, (ms_instant){.t = s->t}, start->x, start->v);
  if (s->x == start->x) return;
  ms_stepper_swap(&s->x, &s->x_spare[0]), ms_stepper_swap(&s->v, &s->v_spare[0]);
  s->cached_stage = 0;
}

/* Ranks go on together or fail together; on a step that is made but once the driver agrees. */
static msim_status agree_on_substep(const msim_sim *sim, msim_status status, msim_error *err) {
  const int is_once = !ms_sim_has_control(sim) && ms_island_step_count_retries(sim) == 0;
  return is_once ? status : ms_ranks_agree(sim->ranks, status, err);
}

msim_status ms_island_step_make_substeps(const msim_sim *sim, const ms_integrator *method,
                                         ms_stepper *s, int64_t n, msim_error *err) {
  const ms_stepper start = *s;
  msim_status status = MSIM_OK;
  s->parts = n;
  s->h = start.h / (double)n;
  s->work_in_step = 0;
  ms_contact_log_clear(s->contact_log, start.h);
  double impact = MS_NOWHERE, change = MS_NOWHERE;
  for (int64_t i = 0; i < n && !status; i++) {
    s->part = i;
    if (i > 0) begin_next_substep(s, &start);
    status = agree_on_substep(sim, step_checked(method, s, err), err);
    if (s->impact <= 1) impact = fmin(impact, ((double)i + s->impact) / (double)n);
    if (s->change <= 1) change = fmin(change, ((double)i + s->change) / (double)n);
  }
  s->impact = impact, s->change = change;
  restore_step_start(s, &start);
  return status;
}

int ms_island_step_may_retry(msim_status status) {
  return status == MSIM_NOT_CONVERGED || status == MSIM_NOT_FINITE;
}

/* 0 if the method carries variables that depend on h. */
int32_t ms_island_step_count_retries(const msim_sim *sim) {
  enum { USUAL = 6 };
  if (sim->config.integrator->convert_state) return 0;
  if (sim->config.opt.newton_retries >= 0) return sim->config.opt.newton_retries;
  const ms_integrator *method = sim->config.integrator;
  const int may_gain_energy = method->entry.implicit && sim->scene->ncolliders > 0 &&
                              sim->config.opt.collision == MSIM_COLLISION_EVENT;
  return method->nonlinear || may_gain_energy ? USUAL : 0;
}

/* A whole step, which goes to the second spare pair, and two half steps, whose impacts count. With
 * an impact inside there are none: the step will be shortened, and its error is not known, as the
 * second half step would begin behind the plane or after the impact. */
static msim_status make_doubled_step(const msim_sim *sim, const ms_integrator *method,
                                     ms_stepper *s, msim_error *err) {
  const int64_t contacts = s->stats->contacts;
  msim_status status = ms_island_step_make_substeps(sim, method, s, 1, err);
  if (status || ms_control_is_shortened(s->impact)) return status;
  s->stats->contacts = contacts;
  if (s->events) ms_contact_set_save_start(s->events, s->model->shape);
  const int moved = s->events && s->events->moved;
  ms_stepper_swap(&s->x_next, &s->x_spare[1]);
  ms_stepper_swap(&s->v_next, &s->v_spare[1]);
  status = ms_island_step_make_substeps(sim, method, s, 2, err);
  if (s->events) s->events->moved = moved;
  return status;
}

/* One step, whose error the method estimates by itself; keeps the state that it started from. */
static msim_status make_estimated_step(const msim_sim *sim, const ms_integrator *method,
                                       ms_stepper *s, msim_error *err) {
  const msim_status status = ms_island_step_make_substeps(sim, method, s, 1, err);
  if (!status && s->events) ms_contact_set_save_start(s->events, s->model->shape);
  return status;
}

/* An error dx of x moves the impact by dx/|n.v| in time, which changes v by U/|n.v| dx U/L. Beyond
 * the limit of stability dense output is less accurate than the step: of a vibration with h omega =
 * 4, 6, 8, 10 its error is 3, 8, 22, 51 times the estimate of dop853. */
double ms_island_step_find_amplification(const ms_island_sim *m) {
  const double STABLE = 5;
  const ms_stepper *s = &m->stepper;
  const double fast = s->h * fmax(s->bounds.omega, s->bounds.rate) / STABLE;
  double slow = 1;
  if (!ms_shortened_step_is_possible(s)) return INFINITY;
  if (s->impact <= 1)
    slow = fmax(1, m->norm.body[m->norm.body_of[s->impact_row]].speed / s->impact_speed);
  return slow * (1 + pow(fast, 4));
}

/* e sqrt(n_p/(2 n))/v_tolerance, which is proportional to h^3: the largest error e of n_p paths, as
 * a root mean square over the n particles of the connected component */
double ms_island_step_find_path_error(const ms_island_sim *m) {
  const ms_stepper *s = &m->stepper;
  if (s->npaths == 0) return 0;
  const ms_norm_body *part = &m->norm.body[m->norm.body_of[s->path_row]];
  const double share = sqrt(fmin(1, s->npaths / (2. * part->n)));
  return share * s->path_error / s->v_tolerance;
}

/* The controller expects errors proportional to h^k: those of paths, ~ h^3, enter with the power
 * k/3. Step doubling does not see them all: where an impact ends a step, its neighbours feel the
 * velocity before it for the same time in both half steps and in the whole one. */
msim_status ms_island_step_make_controlled(const msim_sim *sim, const ms_integrator *method,
                                           ms_island_sim *m, const ms_control *c, msim_error *err) {
  ms_stepper *s = &m->stepper;
  double *x = s->x, *v = s->v;
  const double allowed = ms_control_allowed_error(c, s->h);
  s->one_substep = 1;
  s->impact = s->change = MS_NOWHERE;
  const msim_status status = method->estimate ? make_estimated_step(sim, method, s, err)
                                              : make_doubled_step(sim, method, s, err);
  s->one_substep = 0;
  if (status) return status;
  if (s->events && s->events->moved) s->x = s->events->begin[0], s->v = s->events->begin[1];
  const int is_unknown = !method->estimate && ms_control_is_shortened(s->impact);
  m->error = is_unknown ? NAN : ms_control_error(method, s, &m->norm, allowed);
  s->x = x, s->v = v;
  const double of_paths = pow(ms_island_step_find_path_error(m), c->order / 3);
  if (!isnan(m->error) && !(of_paths <= m->error)) m->error = of_paths;
  return MSIM_OK;
}
