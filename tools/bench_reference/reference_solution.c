#include "reference_solution.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../common/clock.h"

/*------------------------------------- distances ------------------------------------------------*/

/* sqrt(sum m |a - b|^2 / sum m); b NULL: 0 */
static double weighted_rms_distance(const reference_solution *t, const double *a, const double *b) {
  double sum = 0;
  for (int32_t i = 0; i < 3 * t->view.nparticles; i++) {
    const double d = a[i] - (b ? b[i] : 0);
    sum += t->view.mass[i / 3] * d * d;
  }
  return sqrt(sum / t->mass);
}

static msim_energy measure_energy(const reference_solution *t, const double *x, const double *v) {
  msim_energy energy = {.size = sizeof energy};
  msim_state state = {.size = sizeof state, .n = t->view.nparticles, .x = x, .v = v};
  energy.total = NAN;
  if (msim_sim_set_state(t->sim, &state, NULL) == MSIM_OK) msim_sim_energy(t->sim, &energy);
  return energy;
}

solution_errors reference_solution_errors(const reference_solution *t, const double *x,
                                          const double *v) {
  const msim_energy here = measure_energy(t, x, v);
  double square = 0;
  for (int c = 0; c < 3; c++) {
    const double d = here.momentum[c] - t->energy.momentum[c];
    square += d * d;
  }
  return (solution_errors){.error = weighted_rms_distance(t, x, t->end.x) / t->motion,
                           .energy = fabs(here.total - t->energy.total) / t->kinetic,
                           .momentum = sqrt(square) / (t->mass * t->speed)};
}

int reference_solution_resolves(const reference_solution *t, double error) {
  return error >= 10 * t->error;
}

int reference_solution_supports(const reference_solution *t, double claim) {
  return 10 * t->error <= claim && 10 * t->error * t->growth <= claim;
}

/*------------------------------------- scales ---------------------------------------------------*/

/* Updates the maxima of motion, speed and kinetic energy. */
static void update_motion_scales(msim_sim *sim, void *data) {
  reference_solution *t = data;
  msim_state state = {.size = sizeof state};
  msim_energy energy = {.size = sizeof energy};
  msim_sim_state(sim, &state);
  t->motion = fmax(t->motion, weighted_rms_distance(t, state.x, t->view.x));
  t->speed = fmax(t->speed, weighted_rms_distance(t, state.v, NULL));
  msim_sim_energy(sim, &energy);
  t->kinetic = fmax(t->kinetic, energy.kinetic);
}

static scene_run make_scene_run(const reference_solution *t, const char *integrator, int64_t steps,
                                int32_t threads, double until) {
  return (scene_run){.scene = t->scene,
                     .integrator = integrator,
                     .t_end = t->t_end,
                     .steps = steps,
                     .threads = threads,
                     .collision = t->impacts ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT,
                     .until = until};
}

static int fail_reference_solution(reference_solution *t, const char *why) {
  snprintf(t->err.text, sizeof t->err.text, "%.*s", (int)sizeof t->err.text - 1, why);
  return 0;
}

/* Number of steps of half the stability limit. */
static int64_t first_steps(const reference_solution *t) {
  return (int64_t)ceil(2 * t->t_end / t->limit);
}

static int measure_motion(reference_solution *t, double until) {
  scene_run run = make_scene_run(t, "velocity-verlet", first_steps(t), 1, until);
  run.on_frame = update_motion_scales;
  run.data = t;
  if (!scene_run_execute(&run, &t->end)) return fail_reference_solution(t, t->end.reason);
  return t->motion > 0 || fail_reference_solution(t, "nothing moves");
}

/*------------------------------------- solution -------------------------------------------------*/

static int run_reference(reference_solution *t, const char *integrator, int64_t steps,
                         int32_t threads, double until, run_result *e) {
  const scene_run run = make_scene_run(t, integrator, steps, threads, until);
  return scene_run_execute(&run, e) || fail_reference_solution(t, e->reason);
}

/* Halves until the error is at rounding level or stops decreasing, or the next halving would take
 * too long. work: two results. */
static int halve_steps(reference_solution *t, int32_t threads, double seconds, double until,
                       run_result work[2]) {
  const double start = clock_seconds();
  int64_t steps = first_steps(t);
  t->error = INFINITY;
  if (!run_reference(t, "dop853", steps, threads, until, &t->end)) return 0;
  while (t->error > 1e-13) {
    const double before = clock_seconds();
    steps *= 2;
    if (!run_reference(t, "dop853", steps, threads, until, &work[0]) ||
        !run_reference(t, t->comparison_method, steps, threads, until, &work[1]))
      return isfinite(t->error);
    const double apart = weighted_rms_distance(t, work[0].x, work[1].x) / t->motion;
    const double change = weighted_rms_distance(t, work[0].x, t->end.x) / t->motion;
    const double error = fmax(apart, change);
    if (error > t->error) break;
    const run_result old = t->end;
    t->end = work[0], work[0] = old;
    t->steps = steps;
    t->error = error;
    if (clock_seconds() - start + 2 * (clock_seconds() - before) > seconds) break;
  }
  return 1;
}

/*------------------------------------- growth ---------------------------------------------------*/

/* The initial positions; free coordinates are disturbed at random by 1e-10 D in root mean
 * square. */
static void disturb(const reference_solution *t, double *x) {
  const int32_t n = 3 * t->view.nparticles;
  unsigned seed = 1;
  for (int32_t i = 0; i < n; i++) {
    seed = seed * 1664525u + 1013904223u;
    x[i] = t->view.pinned[i / 3] ? 0 : (seed >> 8) / 16777216.0 - 0.5;
  }
  const double scale = 1e-10 * t->motion / weighted_rms_distance(t, x, NULL);
  for (int32_t i = 0; i < n; i++) x[i] = t->view.x[i] + scale * x[i];
}

/* Compares two runs with the same steps, so that errors of rounding and of the method cancel. */
static int measure_disturbance_growth(reference_solution *t, int32_t threads, double until,
                                      run_result work[2]) {
  scene_run run = make_scene_run(t, "dop853", first_steps(t), threads, until);
  double *x = malloc(3 * (size_t)t->view.nparticles * sizeof *x);
  const msim_state start = {.size = sizeof start, .n = t->view.nparticles, .x = x, .v = t->view.v};
  if (x) disturb(t, x);
  int ok = x && scene_run_execute(&run, &work[0]);
  run.start = &start;
  ok = ok && scene_run_execute(&run, &work[1]);
  if (ok)
    t->growth =
        weighted_rms_distance(t, work[1].x, work[0].x) / weighted_rms_distance(t, x, t->view.x);
  free(x);
  return ok || fail_reference_solution(t, "a disturbed run failed");
}

/*------------------------------------- all of it ------------------------------------------------*/

static double bounding_box_side(const msim_scene_view *view) {
  double extent = 0;
  for (int c = 0; c < 3; c++) {
    double low = INFINITY, high = -INFINITY;
    for (int32_t i = 0; i < view->nparticles; i++) {
      low = fmin(low, view->x[3 * i + c]);
      high = fmax(high, view->x[3 * i + c]);
    }
    extent = fmax(extent, high - low);
  }
  return extent;
}

static int measure_scene(reference_solution *t) {
  msim_options options;
  msim_options_init(&options, sizeof options);
  options.integrator = "velocity-verlet";
  options.steps = 1;
  options.threads = 1;
  if (msim_sim_create(t->scene, &options, &t->sim, &t->err)) return 0;
  msim_scene_get(t->scene, &t->view);
  for (int32_t i = 0; i < t->view.nparticles; i++) t->mass += t->view.mass[i];
  t->extent = bounding_box_side(&t->view);
  t->limit = longest_step(t->scene, "velocity-verlet", &t->err);
  return isfinite(t->limit) && (run_result_create(t->view.nparticles, &t->end) ||
                                fail_reference_solution(t, "out of memory"));
}

int reference_solution_compute(const msim_scene *scene, double t_end, int impacts, int damped,
                               int32_t threads, double seconds, double until,
                               reference_solution *t) {
  *t = (reference_solution){.scene = scene,
                            .view = {.size = sizeof t->view},
                            .impacts = impacts,
                            .t_end = t_end,
                            .comparison_method = damped ? "rk4" : "rkn6"};
  run_result work[2] = {{.x = NULL}, {.x = NULL}};
  int made = measure_scene(t);
  for (int i = 0; i < 2 && made; i++)
    made = run_result_create(t->view.nparticles, &work[i]) ||
           fail_reference_solution(t, "out of memory");
  made = made && measure_motion(t, until) && halve_steps(t, threads, seconds, until, work);
  if (made) t->energy = measure_energy(t, t->end.x, t->end.v);
  made = made && measure_disturbance_growth(t, threads, until, work);
  for (int i = 0; i < 2; i++) run_result_free(&work[i]);
  return made;
}

void reference_solution_free(reference_solution *t) {
  run_result_free(&t->end);
  msim_sim_destroy(t->sim);
}
