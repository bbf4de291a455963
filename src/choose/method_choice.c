#include "choose/method_choice.h"

#include <float.h>
#include <math.h>

#include "methods/methods.h"
#include "sim/step_driver.h"
#include "choose/control_trial.h"
#include "choose/fast_turns.h"
#include "choose/implicit_trial.h"
#include "choose/multirate_trial.h"
#include "choose/pilot_run.h"
#include "choose/precision_choice.h"
#include "choose/rejection_reasons.h"
#include "choose/verification_setup.h"

/* The impacts of so many particles are few enough to be located one by one. */
enum { FEW = 4 };

/* Steps with impacts cost so many times as much where two half steps verify each one. */
static const double EVENT_COST = 3;

enum {
  LEAPFROG_METHOD,
  WITH_VELOCITIES,
  LOCATED_IMPACTS,
  TAKAHASHI_IMADA,
  FOURTH,
  STABILISED,
  SIXTH,
  EIGHTH,
  ERROR_CONTROLLED,
  STABILISED_CONTROLLED,
  DAMPING_CONTROLLED,
  LOW_ORDER_CONTROLLED,
  ERROR_RELAXED,
  DAMPING_RELAXED,
  MULTIRATE,
  IMPLICIT
};

/* Kinds of scenes: no force depends on velocities; some do; damping limits the steps, no plane
 * counts, and particles are more than a few */
enum { UNDAMPED, DAMPED, LIMITED_BY_DAMPING, KINDS };
#define ALWAYS(method) \
  { &(method), &(method), &(method) }

/* The candidates: methods and their evaluations per step in scenes of each kind; 0: measured.
 * conversions: evaluations at the first and last states, if these are converted. control: steps are
 * fixed, or under error control with tol, or with the relaxed tolerance (control_trial.h). The
 * leapfrog stands for all explicit methods of order 2. Its forces depend on the velocities of half
 * a step before: the errors of that are of order 1, yet small where damping is weak, and velocity
 * Verlet needs twice as many evaluations. Evaluations of dop853 and rk6 count 13/12-fold, as they
 * form so many sums; those of rkc follow from h. ssprk102, ssprk104 and rk6 are for steps that
 * damping limits, of which error control makes longer ones than bounds on damping allow. Strong
 * damping makes long steps of rkc with many stages least expensive; these may become unstable, as
 * motion across springs is not damped, so that error control may have to shorten them. tr-bdf2
 * damps what long steps cannot resolve; other implicit methods have to resolve it, and take no
 * longer steps than explicit ones. */
static const struct {
  const ms_integrator *method[KINDS];
  double evaluations[KINDS];
  double conversions;
  enum { FIXED, WITH_TOL, RELAXED } control;
} candidate_list[MS_CANDIDATES] = {
    [LEAPFROG_METHOD] = {ALWAYS(ms_verlet), {1, 1, 1}},
    [WITH_VELOCITIES] = {ALWAYS(ms_velocity_verlet), {1, 2, 2}},
    [LOCATED_IMPACTS] = {ALWAYS(ms_velocity_verlet), {1, 2, 2}},
    [TAKAHASHI_IMADA] = {ALWAYS(ms_takahashi_imada), {2, 2, 2}, 31},
    [FOURTH] = {{&ms_force_gradient, &ms_rk4, &ms_rk4}, {5, 4, 4}},
    [STABILISED] = {ALWAYS(ms_rkc), {2, 2, 2}},
    [SIXTH] = {ALWAYS(ms_rkn6), {11, 11, 11}},
    [EIGHTH] = {ALWAYS(ms_dop853), {13, 13, 13}},
    [ERROR_CONTROLLED] = {{&ms_dop853, &ms_dop853, &ms_rk6}, {13, 13, 12}, .control = WITH_TOL},
    [STABILISED_CONTROLLED] = {ALWAYS(ms_rkc), {2, 2, 2}, .control = WITH_TOL},
    [DAMPING_CONTROLLED] = {ALWAYS(ms_ssprk104), {10, 10, 10}, .control = WITH_TOL},
    [LOW_ORDER_CONTROLLED] = {ALWAYS(ms_ssprk102), {10, 10, 10}, .control = WITH_TOL},
    [ERROR_RELAXED] = {{&ms_dop853, &ms_dop853, &ms_rk6}, {13, 13, 12}, .control = RELAXED},
    [DAMPING_RELAXED] = {ALWAYS(ms_ssprk104), {10, 10, 10}, .control = RELAXED},
    [MULTIRATE] = {ALWAYS(ms_respa), {0}},
    [IMPLICIT] = {ALWAYS(ms_tr_bdf2), {0}, .control = WITH_TOL}};

/*------------------------------------- explicit ones --------------------------------------------*/

static int kind_of_scene(const ms_pilot_run *p) {
  if (!p->damped) return UNDAMPED;
  const int limited = ms_pilot_run_is_limited_by_damping(p) && !p->planes_count && !p->few;
  return limited ? LIMITED_BY_DAMPING : DAMPED;
}

static const ms_integrator *candidate_method(const ms_pilot_run *p, int i) {
  return candidate_list[i].method[kind_of_scene(p)];
}

/* 1: velocity Verlet takes the place of verlet, which carries v(t - h/2), so that no step can be
 * halved: steps are verified or divided. */
static int needs_velocities(const ms_pilot_run *p) { return p->mid_run || !p->many; }

static int is_order_two(int i) { return i == LEAPFROG_METHOD || i == WITH_VELOCITIES; }
static int is_controlled(int i) { return candidate_list[i].control != FIXED; }
static int is_relaxed(int i) { return candidate_list[i].control == RELAXED; }
static int is_for_damping(int i) {
  return i == STABILISED || i == STABILISED_CONTROLLED || i == DAMPING_CONTROLLED ||
         i == LOW_ORDER_CONTROLLED || is_relaxed(i);
}

/* Why a candidate is rejected whose steps damping limits. With few stages the others under error
 * control cost less than rkc. Order 2 is sufficient for a large tol: other trials are wasted. */
static int find_damping_rejection(const ms_pilot_run *p, int i) {
  enum { MANY_STAGES = 5 };
  const double least_tol = i == LOW_ORDER_CONTROLLED ? 0.03 : i == STABILISED_CONTROLLED ? 1e-4 : 0;
  const ms_integrator *method = candidate_method(p, i);
  const double reach = ms_pilot_run_stable_step(p, method);
  if (!p->damped) return MS_REASON_UNDAMPED;
  if (reach == 0) return MS_REASON_NEVER_STABLE;
  if (!is_controlled(i)) return MS_REASON_NONE;
  if (p->planes_count) return MS_REASON_TRIAL_TOO_EXPENSIVE;
  if (!ms_pilot_run_is_limited_by_damping(p)) return MS_REASON_WEAKLY_DAMPED;
  if (p->tol < least_tol) return MS_REASON_LOW_ORDER;
  if (i == STABILISED_CONTROLLED && method->stages(reach, p->bounds) < MANY_STAGES)
    return MS_REASON_FEW_STAGES;
  if (is_relaxed(i) && !ms_control_trial_may_relax(p, method)) return MS_REASON_NOT_RELAXED;
  return MS_REASON_NONE;
}

static int find_rejection(const ms_pilot_run *p, int i) {
  const int planes = p->planes_count, by_verlet = !needs_velocities(p);
  if (i == LEAPFROG_METHOD && !by_verlet) return MS_REASON_INDIVISIBLE;
  if (i == WITH_VELOCITIES && by_verlet && (planes || !p->damped)) return MS_REASON_VERLET;
  if (is_order_two(i) && planes && p->sim->scene->nparticles <= FEW) return MS_REASON_FEW_IMPACTS;
  if (is_order_two(i) && planes && p->sim->config.choice.collision == MSIM_COLLISION_EVENT)
    return MS_REASON_TO_BE_LOCATED;
  if (is_order_two(i) && planes && !p->met_plane) return MS_REASON_NO_IMPACTS_YET;
  if (i == LOCATED_IMPACTS && !planes) return MS_REASON_NO_IMPACTS;
  if (i == TAKAHASHI_IMADA && planes) return MS_REASON_NO_PLANES;
  if (i == SIXTH && p->damped) return MS_REASON_DAMPED;
  const int of_damping = is_for_damping(i) ? find_damping_rejection(p, i) : 0;
  if (of_damping) return of_damping;
  if ((i == ERROR_CONTROLLED || i == DAMPING_CONTROLLED) && !p->few &&
      ms_control_trial_relaxes_first(p))
    return MS_REASON_RELAXED;
  if (!p->many && !planes && !ms_control_is_supported(candidate_method(p, i)))
    return MS_REASON_UNVERIFIED;
  if (i != ERROR_CONTROLLED && p->few) return MS_REASON_FEW_PARTICLES;
  return MS_REASON_NONE;
}

static double longest_trial_step(const ms_pilot_run *p, const ms_integrator *method) {
  return fmin(ms_pilot_run_stable_step(p, method), p->span / 10);
}

/* Located impacts are of order 2 in longer steps, which trials of shorter steps do not show. */
static double longest_to_locate(const ms_pilot_run *p, const ms_integrator *method) {
  return fmin(longest_trial_step(p, method), ms_pilot_run_longest_to_locate(p, method));
}

/* Set the evaluations of steps of c->h, and their cost: with floats about half of that with
 * doubles. */
static void set_cost(const ms_pilot_run *p, int i, ms_candidate *c) {
  if (c->method->stages)
    c->step_cost = c->method->stages(c->h, ms_bounds_compute_island(ms_pilot_run_model(p)));
  c->cost_rate = c->step_cost / c->h + candidate_list[i].conversions / p->span;
  if (c->precision == MSIM_PRECISION_SINGLE) c->cost_rate /= 2;
  if (ms_verification_setup_is_for_events(p, c)) c->cost_rate *= EVENT_COST;
}

/* 1: error control exceeds the limit of stability by MS_LOOSE in most states. */
static int is_limit_loose(const ms_pilot_run *p) { return p->damped && !p->planes_count; }

/* 1: trials cost much, a fifth of a run each with fixed steps: planes count (pilot_run.h), and
 * particles are so many that no single impact decides whether a method keeps tol. */
static int are_trials_long(const ms_pilot_run *p) { return p->planes_count && p->many; }

/* The cost, and for an untried method 4 times that of its trial, with fixed steps m of them, 2 m
 * half steps and two conversions: most methods gain less than it seems. A long trial that only
 * confirms a step counts once. Error control is tried first, as it keeps tol wherever the motion
 * becomes rougher; but not if its trial is long and velocity Verlet needs but one evaluation. */
static double expected_cost(const ms_pilot_run *p, int i, const ms_candidate *c) {
  const int trial_counts =
      !is_controlled(i) || is_limit_loose(p) || (are_trials_long(p) && !p->damped);
  if (c->tried || !trial_counts) return c->cost_rate;
  const double trial = is_controlled(i) ? ms_control_trial_steps(p, c) * c->step_cost
                                        : 3 * c->step_cost * ms_pilot_run_trial_steps(p, c->h) +
                                              2 * candidate_list[i].conversions;
  const int confirms = are_trials_long(p) && c->error > 0;
  return c->cost_rate + (confirms ? 1 : 4) * trial / p->span;
}

/* Set the longest step, which gives a lower bound on the cost. */
static void set_longest_step(const ms_pilot_run *p, int i, ms_candidate *c) {
  const double LOOSE = is_limit_loose(p) ? MS_LOOSE : 1;
  const int located = c->collision == MSIM_COLLISION_EVENT;
  if (is_controlled(i))
    c->h = fmin(LOOSE * ms_control_trial_stable_step(p, c->method), p->span / 10);
  else c->h = located ? longest_to_locate(p, c->method) : longest_trial_step(p, c->method);
  set_cost(p, i, c);
}

static void init_candidate(const ms_pilot_run *p, int i, ms_candidate *c) {
  const int located = is_controlled(i) ? ms_scene_has_obstacles(p->sim->scene)
                                       : p->planes_count && !is_order_two(i);
  const double tol[] = {
      [FIXED] = 0, [WITH_TOL] = p->tol, [RELAXED] = ms_control_trial_relaxed_tol(p->tol)};
  *c = (ms_candidate){.method = candidate_method(p, i),
                      .collision = located ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT,
                      .control_tol = tol[candidate_list[i].control],
                      .step_cost = candidate_list[i].evaluations[kind_of_scene(p)],
                      .cost_rate = INFINITY,
                      .rejection = find_rejection(p, i)};
  if (ms_precision_choice_allows(p, c)) c->precision = MSIM_PRECISION_SINGLE;
  if (c->step_cost > 0 && !c->rejection) set_longest_step(p, i, c);
}

/* Reflection at the ends of steps is of order 1, and so are forces at the velocities of half a step
 * before; those at extrapolated ones are of order 3. */
static int order_of_errors(const ms_pilot_run *p, const ms_candidate *c) {
  if (c->collision == MSIM_COLLISION_REFLECT && p->planes_count) return 1;
  if (p->damped && c->method == &ms_verlet) return 1;
  if (p->damped && c->method == &ms_takahashi_imada) return 3;
  return c->method->entry.order;
}

/* verlet has the positions of velocity Verlet, unless forces depend on velocities. */
static ms_trial make_trial(const ms_pilot_run *p, const ms_candidate *c) {
  return (ms_trial){
      .method = c->method == &ms_verlet && !p->damped ? &ms_velocity_verlet : c->method,
      .collision = c->collision,
      .order = order_of_errors(p, c),
      .h = c->h};
}

/* With planes, where steps may cost ten times what is expected, a trial ends once its steps cost
 * more than half of `least`, the cost of another method: with half steps it would cost a fifth of
 * the run, about as much as it could save. */
static msim_status measure_error(ms_pilot_run *p, double least, ms_candidate *c, msim_error *err) {
  const double factor = ms_verification_setup_is_for_events(p, c) ? EVENT_COST : 1;
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
  if (are_trials_long(p) && c->error > 0) c->h = fmin(*most, LONGER * c->h);
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
  set_cost(p, i, c);
  return MSIM_OK;
}

/* Where nothing but the motion decides on steps, fixed ones of dop853 cost little less than those
 * of h that its error control has chosen: mostly they need not be tried. */
static void expect_fixed_steps(const ms_pilot_run *p, double h, ms_candidate *fixed) {
  if (p->planes_count || fixed->tried || fixed->rejection) return;
  fixed->h = fmin(fixed->h, h / 0.8);
  set_cost(p, EIGHTH, fixed);
}

/* The relaxed candidate i does not keep tol: the method with tol is one. */
static void admit_with_tol(const ms_pilot_run *p, int i, ms_candidate *c) {
  const int with_tol = i == ERROR_RELAXED ? ERROR_CONTROLLED : DAMPING_CONTROLLED;
  if (c[with_tol].rejection != MS_REASON_RELAXED) return;
  c[with_tol].rejection = MS_REASON_NONE;
  set_longest_step(p, with_tol, &c[with_tol]);
}

static int most_promising(const ms_pilot_run *p, const ms_candidate *c) {
  int best = 0;
  for (int i = 1; i < MS_CANDIDATES; i++)
    if (expected_cost(p, i, &c[i]) < expected_cost(p, best, &c[best])) best = i;
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
      least = fmin(least, (c[i].tried ? 1 : 2) * expected_cost(p, i, &c[i]));
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
    if (i == STABILISED_CONTROLLED && tries[i] == 0)
      least = fmin(least, LONG_TRIAL * c[i].cost_rate);
    c[i].rejection = MS_REASON_NONE;
    status = is_controlled(i) ? ms_control_trial_make(p, least, &c[i], err)
                              : try_candidate_step(p, i, least, &c[i], &most[i], err);
    if (i == ERROR_CONTROLLED && c[i].method == c[EIGHTH].method)
      expect_fixed_steps(p, c[i].h, &c[EIGHTH]);
    if (is_relaxed(i) && c[i].rejection == MS_REASON_ERROR_TOO_LARGE) admit_with_tol(p, i, c);
    c[i].tried |= ++tries[i] == PATIENCE;
    if (c[i].tried && c[i].rejection) c[i].cost_rate = INFINITY;
  }
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (c[i].rejection == MS_REASON_COSTS_MORE) c[i].tried = 1, c[i].cost_rate = INFINITY;
    else if (c[i].cost_rate < c[s->best].cost_rate) c[i].rejection = MS_REASON_TRIAL_TOO_EXPENSIVE;
  return status;
}

/*------------------------------------- the choice -----------------------------------------------*/

/* respa needs no pilot run, unless that has to show that no plane is met. */
static msim_status choose_candidate(ms_pilot_run *p, ms_method_choice *s, msim_error *err) {
  const int has_obstacles = ms_scene_has_obstacles(p->sim->scene);
  ms_candidate *c = s->candidates;
  msim_status status = has_obstacles ? ms_pilot_run_make(p, err) : MSIM_OK;
  if (status) return status;
  for (int i = 0; i < MS_CANDIDATES; i++) init_candidate(p, i, &c[i]);
  status = ms_multirate_trial_make(p, find_least_cost(c), &c[MULTIRATE], err);
  s->best = MULTIRATE;
  if (status || c[MULTIRATE].tried) return status;
  if (!has_obstacles) status = ms_pilot_run_make(p, err);
  if (!status) status = choose_explicit(p, s, err);
  if (!status) status = ms_implicit_trial_make(p, &c[s->best], &c[IMPLICIT], err);
  if (c[IMPLICIT].cost_rate < c[s->best].cost_rate) s->best = IMPLICIT;
  return status;
}

/* 1: the best makes fixed steps, whose length neither planes, strong damping nor few stiff springs
 * decide. */
static int is_by_plain_steps(const ms_pilot_run *p, const ms_method_choice *s) {
  const int i = s->best;
  return !p->planes_count && !is_controlled(i) && i != STABILISED && i != MULTIRATE;
}

/* Error control takes the place of fixed steps in which springs turn, unless its trial fails. */
static msim_status choose_control(ms_pilot_run *p, ms_method_choice *s, msim_error *err) {
  ms_candidate *of = s->candidates, c = of[ERROR_CONTROLLED];
  msim_status status = MSIM_OK;
  if (!c.tried || c.rejection) {
    c.rejection = MS_REASON_NONE;
    set_longest_step(p, ERROR_CONTROLLED, &c);
    status = ms_control_trial_make(p, INFINITY, &c, err);
  }
  if (status || c.rejection) return status;
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (!is_controlled(i) && !of[i].rejection) of[i].rejection = MS_REASON_FAST_TURNS;
  of[ERROR_CONTROLLED] = c;
  s->best = ERROR_CONTROLLED;
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

static void archive_candidate(ms_archive *b, int i, ms_candidate *c) {
  int32_t kind = KINDS - 1;
  while (kind > 0 && c->method != candidate_list[i].method[kind]) kind--;
  MS_ARCHIVE_TRANSFER(b, kind);
  const int known = kind >= 0 && kind < KINDS;
  ms_archive_check(b, known, "the choice of a method");
  c->method = candidate_list[i].method[known ? kind : 0];
  double *numbers[] = {&c->step_cost, &c->cost_rate, &c->h, &c->error, &c->control_tol};
  int *flags[] = {&c->tried, &c->rejection};
  for (int k = 0; k < 5; k++) MS_ARCHIVE_TRANSFER(b, *numbers[k]);
  for (int k = 0; k < 2; k++) MS_ARCHIVE_TRANSFER(b, *flags[k]);
  MS_ARCHIVE_TRANSFER(b, c->collision);
  MS_ARCHIVE_TRANSFER(b, c->precision);
  ms_archive_check(
      b,
      c->rejection >= 0 && c->rejection < MS_REASON_COUNT &&
          (c->control_tol > 0) == is_controlled(i) &&
          (c->collision == MSIM_COLLISION_REFLECT || c->collision == MSIM_COLLISION_EVENT) &&
          (c->precision == MSIM_PRECISION_DOUBLE || ms_precision_choice_takes(c)),
      "the choice of a method");
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
  for (int i = 0; i < MS_CANDIDATES; i++) archive_candidate(b, i, &s->candidates[i]);
  ms_archive_check(b,
                   s->best >= 0 && s->best < MS_CANDIDATES && may_be_best(&s->candidates[s->best]),
                   "the choice of a method");
}
