/* advice - what to try after a run that a numerical event has ended (msim_sim_advice) */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "methods/methods.h"
#include "sim/island_step.h"
#include "sim/rank_scene.h"

enum { MOST_SENTENCES = 5 };

typedef struct advice {
  msim_sim *sim;
  char *text;
  size_t size, used;
  int sentences, is_full;
} advice;

/* Add one sentence; after one that does not fit none is added. */
static void MS_PRINTF(2, 3) say(advice *a, const char *format, ...) {
  char line[MS_ERROR_LENGTH];
  va_list args;
  va_start(args, format);
  vsnprintf(line, sizeof line, format, args);
  va_end(args);
  const size_t length = strlen(line) + (a->sentences > 0);
  if (a->sentences == MOST_SENTENCES || a->is_full) return;
  a->is_full = a->used + length >= a->size;
  if (a->is_full) return;
  snprintf(a->text + a->used, a->size - a->used, "%s%s", a->sentences ? "\n" : "", line);
  a->used += length, a->sentences++;
}

static const msim_options *options_of(const advice *a) { return &a->sim->config.opt; }

static const ms_integrator *method_of(const advice *a) { return a->sim->config.integrator; }

/*------------------------------------- other methods --------------------------------------------*/

static void say_choose_automatically(advice *a) {
  const ms_scene *s = a->sim->scene;
  const int allows_auto =
      s->nmotions == 0 && !ms_collider_motion_is_there(s) && !ms_scene_has_function(s);
  if (ms_sim_selects(a->sim) || options_of(a)->steps >= 0 || !allows_auto) return;
  say(a, "Set integrator = auto and tol = 1e-4: method and steps are then chosen for the scene.");
}

/* Implicit Euler damps all vibrations, and its Newton iteration minimizes an energy. */
static void say_use_implicit_euler(advice *a) {
  if (method_of(a) == &ms_implicit_euler) return;
  say(a, "Set integrator = implicit-euler: it is stable for every h and damps vibrations.");
}

/* h that velocity Verlet can take: 0.9 of its stability limit, at most the present one; 0: none */
static double verlet_step(msim_sim *sim) {
  if (ms_step_limit_compute(sim, NULL)) return 0;
  return fmin(sim->run.h,
              MS_STABLE_FRACTION * ms_velocity_verlet.limit(&sim->config.step_limit.bounds));
}

static void say_use_verlet(advice *a) {
  const double h = verlet_step(a->sim);
  if (!(h > 0)) return;
  say(a,
      "Set integrator = velocity-verlet and h = %.3g: it keeps the energy of vibrations bounded, "
      "which %s does not.",
      h, method_of(a)->entry.name);
}

static void say_shorten(advice *a) {
  say(a, "Set h = %.3g, a quarter of the present step: errors and changes in a step are smaller.",
      a->sim->run.h / 4);
}

/*------------------------------------- unstable motion ------------------------------------------*/

/* Explicit steps of fixed length: first what the stability limit says */
static void advise_explicit(advice *a) {
  msim_sim *sim = a->sim;
  const ms_step_limit *found = &sim->config.step_limit;
  const int is_known = !method_of(a)->is_multirate && !ms_step_limit_compute(sim, NULL);
  const double limit = is_known ? found->limit : INFINITY, h = MS_STABLE_FRACTION * limit;
  if (limit == 0 || method_of(a)->is_multirate) say_use_verlet(a);
  else if (sim->run.h > h)
    say(a, "Set h = %.3g: that is 0.9 of the stability limit of %s in this scene, %.3g s.", h,
        method_of(a)->entry.name, limit);
  else say_shorten(a);
  say_use_implicit_euler(a);
  say_choose_automatically(a);
}

/* Particles that are mirrored behind a plane gain energy in long steps of stiff springs. */
static void say_mend_impacts(advice *a) {
  if (options_of(a)->collision == MSIM_COLLISION_EVENT || !a->sim->stats.contacts) return;
  say(a, "Set collision = event: impacts are then located inside the step and add no energy.");
}

static void advise_implicit(advice *a) {
  const msim_options *opt = options_of(a);
  say_mend_impacts(a);
  if (opt->indefinite == MSIM_INDEFINITE_SOLVE && !method_of(a)->nonlinear)
    say(a,
        "Set integrator = implicit-euler and indefinite = clamp: the solution of an indefinite "
        "system may grow without bounds.");
  if (a->sim->stats.incomplete_steps > 0)
    say(a,
        "Set solver.max_iterations = %.0f and newton.max_iterations = %.0f: %lld steps ended at a "
        "limit of iterations.",
        fmin(2000, fmax(100, 4.0 * opt->solver_max_iterations)),
        fmin(1000, fmax(100, 4.0 * opt->newton_max_iterations)),
        (long long)a->sim->stats.incomplete_steps);
  say_use_implicit_euler(a);
  say_shorten(a);
  say_choose_automatically(a);
}

static void advise_controlled(advice *a) {
  const double tol = options_of(a)->tol;
  say(a, "Set tol = %.3g: errors of steps have grown, and are then a hundredth.", tol / 100);
  if (method_of(a) != &ms_dop853)
    say(a, "Set integrator = dop853: its error estimate is the most reliable.");
  say_choose_automatically(a);
}

static void advise_unstable(advice *a) {
  if (ms_sim_has_control(a->sim)) advise_controlled(a);
  else if (method_of(a)->entry.implicit) advise_implicit(a);
  else advise_explicit(a);
}

/*------------------------------------- solves ---------------------------------------------------*/

/* An option whose value is tighter than the one that most scenes can keep */
typedef struct tight_option {
  int is_tight;
  const char *set; /* "name = value" */
} tight_option;

/* "a, b and c" of the options that are tight; their number */
static int list_tight_options(const advice *a, size_t size, char *list) {
  enum { USUAL_SOLVER_ITERATIONS = 2000, USUAL_NEWTON_ITERATIONS = 1000 };
  const double REACHABLE = 1e-12;
  const msim_options *opt = options_of(a);
  const ms_solver *solver = a->sim->islands->stepper.solver;
  const int iterates = solver && !solver->linear->factorizes;
  const int newton = method_of(a)->nonlinear || (solver && opt->collision == MSIM_COLLISION_EVENT);
  const tight_option options[] = {
      {iterates && opt->solver_max_iterations < USUAL_SOLVER_ITERATIONS,
       "solver.max_iterations = 2000"},
      {opt->solver_rtol < REACHABLE, "solver.rtol = 1e-8"},
      {newton && opt->newton_max_iterations < USUAL_NEWTON_ITERATIONS,
       "newton.max_iterations = 1000"},
      {newton && opt->newton_rtol < REACHABLE, "newton.rtol = 1e-8"},
      {newton && ms_island_step_count_retries(a->sim) == 0, "newton.retries = 6"},
      {opt->indefinite == MSIM_INDEFINITE_SOLVE, "indefinite = clamp"}};
  int count = 0, left = 0;
  for (size_t i = 0; i < sizeof options / sizeof *options; i++) left += options[i].is_tight;
  list[0] = 0;
  for (size_t i = 0; i < sizeof options / sizeof *options; i++) {
    if (!options[i].is_tight) continue;
    const size_t used = strlen(list);
    const char *separator = count == 0 ? "" : count + 1 == left ? " and " : ", ";
    snprintf(list + used, size - used, "%s%s", separator, options[i].set);
    count++;
  }
  return count;
}

static void advise_not_converged(advice *a) {
  const msim_options *opt = options_of(a);
  const ms_solver *solver = a->sim->islands->stepper.solver;
  char list[256];
  if (ms_sim_has_control(a->sim))
    say(a, "Set tol = %.3g: the present one is below the rounding errors of such short steps.",
        fmax(1e-6, 1000 * opt->tol));
  if (list_tight_options(a, sizeof list, list) > 0)
    say(a, "Set %s: these limits and tolerances are the default.", list);
  if (solver && !solver->linear->factorizes && strcmp(opt->solver, "auto") != 0)
    say(a, "Set solver = auto: it factors where iterations do not converge.");
  if (!ms_sim_has_control(a->sim)) say_shorten(a);
  if (!ms_sim_has_control(a->sim) && opt->incomplete == MSIM_INCOMPLETE_STOP)
    say(a, "Set incomplete = accept: steps are then made with the last iterate, and counted.");
  if (!ms_sim_has_control(a->sim)) say_use_implicit_euler(a);
}

/* Clamped matrices are positive definite: a solver that finds one indefinite is at its limits. */
static void advise_not_spd(advice *a) {
  const msim_options *opt = options_of(a);
  if (opt->indefinite != MSIM_INDEFINITE_CLAMP)
    say(a, "Set indefinite = clamp: such steps are then repeated with a matrix that is definite.");
  else if (strcmp(opt->solver, "auto") != 0)
    say(a, "Set solver = auto: the clamped matrix is positive definite up to rounding.");
  if (opt->jacobian != MSIM_JACOBIAN_CLAMP)
    say(a, "Set jacobian = clamp: the matrix of compressed springs is then always definite.");
  say_shorten(a);
}

msim_status msim_sim_advice(msim_sim *sim, char *text, size_t size) {
  if (!sim || !text || !size) return MSIM_ERR_ARG;
  advice a = {.sim = sim, .text = text, .size = size};
  text[0] = 0;
  const msim_status status = ms_rank_scene_gather(sim, NULL);
  if (status) return status;
  switch (sim->last_status) {
    case MSIM_NOT_SPD:
      advise_not_spd(&a);
      break;
    case MSIM_NOT_CONVERGED:
      advise_not_converged(&a);
      break;
    case MSIM_NOT_FINITE:
    case MSIM_UNSTABLE:
      advise_unstable(&a);
      break;
    default:
      break;
  }
  return MSIM_OK;
}
