#include "ladder.h"

#include <math.h>
#include <stdio.h>

#include "../common/clock.h"

double rung_rtol(int rung) { return (rung % 2 ? 0.3 : 1) * pow(10, -(rung / 2)); }

/*------------------------------------- one rung -------------------------------------------------*/

msim_status ladder_step(const ladder *l, int rung, double *seconds, msim_error *err) {
  msim_sim *sim = l->sims[rung];
  msim_status status = msim_sim_set_state(sim, &l->step->moving->state, err);
  if (status) return status;
  const double start = wall_seconds();
  status = msim_sim_step(sim, 1, err);
  *seconds = wall_seconds() - start;
  return status;
}

/* Runs a short step twice: in the first run caches are cold. */
static msim_status try_rung(const ladder *l, int rung, arrival *here, msim_error *err) {
  const double SHORT = 0.05;
  msim_stats stats = {.size = sizeof stats};
  double again = INFINITY;
  *here = (arrival){.rung = rung};
  msim_status status = ladder_step(l, rung, &here->seconds, err);
  msim_sim_stats(l->sims[rung], &stats);
  here->iterations = stats.newton_iterations;
  if (!status && here->seconds < SHORT) {
    status = ladder_step(l, rung, &again, err);
    here->seconds = fmin(here->seconds, again);
  }
  return status;
}

/*------------------------------------- all of them ----------------------------------------------*/

static void keep_the_quickest(ladder *l) {
  int kept[RUNGS] = {0};
  for (int a = 0; a < ACCURACIES; a++)
    if (isfinite(l->pursuit.at[a].seconds)) kept[l->pursuit.at[a].rung] = 1;
  for (int i = 0; i < RUNGS; i++) {
    if (kept[i]) continue;
    msim_sim_destroy(l->sims[i]);
    l->sims[i] = NULL;
  }
}

/* Returns whether to continue. */
static int climb_rung(ladder *l, const char *solver, int rung, const ladder_plan *plan) {
  msim_options options = newton_options(l->step->h, rung_rtol(rung), solver);
  const int32_t most = affordable(&plan->allowed, options.newton_max_iterations);
  const int is_limited = most < options.newton_max_iterations;
  msim_state end = {.size = sizeof end};
  pursuit *p = &l->pursuit;
  arrival here;
  msim_error err;
  options.newton_max_iterations = most;
  msim_status status = msim_sim_create(l->step->moving->scene, &options, &l->sims[rung], &err);
  if (status) pursuit_end(p, LEFT_OUT, err.text);
  if (status) return 0;
  status = try_rung(l, rung, &here, &err);
  if (status == MSIM_NOT_CONVERGED && is_limited) pursuit_cut_off(p, here.seconds);
  else if (status) pursuit_end(p, FAILED, err.text);
  if (status) return 0;
  msim_sim_state(l->sims[rung], &end);
  here.error = nonlinear_error(l->step, end.v);
  if (is_another_minimum(l->step, end.v)) {
    pursuit_end(p, OTHER_MINIMUM, "it came to another minimum");
    return 0;
  }
  if (pursuit_note(p, &here)) return 0;
  p->lasted = here.seconds;
  return 1;
}

void ladder_climb(const nonlinear_step *s, const char *name, const char *solver,
                  const ladder_plan *plan, ladder *l) {
  const double start = wall_seconds();
  *l = (ladder){.step = s};
  pursuit *p = &l->pursuit;
  pursuit_begin(p, name);
  for (int rung = plan->first; rung < RUNGS; rung += plan->stride) {
    if (!pursuit_may_go_on(p, &plan->allowed, wall_seconds() - start, p->lasted)) return;
    const int goes_on = climb_rung(l, solver, rung, plan);
    keep_the_quickest(l);
    if (!goes_on) return;
  }
  pursuit_end(p, FAILED, "the error stays above at the smallest newton.rtol");
}

void ladder_free(ladder *l) {
  for (int i = 0; i < RUNGS; i++) msim_sim_destroy(l->sims[i]);
  *l = (ladder){0};
}
