#include "choose/implicit_trial.h"

#include <math.h>

#include "choose/control_trial.h"
#include "choose/rejection_reasons.h"
#include "linear/iteration_estimate.h"

static int is_limited_by_stability(const ms_pilot_run *p, const ms_candidate *c) {
  const double reach = ms_pilot_run_stable_step(p, c->method);
  return c->control_tol > 0 ? c->h > reach / 2 : c->h == reach;
}

/* Evaluations of a step of tr-bdf2, which is made whole and as two half steps, of two stages each,
 * while Newton's method converges quickly; iterations by linear/iteration_estimate.h. Conjugate
 * gradients need no more iterations than there are unknowns. */
static double predict_step_cost(const ms_model *model, double h) {
  const double CORRECTIONS = 2, RTOL = 0.01;
  const ms_iteration_estimate p = ms_iteration_estimate_compute(model, h, RTOL);
  const double unknowns = (double)model->unknowns.dims * model->unknowns.nfree;
  const double iterations = fmin(unknowns, fmin(p.one_level, 2 * p.two_level));
  return 3 * 2 * CORRECTIONS * (2 + MS_EVALUATIONS_PER_ITERATION * iterations);
}

msim_status ms_implicit_trial_make(ms_pilot_run *p, const ms_candidate *best, ms_candidate *c,
                                   msim_error *err) {
  const double most = best->cost_rate * p->span / 5;
  msim_sim *trial;
  c->rejection = MS_REASON_ACCURACY_DECIDES;
  if (p->planes_count || !is_limited_by_stability(p, best)) return MSIM_OK;
  c->rejection = MS_REASON_TOO_EXPENSIVE;
  if (10 * predict_step_cost(ms_pilot_run_model(p), p->span / 10) >= most) return MSIM_OK;
  msim_status status = ms_pilot_run_create_sim(p, c->method, p->tol, p->span / 100, &trial, err);
  if (status) return status;
  status = ms_pilot_run_set_start(p, trial, err);
  if (!status) status = ms_control_trial_run(p, trial, p->span, most, INFINITY, c, err);
  const int arrived = trial->run.t >= p->span;
  if (arrived) c->cost_rate = c->step_cost / c->h;
  c->rejection = arrived ? MS_REASON_NONE : MS_REASON_RUN_NOT_FINISHED;
  msim_sim_destroy(trial);
  return status;
}
