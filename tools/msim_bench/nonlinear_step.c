#include "nonlinear_step.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"

msim_options newton_options(double h, double rtol, const char *solver) {
  msim_options options;
  msim_options_init(&options, sizeof options);
  options.integrator = "implicit-euler";
  options.h = h;
  options.solver = solver;
  options.solver_max_iterations = MAX_ITERATIONS;
  options.newton_rtol = rtol;
  options.newton_retries = 0;
  options.threads = 1;
  return options;
}

void nonlinear_step_settle(moving_scene *m, double h) {
  enum { STEPS = 3 };
  const msim_options options = newton_options(h, 1e-6, "pcg");
  const size_t bytes = 3 * (size_t)m->view.nparticles * sizeof *m->x;
  msim_state state = {.size = sizeof state};
  msim_sim *sim = NULL;
  msim_status status = msim_sim_create(m->scene, &options, &sim, NULL);
  if (!status) status = msim_sim_set_state(sim, &m->state, NULL);
  if (!status && msim_sim_step(sim, STEPS, NULL) >= 0) {
    msim_sim_state(sim, &state);
    memcpy(m->x, state.x, bytes);
    memcpy(m->v, state.v, bytes);
  }
  msim_sim_destroy(sim);
}

/*------------------------------------- sizes ----------------------------------------------------*/

/* |a - b| */
static double mass_weighted_distance(const moving_scene *m, const double *a, const double *b) {
  double sum = 0;
  for (int32_t i = 0; i < 3 * m->view.nparticles; i++) {
    const double d = a[i] - b[i];
    sum += m->view.mass[i / 3] * d * d;
  }
  return sqrt(sum);
}

/* |v - v(t) - h M^-1 F(x + h v)|; F is 0 where a particle is pinned */
static double step_residual(const nonlinear_step *s, const double *v) {
  const moving_scene *m = s->moving;
  const int32_t n = 3 * m->view.nparticles;
  for (int32_t i = 0; i < n; i++) s->x[i] = m->x[i] + s->h * v[i];
  msim_sim_force(s->sim, s->x, v, s->force);
  for (int32_t i = 0; i < n; i++) s->x[i] = m->v[i] + s->h / m->view.mass[i / 3] * s->force[i];
  return mass_weighted_distance(m, v, s->x);
}

double nonlinear_step_error(const nonlinear_step *s, const double *v) {
  return mass_weighted_distance(s->moving, v, s->v) / s->change;
}

/* The residual at v, relative to that at v = v(t) */
static double relative_residual(const nonlinear_step *s, const double *v) {
  return step_residual(s, v) / s->start;
}

int is_another_minimum(const nonlinear_step *s, const double *v) {
  return nonlinear_step_error(s, v) > accuracies[0] && relative_residual(s, v) < SOLVED_RESIDUAL;
}

/*------------------------------------- solution -------------------------------------------------*/

/* Makes the step with at most `most` iterations in a new sim, s->sim. */
static msim_status step_within(int32_t most, nonlinear_step *s, msim_error *err) {
  msim_options options = newton_options(s->h, 1e-12, s->solver);
  options.newton_max_iterations = most;
  msim_sim_destroy(s->sim);
  s->sim = NULL;
  msim_status status = msim_sim_create(s->moving->scene, &options, &s->sim, err);
  if (!status) status = msim_sim_set_state(s->sim, &s->moving->state, err);
  return status ? status : msim_sim_step(s->sim, 1, err);
}

/* Raises the iteration limit while the step does not converge and the time suffices. */
static msim_status step_patiently(const method_limits *a, nonlinear_step *s, msim_error *err) {
  enum { FIRST = 6, MOST = 2000 };
  method_limits known = *a;
  int32_t most, next = affordable_iterations(a, FIRST);
  msim_status status;
  do {
    const double start = clock_seconds();
    most = next;
    status = step_within(most, s, err);
    known.iteration = (clock_seconds() - start) / most;
    next = affordable_iterations(&known, 4 * most < MOST ? 4 * most : MOST);
  } while (status == MSIM_NOT_CONVERGED && next > most && !is_interrupted());
  return status;
}

/* Returns 0 if the step does not converge, and sets err. */
static int solve_by(const char *solver, const method_limits *a, nonlinear_step *s,
                    msim_error *err) {
  const moving_scene *m = s->moving;
  msim_state end = {.size = sizeof end};
  msim_stats stats = {.size = sizeof stats};
  s->solver = solver;
  if (step_patiently(a, s, err) != MSIM_OK) return 0;
  msim_sim_stats(s->sim, &stats);
  msim_sim_state(s->sim, &end);
  memcpy(s->v, end.v, 3 * (size_t)m->view.nparticles * sizeof *s->v);
  s->iterations = stats.newton_iterations;
  s->change = mass_weighted_distance(m, s->v, m->v);
  s->start = step_residual(s, m->v);
  s->residual = relative_residual(s, s->v);
  if (s->residual < SOLVED_RESIDUAL) return 1;
  snprintf(err->text, sizeof err->text, "the relative residual is %.2g, above 1e-9", s->residual);
  return 0;
}

int nonlinear_step_solve(const moving_scene *m, double h, const method_limits allowed[2],
                         nonlinear_step *s, msim_error *err) {
  static const char *const solvers[] = {"pcg", "cholmod"};
  const size_t bytes = 3 * (size_t)m->view.nparticles * sizeof *s->v;
  msim_error why[2];
  *s = (nonlinear_step){
      .moving = m, .h = h, .v = malloc(bytes), .x = malloc(bytes), .force = malloc(bytes)};
  snprintf(err->text, sizeof err->text, "out of memory for the solution");
  if (!s->v || !s->x || !s->force) return 0;
  for (int i = 0; i < 2; i++)
    if (is_interrupted() || solve_by(solvers[i], &allowed[i], s, &why[i])) return !is_interrupted();
  snprintf(err->text, sizeof err->text,
           "Newton's method did not converge; with pcg: %.400s; with cholmod: %.400s", why[0].text,
           why[1].text);
  return 0;
}

void nonlinear_step_free(nonlinear_step *s) {
  msim_sim_destroy(s->sim);
  free(s->v);
  free(s->x);
  free(s->force);
  *s = (nonlinear_step){0};
}
