#include "choose/verification_setup.h"

#include <float.h>
#include <math.h>

#include "methods/methods.h"

/* The largest error of a step without an event; if there is none, the least error */
static double usual_error(const ms_step_measurement *s, int n, double event) {
  double largest = 0, least = INFINITY;
  for (int i = 0; i < n; i++) {
    least = fmin(least, s[i].error);
    if (s[i].error <= event) largest = fmax(largest, s[i].error);
  }
  return largest > 0 ? largest : least;
}

/* 1: a step with impacts has an error of the order of other steps, which the trial has measured as
 * it passes impacts: reflection makes all steps of order 1, and the paths of velocity Verlet are of
 * its order 2. Of few particles a single impact may still be an event. */
static int impacts_keep_order(const ms_pilot_run *p, const ms_candidate *c) {
  return c->collision == MSIM_COLLISION_REFLECT || (p->many && c->method == &ms_velocity_verlet);
}

int ms_verification_setup_is_needed(const ms_pilot_run *p, const ms_candidate *c) {
  if (c->control_tol > 0 || !ms_control_is_supported(c->method)) return 0;
  return !(p->planes_count && impacts_keep_order(p, c));
}

int ms_verification_setup_is_for_events(const ms_pilot_run *p, const ms_candidate *c) {
  return p->planes_count && p->many && ms_verification_setup_is_needed(p, c);
}

/* Set the difference from half steps that verified steps may have (step_verification.h): 50 e
 * tol/E, at least tol h/T, and at most tol/4, or 4 e tol/E if that is more where particles are many
 * and no plane is near. e: that of a step at the choice; E: the error predicted without the growth
 * to come. Away from planes tol counts as 0.01 at most, as larger errors do not add up as small
 * ones do. A measured step may contain an impact, whose error and indicators are not typical: so
 * several are measured, but only one of many particles, or away from planes, where steps are
 * alike. */
msim_status ms_verification_setup_measure(ms_pilot_run *p, const ms_candidate *c,
                                          const ms_trial *trial, ms_step_verification *v,
                                          msim_error *err) {
  const double CARE = 50, SOME = 4, MOST = p->planes_count ? INFINITY : 0.01;
  const double tol = fmin(p->tol, MOST), event = tol / 4;
  const int n = p->many || !p->planes_count ? 1 : MS_MEASURED_STEPS;
  ms_step_measurement s[MS_MEASURED_STEPS];
  v->scales = p->scales;
  v->planes_far = ms_scene_has_obstacles(p->sim->scene) && !p->planes_count;
  if (c->control_tol > 0 && p->mid_run) v->allowed = p->tol * c->h / p->span;
  if (!ms_verification_setup_is_needed(p, c)) return MSIM_OK;
  v->only_events = ms_verification_setup_is_for_events(p, c);
  if (v->only_events) v->allowed = p->tol / MS_EVENTS_PER_RUN;
  if (v->only_events) return MSIM_OK;
  msim_status status = ms_pilot_run_measure_steps(p, trial, n, s, err);
  if (status) return status;
  const double share = tol * c->h / p->span;
  const double foreseen = fmax(c->error / ms_pilot_run_growth(p, trial->order), DBL_MIN);
  const double even = usual_error(s, n, event) * tol / foreseen;
  const double most = p->planes_count || !p->many ? event : fmax(event, SOME * even);
  if (p->many && trial->order == 2) v->error_sum = even * p->span / c->h;
  v->allowed = fmin(most, fmax(share, CARE * even));
  for (int i = 0; i < n; i++)
    for (int k = 0; k < 2 && s[i].error <= v->allowed; k++)
      v->indicator[k] = fmax(v->indicator[k], s[i].indicator[k]);
  return MSIM_OK;
}
