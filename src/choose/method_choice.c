#include "choose/method_choice.h"

#include <math.h>

#include "methods/methods.h"
#include "sim/step_driver.h"
#include "choose/candidates.h"
#include "choose/control_trial.h"
#include "choose/fast_turns.h"
#include "choose/implicit_trial.h"
#include "choose/multirate_trial.h"
#include "choose/pilot_run.h"
#include "choose/precision_choice.h"
#include "choose/rejection_reasons.h"
#include "choose/verification_setup.h"

/* verlet has the positions of velocity Verlet, unless forces depend on velocities. */
static ms_trial make_trial(const ms_pilot_run *p, const ms_candidate *c) {
  return (ms_trial){
      .method = c->method == &ms_verlet && !p->damped ? &ms_velocity_verlet : c->method,
      .collision = c->collision,
      .order = ms_candidate_order_of_errors(p, c),
      .h = c->h};
}

/* With planes, where steps may cost ten times what is expected, a trial ends once its steps cost
 * more than half of `least`, the cost of another method: with half steps it would cost a fifth of
 * the run, about as much as it could save. */
static msim_status measure_error(ms_pilot_run *p, double least, ms_candidate *c, msim_error *err) {
  const double factor = ms_verification_setup_is_for_events(p, c) ? MS_EVENT_COST : 1;
  const double before = p->cost;
  ms_trial trial = make_trial(p, c);
  double step_cost;
  if (p->planes_count && least < INFINITY)
    trial.most = least / 2 / factor * ms_pilot_run_trial_steps(p, c->h) * c->h;
  msim_status status = ms_pilot_run_try_method(p, &trial, &c->error, &step_cost, err);
  if (c->collision == MSIM_COLLISION_EVENT) c->step_cost = fmax(c->step_cost, step_cost);
  if (trial.most > 0 && c->error == INFINITY && p->cost - before > trial.most)
    c->rejection = MS_REASON_COSTS_MORE;
  return status;
}

/* Find the step whose error is tol: errors go like h^k once they are small. Rough ones shorten a
 * step 20-fold at most, unless 20 times the step that they predict is shorter still. A step that is
 * more than twice as long or as short as the one tried has to be tried itself; where trials are
 * long, one of 1.5 times its length does for two thirds of the cost. The first trial, mostly of the
 * longest stable step, contains errors of fast modes that fall faster than h^k: with order 4, and
 * without impacts, the second one assumes two orders more. The error of a trial of m steps cannot
 * be smaller than their rounding, which adds up like sqrt(m): shorter steps would show no smaller
 * one. */
static msim_status try_candidate_step(ms_pilot_run *p, int i, double least, ms_candidate *c,
                                      double *most, msim_error *err) {
  const double SAFETY = 0.95, FARTHEST = 20, ROUGH = 0.01, LONGER = 1.5;
  if (ms_candidate_trials_are_long(p) && c->error > 0) c->h = fmin(*most, LONGER * c->h);
  const double k = make_trial(p, c).order, h = c->h;
  const int may_fall_faster = c->error == 0 && k == 4 && !p->planes_count;
  msim_status status = measure_error(p, least, c, err);
  if (c->rejection) ms_control_trial_postpone(least, c);
  if (status || c->rejection) return status;
  const double rounding = p->scales.rounding * p->span / (h * sqrt(ms_pilot_run_trial_steps(p, h)));
  const double ratio = p->tol / c->error,
               longest = may_fall_faster ? fmin(0.5, SAFETY * pow(ratio, 1 / (k + 2))) : 0,
               change = fmin(FARTHEST, fmax(SAFETY * pow(ratio, 1 / k), longest)),
               rough_change = fmax(change, fmin(1 / FARTHEST, FARTHEST * change));
  if (c->error > p->tol) *most = SAFETY * h;
  c->h = fmin(*most, h * (c->error > ROUGH ? rough_change : change));
  if (c->error <= p->tol && c->h < h) c->h = h;
  c->tried = c->error <= rounding || (c->h > h / 2 && c->h < 2 * h);
  c->error *= pow(c->h / h, k);
  ms_candidate_set_cost(p, i, c);
  return MSIM_OK;
}

/* Where nothing but the motion decides on steps, fixed ones of dop853 cost little less than those
 * of h that its error control has chosen: mostly they need not be tried. */
static void expect_fixed_steps(const ms_pilot_run *p, double h, ms_candidate *fixed) {
  if (p->planes_count || fixed->tried || fixed->rejection) return;
  fixed->h = fmin(fixed->h, h / 0.8);
  ms_candidate_set_cost(p, MS_EIGHTH, fixed);
}

/* Raise the cost of an untried candidate to that of steps of h: it may then do without a trial,
 * which would still begin with its longest step. */
static void expect_steps(const ms_pilot_run *p, int i, double h, ms_candidate *c) {
  if (c->tried || c->rejection || c->error > 0) return;
  ms_candidate steps = *c;
  steps.h = h;
  ms_candidate_set_cost(p, i, &steps);
  c->cost_rate = fmax(c->cost_rate, steps.cost_rate);
}

/* Under error control E/h ~ C h^k makes steps of h longer by (relaxed tolerance/tol)^(1/k). */
static void expect_relaxed_steps(const ms_pilot_run *p, const ms_candidate *with_tol, int i,
                                 ms_candidate *relaxed) {
  const double k = ms_control_make(with_tol->method, with_tol->control_tol, p->span).order;
  const double ratio = relaxed->control_tol / with_tol->control_tol;
  expect_steps(p, i, with_tol->h * pow(ratio, 1 / k), relaxed);
}

/* What the trial of candidate i shows about others. Fixed steps of order 2 that keep tol are about
 * as long with one method as with another: with rkc 0.4 to 1.7 times as long as with velocity
 * Verlet in four scenes. */
static void expect_others(const ms_pilot_run *p, int i, ms_candidate *c) {
  const double LONGER = 3;
  if (i == MS_ERROR_CONTROLLED && c[i].method == c[MS_EIGHTH].method)
    expect_fixed_steps(p, c[i].h, &c[MS_EIGHTH]);
  if (c[i].rejection) return;
  if (i == MS_ERROR_CONTROLLED)
    expect_relaxed_steps(p, &c[i], MS_ERROR_RELAXED, &c[MS_ERROR_RELAXED]);
  if (i == MS_DAMPING_CONTROLLED)
    expect_relaxed_steps(p, &c[i], MS_DAMPING_RELAXED, &c[MS_DAMPING_RELAXED]);
  const int is_of_order_two =
      !ms_candidate_is_controlled(i) && ms_candidate_order_of_errors(p, &c[i]) == 2;
  if (!is_of_order_two || c[i].error > p->tol) return;
  for (int j = 0; j < MS_CANDIDATES; j++)
    if (j != i && !ms_candidate_is_controlled(j) && ms_candidate_order_of_errors(p, &c[j]) == 2)
      expect_steps(p, j, LONGER * c[i].h, &c[j]);
}

/* The relaxed candidate i does not keep tol: the method with tol is one. */
static void admit_with_tol(const ms_pilot_run *p, int i, ms_candidate *c) {
  const int with_tol = i == MS_ERROR_RELAXED ? MS_ERROR_CONTROLLED : MS_DAMPING_CONTROLLED;
  if (c[with_tol].rejection != MS_REASON_RELAXED) return;
  c[with_tol].rejection = MS_REASON_NONE;
  ms_candidate_set_longest_step(p, with_tol, &c[with_tol]);
}

static int most_promising(const ms_pilot_run *p, const ms_candidate *c) {
  int best = 0;
  for (int i = 1; i < MS_CANDIDATES; i++)
    if (ms_candidate_expected_cost(p, i, &c[i]) < ms_candidate_expected_cost(p, best, &c[best]))
      best = i;
  return best;
}

/* A lower bound on the cost of the method that will be chosen, until one is tried */
static double find_least_cost(const ms_candidate *c) {
  double least = INFINITY;
  for (int i = 0; i < MS_CANDIDATES; i++) least = fmin(least, c[i].cost_rate);
  return least;
}

/* The least cost of the others; those still on trial may cost twice what is expected. */
static double least_tried_cost(const ms_pilot_run *p, int but, const ms_candidate *c) {
  double least = INFINITY;
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (i != but && (c[i].tried || c[i].error > 0))
      least = fmin(least, (c[i].tried ? 1 : 2) * ms_candidate_expected_cost(p, i, &c[i]));
  return least;
}

/* Trials of rkc under error control are long: the first one ends where it costs three times as much
 * as is expected, so that shorter trials of others come before a second one. */
static msim_status choose_explicit(ms_pilot_run *p, ms_method_choice *s, msim_error *err) {
  enum { PATIENCE = 6 };
  const double LONG_TRIAL = 3;
  ms_candidate *c = s->candidates;
  double most[MS_CANDIDATES];
  int tries[MS_CANDIDATES] = {0};
  msim_status status = MSIM_OK;
  for (int i = 0; i < MS_CANDIDATES; i++) most[i] = c[i].h;
  for (s->best = most_promising(p, c); !status && !c[s->best].tried;
       s->best = most_promising(p, c)) {
    const int i = s->best;
    double least = least_tried_cost(p, i, c);
    if (i == MS_STABILISED_CONTROLLED && tries[i] == 0)
      least = fmin(least, LONG_TRIAL * c[i].cost_rate);
    c[i].rejection = MS_REASON_NONE;
    status = ms_candidate_is_controlled(i) ? ms_control_trial_make(p, least, &c[i], err)
                                           : try_candidate_step(p, i, least, &c[i], &most[i], err);
    expect_others(p, i, c);
    if (ms_candidate_is_relaxed(i) && c[i].rejection == MS_REASON_ERROR_TOO_LARGE)
      admit_with_tol(p, i, c);
    c[i].tried |= ++tries[i] == PATIENCE;
    if (c[i].tried && c[i].rejection) c[i].cost_rate = INFINITY;
  }
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (c[i].rejection == MS_REASON_COSTS_MORE) c[i].tried = 1, c[i].cost_rate = INFINITY;
    else if (c[i].cost_rate < c[s->best].cost_rate) c[i].rejection = MS_REASON_TRIAL_TOO_EXPENSIVE;
  return status;
}

/*------------------------------------- the choice -----------------------------------------------*/

/* Choose order 2 under error control without a trial if tol is large and damping limits steps:
 * stability then mostly decides on them. Returns 1 if it does. With tol = 0.1 that is so in 481 of
 * 595 random cloths, ropes and blocks with strong damping. Without pilot run and trials they take
 * 0.77 times as long in the geometric mean, 14 of them more than twice as long. With tol = 0.05
 * ropes would take longer in sum. */
static int choose_untried(const ms_pilot_run *p, ms_method_choice *s) {
  const double LARGE = 0.099; /* 0.1, however rounded */
  ms_candidate *c = s->candidates;
  const int best =
      c[MS_STABILISED_CONTROLLED].rejection ? MS_LOW_ORDER_CONTROLLED : MS_STABILISED_CONTROLLED;
  if (p->tol < LARGE || c[best].rejection) return 0;
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (i != best && !c[i].rejection) c[i].rejection = MS_REASON_LARGE_TOL;
  s->best = best;
  return 1;
}

/* respa needs no pilot run, unless that has to show that no plane is met. */
static msim_status choose_candidate(ms_pilot_run *p, ms_method_choice *s, msim_error *err) {
  const int has_obstacles = ms_scene_has_obstacles(p->sim->scene);
  ms_candidate *c = s->candidates;
  msim_status status = has_obstacles ? ms_pilot_run_make(p, err) : MSIM_OK;
  if (status) return status;
  for (int i = 0; i < MS_CANDIDATES; i++) ms_candidate_init(p, i, &c[i]);
  status = ms_multirate_trial_make(p, find_least_cost(c), &c[MS_MULTIRATE], err);
  s->best = MS_MULTIRATE;
  if (status || c[MS_MULTIRATE].tried) return status;
  if (!choose_untried(p, s)) {
    if (!has_obstacles) status = ms_pilot_run_make(p, err);
    if (!status) status = choose_explicit(p, s, err);
  }
  if (!status) status = ms_implicit_trial_make(p, &c[s->best], &c[MS_IMPLICIT], err);
  if (c[MS_IMPLICIT].cost_rate < c[s->best].cost_rate) s->best = MS_IMPLICIT;
  return status;
}

/* 1: the best makes fixed steps, whose length neither planes, strong damping nor few stiff springs
 * decide. */
static int is_by_plain_steps(const ms_pilot_run *p, const ms_method_choice *s) {
  const int i = s->best;
  return !p->planes_count && !ms_candidate_is_controlled(i) && i != MS_STABILISED &&
         i != MS_MULTIRATE;
}

/* Error control takes the place of fixed steps in which springs turn, unless its trial fails. */
static msim_status choose_control(ms_pilot_run *p, ms_method_choice *s, msim_error *err) {
  ms_candidate *of = s->candidates, c = of[MS_ERROR_CONTROLLED];
  msim_status status = MSIM_OK;
  if (!c.tried || c.rejection) {
    c.rejection = MS_REASON_NONE;
    ms_candidate_set_longest_step(p, MS_ERROR_CONTROLLED, &c);
    status = ms_control_trial_make(p, INFINITY, &c, err);
  }
  if (status || c.rejection) return status;
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (!ms_candidate_is_controlled(i) && !of[i].rejection) of[i].rejection = MS_REASON_FAST_TURNS;
  of[MS_ERROR_CONTROLLED] = c;
  s->best = MS_ERROR_CONTROLLED;
  return MSIM_OK;
}

static msim_status choose_method(ms_pilot_run *p, ms_method_choice *s, msim_error *err) {
  msim_status status = choose_candidate(p, s, err);
  if (!status && is_by_plain_steps(p, s) && ms_fast_turns_are_there(p, s->candidates[s->best].h))
    status = choose_control(p, s, err);
  ms_candidate *best = &s->candidates[s->best];
  const ms_trial trial = make_trial(p, best);
  if (!status) status = ms_verification_setup_measure(p, best, &trial, &s->verification, err);
  if (!ms_precision_choice_is_verifiable(p, best, &s->verification))
    best->precision = MSIM_PRECISION_DOUBLE;
  s->pilot_time = p->duration, s->total_cost = p->cost, s->damped = p->damped;
  return status;
}

/* Rounding may be larger than tol, and the number of trials is limited. */
static void warn_of_error(const msim_sim *sim, const ms_candidate *c, double tol) {
  if (c->control_tol > 0 || !(c->error > 10 * tol)) return;
  ms_sim_warn(sim,
              "integrator 'auto': none of the methods tried keeps tol = %g in this scene; the "
              "error of the chosen one, %s, may reach %.2g; use a larger tol",
              tol, c->method->entry.name, c->error);
}

/* Set method and options as if they had been requested. The first step is a stable one. A run that
 * has begun keeps its grid of steps: error control chooses their substeps. */
static void use_choice(msim_sim *sim, const ms_pilot_run *p, const ms_method_choice *s) {
  const ms_candidate *c = &s->candidates[s->best];
  const double reach = ms_pilot_run_stable_step(p, c->method);
  warn_of_error(sim, c, s->tol);
  sim->config.choice = *s;
  sim->config.choice.out_of_date = 1;
  sim->config.integrator = c->method;
  sim->config.opt.integrator = c->method->entry.name;
  sim->config.opt.tol = p->mid_run ? 0 : c->control_tol;
  sim->config.opt.h = fmin(c->h, reach);
  sim->config.opt.collision = c->collision;
  sim->config.opt.precision = c->precision;
  sim->config.step_limit = (ms_step_limit){.bounds = p->bounds,
                                           .limit = reach / MS_STABLE_FRACTION,
                                           .tightness = 2,
                                           .from_auto = c->h == reach,
                                           .warned = sim->config.step_limit.warned};
}

msim_status ms_method_choice_make(msim_sim *sim, int late, const msim_state *start,
                                  msim_error *err) {
  ms_method_choice s = {.tol = sim->config.choice.tol,
                        .collision = sim->config.choice.collision,
                        .precision = sim->config.choice.precision,
                        .substeps = 1};
  ms_pilot_run p;
  msim_status status = ms_pilot_run_begin(sim, s.tol, late, start, &p, err);
  if (!status) s.single_error = p.single_error = ms_precision_choice_estimate_error(&p);
  if (!status) status = choose_method(&p, &s, err);
  if (!status) use_choice(sim, &p, &s);
  if (!status && !sim->islands) ms_sim_take_models(sim, p.sims[MSIM_COLLISION_REFLECT]);
  ms_pilot_run_end(&p);
  return status;
}

/* Impacts can be located by methods that have v and all forces at the same time. */
static int may_be_best(const ms_candidate *c) {
  const int locates = !c->method->sync && !c->method->is_multirate;
  return c->rejection == MS_REASON_NONE && (locates || c->collision == MSIM_COLLISION_REFLECT);
}

void ms_method_choice_archive(ms_archive *b, ms_method_choice *s) {
  double *numbers[] = {&s->tol, &s->pilot_time, &s->total_cost, &s->single_error};
  for (int k = 0; k < 4; k++) MS_ARCHIVE_TRANSFER(b, *numbers[k]);
  MS_ARCHIVE_TRANSFER(b, s->best);
  MS_ARCHIVE_TRANSFER(b, s->collision);
  MS_ARCHIVE_TRANSFER(b, s->damped);
  s->damped = s->damped != 0;
  ms_archive_transfer_count(b, &s->substeps);
  ms_step_verification_archive(b, &s->verification);
  ms_archive_check(b, s->substeps > 0, "the choice of a method");
  for (int i = 0; i < MS_CANDIDATES; i++) ms_candidate_archive(b, i, &s->candidates[i]);
  ms_archive_check(b,
                   s->best >= 0 && s->best < MS_CANDIDATES && may_be_best(&s->candidates[s->best]),
                   "the choice of a method");
}
