#include "step_race.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/*------------------------------------- one factorisation ----------------------------------------*/

/* Times the factorization alone, by CHOLMOD, on the matrix of the linearly implicit step from the
 * same state, after such a step. */
static int enter_factor(step_race *r, const moving *m, double h, double until) {
  const patience once = {.until = until};
  const msim_backend *table;
  if (msim_solver_backend("cholmod", NULL, &table, &r->no_factor) != MSIM_OK) return 0;
  r->linear = race_new(m, h, 1e-6, 0, &r->no_factor);
  if (!r->linear) return 0;
  contestant *step = race_add_step(r->linear, "cholmod", table, 1);
  contestant *bare = race_add_bare(r->linear);
  contest(step, 1, &once);
  contest(bare, 1, &once);
  const contestant *culprit = step->n == 0 ? step : bare;
  snprintf(r->no_factor.text, sizeof r->no_factor.text, "%.*s", (int)sizeof r->no_factor.text - 1,
           culprit->failed ? culprit->reason : "there was no time left");
  if (bare->n == 0) return 0;
  r->factor = &r->all[r->count++];
  *r->factor = *bare;
  return 1;
}

/*------------------------------------- each on its own ------------------------------------------*/

/* One decade above the newton.rtol that reached the first accuracy: a method that converges equally
 * begins there. */
static int rung_below(const pursuit *p) {
  const int found = isfinite(p->at[0].seconds) ? p->at[0].rung : 0;
  return found > 2 ? found - 2 : 0;
}

static void climb_both(step_race *r, const step_plan *plan, const allowance allowed[2]) {
  static const char *const solvers[] = {"pcg", "cholmod"};
  static const char *const names[] = {"Newton, pcg", "Newton, cholmod"};
  ladder_plan limits = {.stride = plan->is_quick ? 2 : 1};
  for (int i = 0; i < 2; i++) {
    limits.allowed = allowed[i];
    limits.allowed.seconds = plan->ladder;
    if (i == BY_CHOLMOD && plan->is_quick) limits.first = rung_below(&r->ladders[BY_PCG].pursuit);
    ladder_climb(&r->step, names[i], solvers[i], &limits, &r->ladders[i]);
    r->pursuits[i] = &r->ladders[i].pursuit;
  }
}

/* Time to the smallest error that was reached; NAN: none. */
static double seconds_to_best(const pursuit *p) {
  double seconds = NAN;
  for (int a = 0; a < ACCURACIES; a++)
    if (isfinite(p->at[a].seconds)) seconds = p->at[a].seconds;
  return seconds;
}

/* The limit is at least 4 times the time of Newton's method, enough to show that they are
 * slower. */
static void descend_both(step_race *r, const step_plan *plan, double until) {
  static const descent_method *const methods[] = {&projective_dynamics, &lbfgs};
  const double ours = seconds_to_best(r->pursuits[BY_PCG]);
  const allowance allowed = {.seconds = fmax(plan->descent, 4 * ours), .until = until};
  r->descent_limit = allowed.seconds;
  const int made = laplacian_make(r->step.moving, r->step.h, &r->matrix) &&
                   potential_make(&r->step, &r->matrix, &r->potential);
  for (int i = 0; i < 2; i++) {
    descent *d = &r->descents[i];
    r->pursuits[BY_PROJECTIVE_DYNAMICS + i] = &d->pursuit;
    if (made && descent_make(methods[i], &r->potential, d)) {
      descent_pursue(d, &allowed);
    } else {
      pursuit_begin(&d->pursuit, methods[i]->name);
      pursuit_end(&d->pursuit, LEFT_OUT, r->matrix.err.text);
    }
  }
}

/*------------------------------------- in turn --------------------------------------------------*/

static int run_again(contestant *c, sample *s) {
  const struct step_run *run = c->data;
  step_race *r = run->race;
  const arrival *at = &r->pursuits[run->method]->at[run->accuracy];
  msim_error err;
  if (run->method >= BY_PROJECTIVE_DYNAMICS) {
    s->whole = descent_repeat(&r->descents[run->method - BY_PROJECTIVE_DYNAMICS], at->iterations);
    return 1;
  }
  const msim_status status = ladder_step(&r->ladders[run->method], at->rung, &s->whole, &err);
  if (status) snprintf(c->reason, sizeof c->reason, "%s", err.text);
  return !status;
}

/* A run that reached several accuracies at once is repeated once for all. */
static contestant *find_same_run(const step_race *r, int method, int accuracy) {
  const arrival *at = r->pursuits[method]->at;
  for (int a = 0; a < accuracy; a++)
    if (at[a].rung == at[accuracy].rung && at[a].iterations == at[accuracy].iterations)
      return r->arrived[method][a];
  return NULL;
}

/* The run that found it is the warm-up. */
static void enter(step_race *r, int method, int accuracy) {
  const pursuit *p = r->pursuits[method];
  const arrival *at = &p->at[accuracy];
  struct step_run *run = &r->runs[method * ACCURACIES + accuracy];
  if (!isfinite(at->seconds)) return;
  r->arrived[method][accuracy] = find_same_run(r, method, accuracy);
  if (r->arrived[method][accuracy]) return;
  contestant *c = &r->all[r->count++];
  *run = (struct step_run){r, method, accuracy};
  *c = (contestant){.family = p->name, .measure = "step", .run = run_again, .data = run, .n = 1};
  snprintf(c->name, sizeof c->name, "%.31s", p->name);
  c->residual = NAN;
  c->samples[0].whole = c->spent = at->seconds;
  r->arrived[method][accuracy] = c;
}

step_race *step_race_run(const moving *m, double h, const step_plan *plan, double until,
                         msim_error *err) {
  step_race *r = calloc(1, sizeof *r);
  snprintf(err->text, sizeof err->text, "out of memory for a race");
  if (!r) return NULL;
  const int factors = enter_factor(r, m, h, until);
  const allowance allowed[2] = {
      {.seconds = plan->solution, .until = until},
      {.seconds = plan->solution,
       .until = until,
       .iteration = factors ? median_of(r->factor, factor_seconds) : 0},
  };
  if (!nonlinear_make(m, h, allowed, &r->step, err)) {
    step_race_free(r);
    return NULL;
  }
  climb_both(r, plan, allowed);
  descend_both(r, plan, until);
  for (int method = 0; method < METHODS; method++)
    for (int a = 0; a < ACCURACIES; a++) enter(r, method, a);
  patience turns = plan->turns;
  turns.until = until;
  contest(r->all, r->count, &turns);
  return r;
}

void step_race_free(step_race *r) {
  if (!r) return;
  for (int i = 0; i < 2; i++) {
    ladder_free(&r->ladders[i]);
    descent_free(&r->descents[i]);
  }
  potential_free(&r->potential);
  laplacian_free(&r->matrix);
  race_free(r->linear);
  nonlinear_free(&r->step);
  free(r);
}
