#include "step_comparison.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../common/clock.h"

/*------------------------------------- one factorization ----------------------------------------*/

/* Times the factorization alone, by CHOLMOD, on the matrix of the linearly implicit step from the
 * same state, after such a step. */
static int add_factorization(step_comparison *r, const moving_scene *m, double h, double until) {
  const timing_limits once = {.until = until};
  const msim_backend *table;
  if (msim_solver_backend("cholmod", NULL, &table, &r->no_factor) != MSIM_OK) return 0;
  r->linear = solver_comparison_create(m, h, 1e-6, 0, &r->no_factor);
  if (!r->linear) return 0;
  timing_candidate *step = solver_comparison_add_step(r->linear, "cholmod", table, 1);
  timing_candidate *bare = solver_comparison_add_backend(r->linear);
  time_in_turn(step, 1, &once);
  time_in_turn(bare, 1, &once);
  const timing_candidate *without_result = step->nsamples == 0 ? step : bare;
  snprintf(r->no_factor.text, sizeof r->no_factor.text, "%.*s", (int)sizeof r->no_factor.text - 1,
           without_result->failed ? without_result->reason : NO_TIME);
  if (bare->nsamples == 0) return 0;
  r->factor = &r->all[r->count++];
  *r->factor = *bare;
  return 1;
}

/*------------------------------------- each on its own ------------------------------------------*/

/* One decade above the newton.rtol that reached the first accuracy: a method that converges equally
 * begins there. */
static int rtol_above(const accuracy_record *p) {
  const int found = isfinite(p->reached[0].seconds) ? p->reached[0].setting : 0;
  return found > 2 ? found - 2 : 0;
}

static void run_newton_sweeps(step_comparison *r, const step_plan *plan,
                              const method_limits allowed[2]) {
  static const char *const solvers[] = {"pcg", "cholmod"};
  static const char *const names[] = {"Newton, pcg", "Newton, cholmod"};
  newton_sweep_plan limits = {.stride = plan->is_quick ? 2 : 1};
  for (int i = 0; i < 2; i++) {
    limits.allowed = allowed[i];
    limits.allowed.seconds = plan->newton;
    if (i == BY_CHOLMOD && plan->is_quick) limits.first = rtol_above(&r->records[BY_PCG]);
    accuracy_record_begin(&r->records[i], names[i]);
    newton_sweep_run(&r->step, solvers[i], &limits, &r->newton[i], &r->records[i]);
  }
}

/* Time to the smallest error that was reached; NAN: none. */
static double seconds_to_best(const accuracy_record *p) {
  double seconds = NAN;
  for (int a = 0; a < ACCURACIES; a++)
    if (isfinite(p->reached[a].seconds)) seconds = p->reached[a].seconds;
  return seconds;
}

/* Records the error of the iterate, outside the time of the method. Returns whether to continue. */
static int record_iterate(const nonlinear_step *step, const descent *d, double seconds,
                          int64_t iterations, accuracy_record *p) {
  enum { NOW_AND_THEN = 16 };
  const double *v = potential_velocity(d->p, d->x);
  const iterate_record here = {
      .seconds = seconds, .error = nonlinear_step_error(step, v), .iterations = iterations};
  if (accuracy_record_add(p, &here)) return 0;
  if (iterations % NOW_AND_THEN != 0 || !is_another_minimum(step, v)) return 1;
  accuracy_record_end(p, END_OTHER_MINIMUM, "it converged to another minimum");
  return 0;
}

/* Iterates until all accuracies are reached or the time is up. The time of the method itself
 * counts, not that of evaluating its error. */
static void run_descent(const nonlinear_step *step, const method_limits *allowed, descent *d,
                        accuracy_record *p) {
  double start = clock_seconds();
  d->method->begin(d);
  double spent = clock_seconds() - start;
  for (int64_t i = 0; record_iterate(step, d, spent, i, p) &&
                      accuracy_record_may_continue(p, allowed, spent, spent);) {
    start = clock_seconds();
    const int found = d->method->iterate(d);
    spent += clock_seconds() - start;
    i++;
    if (found) continue;
    accuracy_record_end(p, END_FAILED, "the line search found no decrease");
    return;
  }
}

/* Repeats this number of iterations from the start. Returns the time in s. */
static double repeat_descent(descent *d, int64_t iterations) {
  const double start = clock_seconds();
  d->method->begin(d);
  for (int64_t i = 0; i < iterations; i++) d->method->iterate(d);
  return clock_seconds() - start;
}

/* The limit is at least 4 times the time of Newton's method: enough to show them slower. */
static void run_descents(step_comparison *r, const step_plan *plan, double until) {
  static const descent_method *const methods[] = {&projective_dynamics, &lbfgs};
  const double ours = seconds_to_best(&r->records[BY_PCG]);
  const method_limits allowed = {.seconds = fmax(plan->descent, 4 * ours), .until = until};
  r->descent_limit = allowed.seconds;
  const moving_scene *m = r->step.moving;
  const int made = laplacian_make(&m->view, r->step.h, &r->matrix) &&
                   potential_make(&m->view, m->x, m->v, r->step.h, &r->matrix, &r->potential);
  for (int i = 0; i < 2; i++) {
    accuracy_record *p = &r->records[BY_PROJECTIVE_DYNAMICS + i];
    accuracy_record_begin(p, methods[i]->name);
    if (made && descent_make(methods[i], &r->potential, &r->descents[i]))
      run_descent(&r->step, &allowed, &r->descents[i], p);
    else accuracy_record_end(p, END_SKIPPED, r->matrix.err.text);
  }
}

/*------------------------------------- in turn --------------------------------------------------*/

static int repeat_step_run(timing_candidate *c, timing_sample *s) {
  const struct step_run *run = c->data;
  step_comparison *r = run->comparison;
  const iterate_record *at = &r->records[run->method].reached[run->accuracy];
  msim_error err;
  if (run->method >= BY_PROJECTIVE_DYNAMICS) {
    s->whole = repeat_descent(&r->descents[run->method - BY_PROJECTIVE_DYNAMICS], at->iterations);
    return 1;
  }
  const msim_status status =
      newton_sweep_step(&r->newton[run->method], at->setting, &s->whole, &err);
  return status ? candidate_fail(c, err.text) : 1;
}

/* A run that reached several accuracies at once is repeated once for all. */
static timing_candidate *find_same_run(const step_comparison *r, int method, int accuracy) {
  const iterate_record *at = r->records[method].reached;
  for (int a = 0; a < accuracy; a++)
    if (at[a].setting == at[accuracy].setting && at[a].iterations == at[accuracy].iterations)
      return r->reached[method][a];
  return NULL;
}

/* The run that found it is the warm-up. */
static void add_reached_accuracy(step_comparison *r, int method, int accuracy) {
  const accuracy_record *p = &r->records[method];
  const iterate_record *at = &p->reached[accuracy];
  struct step_run *run = &r->runs[method * ACCURACIES + accuracy];
  if (!isfinite(at->seconds)) return;
  r->reached[method][accuracy] = find_same_run(r, method, accuracy);
  if (r->reached[method][accuracy]) return;
  timing_candidate *c = &r->all[r->count++];
  *run = (struct step_run){r, method, accuracy};
  candidate_init(c, p->name, "step", repeat_step_run, run);
  c->nsamples = 1;
  c->samples[0].whole = c->total_seconds = at->seconds;
  r->reached[method][accuracy] = c;
}

step_comparison *step_comparison_run(const moving_scene *m, double h, const step_plan *plan,
                                     double until, msim_error *err) {
  step_comparison *r = calloc(1, sizeof *r);
  snprintf(err->text, sizeof err->text, "out of memory for the comparison");
  if (!r) return NULL;
  const int factors = add_factorization(r, m, h, until);
  const method_limits allowed[2] = {
      {.seconds = plan->solution, .until = until},
      {.seconds = plan->solution,
       .until = until,
       .iteration = factors ? median_of(r->factor, factor_seconds) : 0},
  };
  if (!nonlinear_step_solve(m, h, allowed, &r->step, err)) {
    step_comparison_free(r);
    return NULL;
  }
  run_newton_sweeps(r, plan, allowed);
  run_descents(r, plan, until);
  for (int method = 0; method < METHODS; method++)
    for (int a = 0; a < ACCURACIES; a++) add_reached_accuracy(r, method, a);
  const timing_limits turns = limits_until(plan->turns, until);
  time_in_turn(r->all, r->count, &turns);
  return r;
}

void step_comparison_free(step_comparison *r) {
  if (!r) return;
  for (int i = 0; i < 2; i++) {
    newton_sweep_free(&r->newton[i]);
    descent_free(&r->descents[i]);
  }
  potential_free(&r->potential);
  laplacian_free(&r->matrix);
  solver_comparison_free(r->linear);
  nonlinear_step_free(&r->step);
  free(r);
}
