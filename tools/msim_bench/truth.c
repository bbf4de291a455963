#include "truth.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "interrupt.h"

/*------------------------------------- distances ------------------------------------------------*/

/* sqrt(sum m |a - b|^2 / sum m); b NULL: 0 */
static double distance(const truth *t, const double *a, const double *b) {
  double sum = 0;
  for (int32_t i = 0; i < 3 * t->view.nparticles; i++) {
    const double d = a[i] - (b ? b[i] : 0);
    sum += t->view.mass[i / 3] * d * d;
  }
  return sqrt(sum / t->mass);
}

static msim_energy energy_of(const truth *t, const double *x, const double *v) {
  msim_energy energy = {.size = sizeof energy};
  msim_state state = {.size = sizeof state, .n = t->view.nparticles, .x = x, .v = v};
  energy.total = NAN;
  if (msim_sim_set_state(t->judge, &state, NULL) == MSIM_OK) msim_sim_energy(t->judge, &energy);
  return energy;
}

verdict truth_judge(const truth *t, const double *x, const double *v) {
  const msim_energy here = energy_of(t, x, v);
  double square = 0;
  for (int c = 0; c < 3; c++) {
    const double d = here.momentum[c] - t->energy.momentum[c];
    square += d * d;
  }
  return (verdict){.error = distance(t, x, t->end.x) / t->motion,
                   .energy = fabs(here.total - t->energy.total) / t->kinetic,
                   .momentum = sqrt(square) / (t->mass * t->speed)};
}

int truth_can_tell(const truth *t, double error) { return error >= 10 * t->error; }

int truth_allows(const truth *t, double claim) {
  return 10 * t->error <= claim && 10 * t->error * t->growth <= claim;
}

/*------------------------------------- scales ---------------------------------------------------*/

/* Updates the maxima of motion, speed and kinetic energy. */
static void see_motion(msim_sim *sim, void *data) {
  truth *t = data;
  msim_state state = {.size = sizeof state};
  msim_energy energy = {.size = sizeof energy};
  msim_sim_state(sim, &state);
  t->motion = fmax(t->motion, distance(t, state.x, t->view.x));
  t->speed = fmax(t->speed, distance(t, state.v, NULL));
  msim_sim_energy(sim, &energy);
  t->kinetic = fmax(t->kinetic, energy.kinetic);
}

static trial trial_of(const truth *t, const char *integrator, int64_t steps, int32_t threads,
                      double until) {
  return (trial){.scene = t->scene,
                 .integrator = integrator,
                 .t_end = t->t_end,
                 .steps = steps,
                 .threads = threads,
                 .collision = t->kind->impacts ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT,
                 .until = until};
}

static int fail(truth *t, const char *why) {
  snprintf(t->err.text, sizeof t->err.text, "%.*s", (int)sizeof t->err.text - 1, why);
  return 0;
}

/* Number of steps of half the stability limit. */
static int64_t first_steps(const truth *t) { return (int64_t)ceil(2 * t->t_end / t->limit); }

static int measure_motion(truth *t, double until) {
  trial run = trial_of(t, "velocity-verlet", first_steps(t), 1, until);
  run.see = see_motion;
  run.data = t;
  if (!trial_run(&run, &t->end)) return fail(t, t->end.reason);
  return t->motion > 0 || fail(t, "nothing moves");
}

/*------------------------------------- the truth ------------------------------------------------*/

enum { THE_ONE, THE_OTHER, FAMILIES };

/* Final states of both methods, with the present and the previous step. */
typedef struct search {
  truth *t;
  ending now[FAMILIES], before[FAMILIES];
} search;

static int run_both(search *s, int64_t steps, int32_t threads, double until) {
  const char *const integrators[FAMILIES] = {"dop853", s->t->other};
  for (int i = 0; i < FAMILIES; i++) {
    const ending spare = s->before[i];
    s->before[i] = s->now[i];
    s->now[i] = spare;
    const trial run = trial_of(s->t, integrators[i], steps, threads, until);
    if (!trial_run(&run, &s->now[i])) return fail(s->t, s->now[i].reason);
  }
  return 1;
}

static void keep(truth *t, const ending *e) {
  const size_t bytes = 3 * (size_t)t->view.nparticles * sizeof *e->x;
  memcpy(t->end.x, e->x, bytes);
  memcpy(t->end.v, e->v, bytes);
}

/* Halves until the error is at rounding level or stops decreasing, or the next halving would take
 * too long. */
static int halve(search *s, int32_t threads, double seconds, double until) {
  const double start = wall_seconds();
  truth *t = s->t;
  int64_t steps = first_steps(t);
  if (!run_both(s, steps, threads, until)) return 0;
  t->error = INFINITY;
  for (double spent = 0; t->error > 1e-13;) {
    const double before = wall_seconds();
    if (!run_both(s, steps *= 2, threads, until)) return isfinite(t->error);
    const double apart = distance(t, s->now[THE_ONE].x, s->now[THE_OTHER].x) / t->motion;
    const double change = distance(t, s->now[THE_ONE].x, s->before[THE_ONE].x) / t->motion;
    const double error = fmax(apart, change);
    if (error > t->error) break;
    keep(t, &s->now[THE_ONE]);
    t->steps = steps;
    t->error = error;
    spent = wall_seconds() - before;
    if (wall_seconds() - start + 2 * spent > seconds) break;
  }
  return 1;
}

static int find(truth *t, int32_t threads, double seconds, double until) {
  search s = {.t = t};
  int made = 1;
  for (int i = 0; i < FAMILIES; i++) {
    made &= ending_make(t->view.nparticles, &s.now[i]);
    made &= ending_make(t->view.nparticles, &s.before[i]);
  }
  made = made ? halve(&s, threads, seconds, until) : fail(t, "out of memory");
  for (int i = 0; i < FAMILIES; i++) {
    ending_free(&s.now[i]);
    ending_free(&s.before[i]);
  }
  return made;
}

/*------------------------------------- growth ---------------------------------------------------*/

/* The initial positions; free coordinates are disturbed at random by 1e-10 D in root mean
 * square. */
static void disturb(const truth *t, double *x) {
  const int32_t n = 3 * t->view.nparticles;
  unsigned seed = 1;
  for (int32_t i = 0; i < n; i++) {
    seed = seed * 1664525u + 1013904223u;
    x[i] = t->view.pinned[i / 3] ? 0 : (seed >> 8) / 16777216.0 - 0.5;
  }
  const double scale = 1e-10 * t->motion / distance(t, x, NULL);
  for (int32_t i = 0; i < n; i++) x[i] = t->view.x[i] + scale * x[i];
}

/* Compares two runs with the same steps, so that errors of rounding and of the method cancel. */
static int measure_growth(truth *t, int32_t threads, double until) {
  ending ends[2] = {{.x = NULL}, {.x = NULL}};
  trial run = trial_of(t, "dop853", first_steps(t), threads, until);
  double *x = malloc(3 * (size_t)t->view.nparticles * sizeof *x);
  msim_state start = {.size = sizeof start, .n = t->view.nparticles, .x = x, .v = t->view.v};
  int ok = x && ending_make(start.n, &ends[0]) && ending_make(start.n, &ends[1]);
  if (ok) disturb(t, x);
  ok = ok && trial_run(&run, &ends[0]);
  run.start = &start;
  ok = ok && trial_run(&run, &ends[1]);
  if (ok) t->growth = distance(t, ends[1].x, ends[0].x) / distance(t, x, t->view.x);
  for (int i = 0; i < 2; i++) ending_free(&ends[i]);
  free(x);
  return ok || fail(t, "a disturbed run failed");
}

/*------------------------------------- all of it ------------------------------------------------*/

static void fill_masses(truth *t) {
  const int32_t n = t->view.nparticles;
  t->inverse = calloc(3 * (size_t)n, sizeof *t->inverse);
  for (int32_t i = 0; i < n; i++) t->mass += t->view.mass[i];
  for (int32_t i = 0; i < 3 * n && t->inverse; i++)
    if (!t->view.pinned[i / 3]) t->inverse[i] = 1 / t->view.mass[i / 3];
}

static double extent_of(const msim_scene_view *view) {
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

static int build(truth *t, int quick) {
  msim_options options;
  msim_options_init(&options, sizeof options);
  options.integrator = "velocity-verlet";
  options.steps = 1;
  options.threads = 1;
  if (msim_scene_create(NULL, &t->scene, &t->err) ||
      t->kind->build(t->kind->sides[quick], t->scene, &t->err) ||
      msim_sim_create(t->scene, &options, &t->judge, &t->err))
    return 0;
  msim_scene_get(t->scene, &t->view);
  fill_masses(t);
  t->extent = extent_of(&t->view);
  t->limit = longest_step(t->scene, "velocity-verlet", &t->err);
  return isfinite(t->limit) &&
         ((t->inverse && ending_make(t->view.nparticles, &t->end)) || fail(t, "out of memory"));
}

int truth_find(const precision_scene *kind, int quick, int32_t threads, double seconds,
               double until, truth *t) {
  *t = (truth){.kind = kind,
               .view = {.size = sizeof t->view},
               .t_end = kind->ends[quick],
               .other = kind->damped ? "rk4" : "rkn6"};
  if (!build(t, quick) || !measure_motion(t, until) || !find(t, threads, seconds, until)) return 0;
  t->energy = energy_of(t, t->end.x, t->end.v);
  return measure_growth(t, threads, until);
}

void truth_free(truth *t) {
  ending_free(&t->end);
  free(t->inverse);
  msim_sim_destroy(t->judge);
  msim_scene_destroy(t->scene);
}
