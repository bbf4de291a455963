#include "choose/control_trial.h"

#include <math.h>

#include "choose/rejection_reasons.h"
#include "methods/methods.h"
#include "sim/step_driver.h"

/* Steps that show what error control costs where no plane counts: the lengths of 6 and of 16 differ
 * by 2 to 6 %. Those of rkc at first resolve vibrations that damping then removes, and become up to
 * 200 times as long: the first sixteenth of the trial does not count. */
enum { STEPS = 6, SETTLING = 16 };

double ms_control_trial_stable_step(const ms_pilot_run *p, const ms_integrator *method) {
  return ms_pilot_run_stable_step(p, method == &ms_rk6 ? &ms_ssprk104 : method);
}

/* Of the relaxed tolerance: the largest, and the least over tol */
static const double LARGEST = 0.1, LEAST = 8;

double ms_control_trial_relaxed_tol(double tol) {
  const double MOST = 50;
  return fmin(MOST, fmax(LEAST, LARGEST / tol)) * tol;
}

/* 1: a step of h with the relaxed tolerance adds at most tol/4 to the error. */
static int adds_little(const ms_pilot_run *p, double h) {
  const double MOST = 0.25;
  return ms_control_trial_relaxed_tol(p->tol) * h <= MOST * p->tol * p->span;
}

int ms_control_trial_may_relax(const ms_pilot_run *p, const ms_integrator *method) {
  return ms_pilot_run_is_limited_by_damping(p) && !p->planes_count && LEAST * p->tol <= LARGEST &&
         adds_little(p, ms_control_trial_stable_step(p, method));
}

int ms_control_trial_relaxes_first(const ms_pilot_run *p) {
  return ms_control_trial_may_relax(p, &ms_ssprk104) &&
         adds_little(p, MS_LOOSE * ms_pilot_run_stable_step(p, &ms_ssprk104));
}

static int is_relaxed(const ms_pilot_run *p, const ms_candidate *c) {
  return c->control_tol > p->tol;
}

/* A quarter of the length of the pilot run. In a run that has begun that is short, and ends at the
 * first of many impacts: there as far as fixed steps are tried. */
static double longest_time(const ms_pilot_run *p) {
  return p->mid_run ? p->span / MS_TRIALS_AT_PLANES : fmax(p->duration, p->span / 16) / 4;
}

/* 1: a trial has to last that long, as few steps do not show what the others cost. */
static int needs_time(const ms_pilot_run *p, const ms_candidate *c) {
  return p->planes_count || c->method == &ms_rkc;
}

double ms_control_trial_steps(const ms_pilot_run *p, const ms_candidate *c) {
  if (needs_time(p, c)) return longest_time(p) / c->h;
  return is_relaxed(p, c) ? 3 * STEPS + 2 * MS_DECAY_STEPS : STEPS;
}

void ms_control_trial_postpone(double least, ms_candidate *c) {
  c->rejection = MS_REASON_COSTS_MORE;
  c->cost_rate = 2 * least;
  c->error = 0;
}

msim_status ms_control_trial_run(ms_pilot_run *p, msim_sim *trial, double t, double most,
                                 double steps, ms_candidate *c, msim_error *err) {
  const double start = ms_pilot_run_count_work(trial);
  double work = 0, time = 0, before = 0; /* time and work: in all; of steps that do not count */
  int64_t left_out = 0;                  /* their number */
  msim_status status = MSIM_OK;
  while (!status && trial->run.t < t && (double)trial->run.step < steps && work < most) {
    const int64_t made = trial->run.step;
    if (c->method == &ms_rkc ? trial->run.t < t / SETTLING : made == 1 && steps < INFINITY)
      time = trial->run.t, before = work, left_out = made;
    status = ms_sim_make_steps(trial, 1, err);
    work = ms_pilot_run_count_work(trial) - start;
  }
  p->cost += work;
  if (status < 0 || trial->run.step == 0) return status < 0 ? status : MSIM_OK;
  if (trial->run.step == left_out) time = before = 0, left_out = 0;
  const double counted = (double)(trial->run.step - left_out);
  c->h = (trial->run.t - time) / counted;
  c->step_cost = (work - before) / counted;
  return MSIM_OK;
}

/* The factor by which error control will shorten its steps of h, as E/h ~ C h^k and C grows: by
 * g^(1/k), where g = 2 at most where damping limits steps, except those of rkc, as it removes some
 * of what makes errors grow; 1 at the limit of stability, `longest` or less, where other errors
 * than those of the motion decide. */
static double later_shortening(const ms_pilot_run *p, const ms_candidate *c, double longest) {
  const double NEAR = 0.8;
  if (c->h > NEAR * longest) return 1;
  const int is_damped = ms_pilot_run_is_limited_by_damping(p) && c->method != &ms_rkc;
  const double most = is_damped ? 2 : INFINITY;
  return pow(fmin(p->step_growth, most),
             1 / ms_control_make(c->method, c->control_tol, p->span).order);
}

/* The first step of rk6 is mostly so long that the controller cuts it to a fifth; then steps
 * lengthen slowly, and in the trial are too short. The error of the last one shows by how much, if
 * accuracy limits it; at the limit of stability it may be small for some steps, too. So c->h is set
 * to the geometric mean of both lengths. */
static void expect_longer_steps(const msim_sim *trial, ms_candidate *c) {
  c->h *= sqrt(fmax(1, ms_control_expected_change(&trial->run.control)));
}

/* After the trial with a relaxed tolerance */
static msim_status check_relaxed(ms_pilot_run *p, msim_sim *trial, ms_candidate *c,
                                 msim_error *err) {
  msim_state end = {.size = sizeof end};
  msim_status status = MSIM_OK;
  msim_sim_state(trial, &end);
  c->error = INFINITY;
  if (adds_little(p, c->h))
    status = ms_pilot_run_compare_end(p, c->method, &end, trial->run.step, &c->error, err);
  if (c->error > p->tol) c->rejection = MS_REASON_ERROR_TOO_LARGE;
  if (c->rejection) c->cost_rate = INFINITY;
  return status;
}

/* Evaluations of dop853 and rk6 count more, as they form so many sums (candidates.c). */
msim_status ms_control_trial_make(ms_pilot_run *p, double least, ms_candidate *c, msim_error *err) {
  const int has_sums = c->method == &ms_dop853 || c->method == &ms_rk6;
  const double SUMS = has_sums ? 13. / 12 : 1;
  const double t = longest_time(p), longest = c->h;
  const double steps = needs_time(p, c) ? INFINITY : STEPS;
  const ms_trial of = {
      .method = c->method, .collision = c->collision, .tol = c->control_tol, .h = fmin(c->h, t)};
  msim_sim *trial;
  msim_status status = ms_pilot_run_start_late(p, &of, &trial, err);
  if (status) return status;
  status = ms_control_trial_run(p, trial, t, least * t / SUMS, steps, c, err);
  const int arrived = trial->run.t >= t || (double)trial->run.step >= steps;
  if (c->method == &ms_rk6) expect_longer_steps(trial, c);
  c->step_cost *= SUMS;
  c->cost_rate = c->step_cost / c->h * later_shortening(p, c, longest);
  c->tried = arrived;
  if (!arrived) ms_control_trial_postpone(least, c);
  else if (!status && is_relaxed(p, c)) status = check_relaxed(p, trial, c, err);
  return status;
}
