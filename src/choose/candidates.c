#include "choose/candidates.h"

#include <math.h>

#include "methods/methods.h"
#include "choose/control_trial.h"
#include "choose/precision_choice.h"
#include "choose/rejection_reasons.h"
#include "choose/verification_setup.h"

/* The impacts of so many particles are few enough to be located one by one. */
enum { FEW = 4 };

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
    [MS_LEAPFROG] = {ALWAYS(ms_verlet), {1, 1, 1}},
    [MS_WITH_VELOCITIES] = {ALWAYS(ms_velocity_verlet), {1, 2, 2}},
    [MS_LOCATED_IMPACTS] = {ALWAYS(ms_velocity_verlet), {1, 2, 2}},
    [MS_TAKAHASHI_IMADA] = {ALWAYS(ms_takahashi_imada), {2, 2, 2}, 31},
    [MS_FOURTH] = {{&ms_force_gradient, &ms_rk4, &ms_rk4}, {5, 4, 4}},
    [MS_STABILISED] = {ALWAYS(ms_rkc), {2, 2, 2}},
    [MS_SIXTH] = {ALWAYS(ms_rkn6), {11, 11, 11}},
    [MS_EIGHTH] = {ALWAYS(ms_dop853), {13, 13, 13}},
    [MS_ERROR_CONTROLLED] = {{&ms_dop853, &ms_dop853, &ms_rk6}, {13, 13, 12}, .control = WITH_TOL},
    [MS_STABILISED_CONTROLLED] = {ALWAYS(ms_rkc), {2, 2, 2}, .control = WITH_TOL},
    [MS_DAMPING_CONTROLLED] = {ALWAYS(ms_ssprk104), {10, 10, 10}, .control = WITH_TOL},
    [MS_LOW_ORDER_CONTROLLED] = {ALWAYS(ms_ssprk102), {10, 10, 10}, .control = WITH_TOL},
    [MS_ERROR_RELAXED] = {{&ms_dop853, &ms_dop853, &ms_rk6}, {13, 13, 12}, .control = RELAXED},
    [MS_DAMPING_RELAXED] = {ALWAYS(ms_ssprk104), {10, 10, 10}, .control = RELAXED},
    [MS_MULTIRATE] = {ALWAYS(ms_respa), {0}},
    [MS_IMPLICIT] = {ALWAYS(ms_tr_bdf2), {0}, .control = WITH_TOL}};

/*------------------------------------- where they compete ---------------------------------------*/

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

/* 1: with planes its impacts are reflected at the ends of steps. */
static int is_reflected(int i) { return i == MS_LEAPFROG || i == MS_WITH_VELOCITIES; }
int ms_candidate_is_controlled(int i) { return candidate_list[i].control != FIXED; }
int ms_candidate_is_relaxed(int i) { return candidate_list[i].control == RELAXED; }
static int is_for_damping(int i) {
  return i == MS_STABILISED || i == MS_STABILISED_CONTROLLED || i == MS_DAMPING_CONTROLLED ||
         i == MS_LOW_ORDER_CONTROLLED || ms_candidate_is_relaxed(i);
}

/* Why a candidate is rejected that is for steps which damping limits. Unless the damping rate
 * exceeds the frequency MUCH, steps of rkc have few stages, and the others under error control cost
 * less. Order 2 is sufficient for a large tol: other trials are wasted. */
static int find_damping_rejection(const ms_pilot_run *p, int i) {
  const double MUCH = 3; /* damping rate over angular frequency */
  const double least_tol = i == MS_LOW_ORDER_CONTROLLED    ? 0.03
                           : i == MS_STABILISED_CONTROLLED ? 1e-4
                                                           : 0;
  const ms_integrator *method = candidate_method(p, i);
  const double reach = ms_pilot_run_stable_step(p, method);
  if (!p->damped) return MS_REASON_UNDAMPED;
  if (reach == 0) return MS_REASON_NEVER_STABLE;
  if (!ms_candidate_is_controlled(i)) return MS_REASON_NONE;
  if (p->planes_count) return MS_REASON_TRIAL_TOO_EXPENSIVE;
  if (!ms_pilot_run_is_limited_by_damping(p)) return MS_REASON_WEAKLY_DAMPED;
  if (p->tol < least_tol) return MS_REASON_LOW_ORDER;
  if (i == MS_STABILISED_CONTROLLED && p->bounds.rate < MUCH * p->bounds.omega)
    return MS_REASON_FEW_STAGES;
  if (ms_candidate_is_relaxed(i) && !ms_control_trial_may_relax(p, method))
    return MS_REASON_NOT_RELAXED;
  return MS_REASON_NONE;
}

static int find_rejection(const ms_pilot_run *p, int i) {
  const int planes = p->planes_count, by_verlet = !needs_velocities(p);
  if (i == MS_LEAPFROG && !by_verlet) return MS_REASON_INDIVISIBLE;
  if (i == MS_WITH_VELOCITIES && by_verlet && (planes || !p->damped)) return MS_REASON_VERLET;
  if (is_reflected(i) && planes && p->sim->scene->nparticles <= FEW) return MS_REASON_FEW_IMPACTS;
  if (is_reflected(i) && planes && p->sim->config.choice.collision == MSIM_COLLISION_EVENT)
    return MS_REASON_TO_BE_LOCATED;
  if (is_reflected(i) && planes && !p->met_plane) return MS_REASON_NO_IMPACTS_YET;
  if (i == MS_LOCATED_IMPACTS && !planes) return MS_REASON_NO_IMPACTS;
  if (i == MS_TAKAHASHI_IMADA && planes) return MS_REASON_NO_PLANES;
  if (i == MS_SIXTH && p->damped) return MS_REASON_DAMPED;
  const int of_damping = is_for_damping(i) ? find_damping_rejection(p, i) : 0;
  if (of_damping) return of_damping;
  if ((i == MS_ERROR_CONTROLLED || i == MS_DAMPING_CONTROLLED) && !p->few &&
      ms_control_trial_relaxes_first(p))
    return MS_REASON_RELAXED;
  if (!p->many && !planes && !ms_control_is_supported(candidate_method(p, i)))
    return MS_REASON_UNVERIFIED;
  if (i != MS_ERROR_CONTROLLED && p->few) return MS_REASON_FEW_PARTICLES;
  return MS_REASON_NONE;
}

/*------------------------------------- what they cost -------------------------------------------*/

static double longest_trial_step(const ms_pilot_run *p, const ms_integrator *method) {
  return fmin(ms_pilot_run_stable_step(p, method), p->span / 10);
}

/* Located impacts are of order 2 in longer steps, which trials of shorter steps do not show. */
static double longest_to_locate(const ms_pilot_run *p, const ms_integrator *method) {
  return fmin(longest_trial_step(p, method), ms_pilot_run_longest_to_locate(p, method));
}

void ms_candidate_set_cost(const ms_pilot_run *p, int i, ms_candidate *c) {
  if (c->method->stages)
    c->step_cost = c->method->stages(c->h, ms_bounds_compute_island(ms_pilot_run_model(p)));
  c->cost_rate = c->step_cost / c->h + candidate_list[i].conversions / p->span;
  if (c->precision == MSIM_PRECISION_SINGLE) c->cost_rate /= 2;
  if (ms_verification_setup_is_for_events(p, c)) c->cost_rate *= MS_EVENT_COST;
}

/* 1: error control exceeds the limit of stability by MS_LOOSE in most states. */
static int is_limit_loose(const ms_pilot_run *p) { return p->damped && !p->planes_count; }

int ms_candidate_trials_are_long(const ms_pilot_run *p) { return p->planes_count && p->many; }

double ms_candidate_expected_cost(const ms_pilot_run *p, int i, const ms_candidate *c) {
  const int trial_counts = !ms_candidate_is_controlled(i) || is_limit_loose(p) ||
                           (ms_candidate_trials_are_long(p) && !p->damped);
  if (c->tried || !trial_counts) return c->cost_rate;
  const double trial = ms_candidate_is_controlled(i)
                           ? ms_control_trial_steps(p, c) * c->step_cost
                           : 3 * c->step_cost * ms_pilot_run_trial_steps(p, c->h) +
                                 2 * candidate_list[i].conversions;
  const int confirms = ms_candidate_trials_are_long(p) && c->error > 0;
  return c->cost_rate + (confirms ? 1 : 4) * trial / p->span;
}

void ms_candidate_set_longest_step(const ms_pilot_run *p, int i, ms_candidate *c) {
  const double LOOSE = is_limit_loose(p) ? MS_LOOSE : 1;
  const int located = c->collision == MSIM_COLLISION_EVENT;
  if (ms_candidate_is_controlled(i))
    c->h = fmin(LOOSE * ms_control_trial_stable_step(p, c->method), p->span / 10);
  else c->h = located ? longest_to_locate(p, c->method) : longest_trial_step(p, c->method);
  ms_candidate_set_cost(p, i, c);
}

void ms_candidate_init(const ms_pilot_run *p, int i, ms_candidate *c) {
  const int located = ms_candidate_is_controlled(i) ? ms_scene_has_obstacles(p->sim->scene)
                                                    : p->planes_count && !is_reflected(i);
  const double tol[] = {
      [FIXED] = 0, [WITH_TOL] = p->tol, [RELAXED] = ms_control_trial_relaxed_tol(p->tol)};
  *c = (ms_candidate){.method = candidate_method(p, i),
                      .collision = located ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT,
                      .control_tol = tol[candidate_list[i].control],
                      .step_cost = candidate_list[i].evaluations[kind_of_scene(p)],
                      .cost_rate = INFINITY,
                      .rejection = find_rejection(p, i)};
  if (ms_precision_choice_allows(p, c)) c->precision = MSIM_PRECISION_SINGLE;
  if (c->step_cost > 0 && !c->rejection) ms_candidate_set_longest_step(p, i, c);
}

int ms_candidate_order_of_errors(const ms_pilot_run *p, const ms_candidate *c) {
  if (c->collision == MSIM_COLLISION_REFLECT && p->planes_count) return 1;
  if (p->damped && c->method == &ms_verlet) return 1;
  if (p->damped && c->method == &ms_takahashi_imada) return 3;
  return c->method->entry.order;
}

/*------------------------------------- checkpoints ----------------------------------------------*/

void ms_candidate_archive(ms_archive *b, int i, ms_candidate *c) {
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
          (c->control_tol > 0) == ms_candidate_is_controlled(i) &&
          (c->collision == MSIM_COLLISION_REFLECT || c->collision == MSIM_COLLISION_EVENT) &&
          (c->precision == MSIM_PRECISION_DOUBLE || ms_precision_choice_takes(c)),
      "the choice of a method");
}
