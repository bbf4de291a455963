#include "newton_sweep.h"

#include <math.h>

#include "../common/clock.h"
#include "timing.h"

double newton_sweep_rtol(int setting) { return (setting % 2 ? 0.3 : 1) * pow(10, -(setting / 2)); }

/*------------------------------------- one tolerance --------------------------------------------*/

msim_status newton_sweep_step(const newton_sweep *l, int setting, double *seconds,
                              msim_error *err) {
  timing_sample s;
  const msim_status status =
      time_steps(l->sims[setting], &l->step->moving->state, 1, INFINITY, &s, err);
  *seconds = s.whole;
  return status;
}

/* Runs a short step twice: in the first run caches are cold. */
static msim_status time_rtol(const newton_sweep *l, int setting, iterate_record *here,
                             msim_error *err) {
  const double SHORT = 0.05;
  msim_stats stats = {.size = sizeof stats};
  double again = INFINITY;
  *here = (iterate_record){.setting = setting};
  msim_status status = newton_sweep_step(l, setting, &here->seconds, err);
  msim_sim_stats(l->sims[setting], &stats);
  here->iterations = stats.newton_iterations;
  if (!status && here->seconds < SHORT) {
    status = newton_sweep_step(l, setting, &again, err);
    here->seconds = fmin(here->seconds, again);
  }
  return status;
}

/*------------------------------------- all of them ----------------------------------------------*/

static void free_slower_sims(newton_sweep *l, const accuracy_record *p) {
  int kept[NEWTON_RTOLS] = {0};
  for (int a = 0; a < ACCURACIES; a++)
    if (isfinite(p->reached[a].seconds)) kept[p->reached[a].setting] = 1;
  for (int i = 0; i < NEWTON_RTOLS; i++) {
    if (kept[i]) continue;
    msim_sim_destroy(l->sims[i]);
    l->sims[i] = NULL;
  }
}

/* Returns whether to continue. */
static int run_rtol(newton_sweep *l, const char *solver, int setting, const newton_sweep_plan *plan,
                    accuracy_record *p) {
  msim_options options = newton_options(l->step->h, newton_sweep_rtol(setting), solver);
  const int32_t most = affordable_iterations(&plan->allowed, options.newton_max_iterations);
  const int is_limited = most < options.newton_max_iterations;
  msim_state end = {.size = sizeof end};
  iterate_record here;
  msim_error err;
  options.newton_max_iterations = most;
  msim_status status = msim_sim_create(l->step->moving->scene, &options, &l->sims[setting], &err);
  if (status) accuracy_record_end(p, END_SKIPPED, err.text);
  if (status) return 0;
  status = time_rtol(l, setting, &here, &err);
  if (status == MSIM_NOT_CONVERGED && is_limited) accuracy_record_cut_off(p, here.seconds);
  else if (status) accuracy_record_end(p, END_FAILED, err.text);
  if (status) return 0;
  msim_sim_state(l->sims[setting], &end);
  here.error = nonlinear_step_error(l->step, end.v);
  if (is_another_minimum(l->step, end.v)) {
    accuracy_record_end(p, END_OTHER_MINIMUM, "it converged to another minimum");
    return 0;
  }
  if (accuracy_record_add(p, &here)) return 0;
  p->seconds_unreached = here.seconds;
  return 1;
}

void newton_sweep_run(const nonlinear_step *s, const char *solver, const newton_sweep_plan *plan,
                      newton_sweep *l, accuracy_record *p) {
  const double start = clock_seconds();
  *l = (newton_sweep){.step = s};
  for (int i = plan->first; i < NEWTON_RTOLS; i += plan->stride) {
    if (!accuracy_record_may_continue(p, &plan->allowed, clock_seconds() - start,
                                      p->seconds_unreached))
      return;
    const int goes_on = run_rtol(l, solver, i, plan, p);
    free_slower_sims(l, p);
    if (!goes_on) return;
  }
  accuracy_record_end(p, END_FAILED,
                      "the error at the smallest newton.rtol exceeds the last accuracy");
}

void newton_sweep_free(newton_sweep *l) {
  for (int i = 0; i < NEWTON_RTOLS; i++) msim_sim_destroy(l->sims[i]);
  *l = (newton_sweep){0};
}
