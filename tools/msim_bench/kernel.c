#include "kernel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "interrupt.h"
#include "ode.h"

enum { TIMES = 5, CALLS = 200 };

/*------------------------------------- orders ---------------------------------------------------*/

/* Converts from x0 y0 z0 x1 ... to arrays by components. */
static void fold(const kernel *k, const double *from, double *to) {
  const int32_t n = k->truth->view.nparticles;
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3; c++) to[c * n + i] = from[3 * i + c];
}

void kernel_unfold(const kernel *k, const double *from, double *to) {
  const int32_t n = k->truth->view.nparticles;
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3; c++) to[3 * i + c] = k->by_runs ? from[c * n + i] : from[3 * i + c];
}

static void keep_start(kernel *k) {
  const truth *t = k->truth;
  const double *const from[] = {t->view.x, t->view.v, t->inverse};
  double *const to[] = {k->x, k->v, k->inverse};
  for (int i = 0; i < 3; i++) {
    if (k->by_runs) fold(k, from[i], to[i]);
    else memcpy(to[i], from[i], 3 * (size_t)t->view.nparticles * sizeof(double));
  }
}

/*------------------------------------- forces ---------------------------------------------------*/

void kernel_force(const kernel *k, int part, const double *x, const double *v, double *f) {
  if (part == STIFF_FORCES) runs_force(&k->split.stiff, x, v, f);
  else if (part == OTHER_FORCES) runs_force(&k->split.others, x, v, f);
  else if (k->by_runs) runs_force(&k->runs, x, v, f);
  else msim_sim_force(k->truth->judge, x, v, f);
}

static double time_forces(const kernel *k, int part, const double *x, const double *v, double *f) {
  double best = INFINITY;
  for (int i = 0; i < TIMES && !is_interrupted(); i++) {
    const double start = wall_seconds();
    for (int call = 0; call < CALLS; call++) kernel_force(k, part, x, v, f);
    best = fmin(best, (wall_seconds() - start) / CALLS);
  }
  return best;
}

/* max |f - flat| / max |flat| over free particles; runs_force sets forces on pinned ones, too. */
static double compare(const kernel *k, const double *f, const double *flat) {
  const int32_t n = k->truth->view.nparticles;
  double apart = 0, largest = 0;
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3 && !k->truth->view.pinned[i]; c++) {
      apart = fmax(apart, fabs(f[c * n + i] - flat[3 * i + c]));
      largest = fmax(largest, fabs(flat[3 * i + c]));
    }
  return apart / largest;
}

/* Times and compares both implementations at the end of the run, where springs are strained. f:
 * scratch, 6n. */
static void choose(kernel *k, double *f) {
  const truth *t = k->truth;
  double *flat = f + 3 * (size_t)t->view.nparticles;
  k->flat_s = time_forces(k, ALL_FORCES, t->end.x, t->end.v, flat);
  k->by_runs = 1;
  fold(k, t->end.x, k->x);
  fold(k, t->end.v, k->v);
  k->runs_s = time_forces(k, ALL_FORCES, k->x, k->v, f);
  k->difference = compare(k, f, flat);
  k->by_runs = (k->runs_s < k->flat_s || k->split.by) && k->difference < 1e-9;
}

/* Times the parts of split forces and compares their sum with the whole. */
static void check_split(kernel *k, double *f) {
  const size_t n = 3 * (size_t)k->truth->view.nparticles;
  double *other = f + n, apart = 0, largest = 0;
  k->stiff_s = time_forces(k, STIFF_FORCES, k->x, k->v, f);
  k->others_s = time_forces(k, OTHER_FORCES, k->x, k->v, other);
  for (size_t i = 0; i < n; i++) f[i] += other[i];
  kernel_force(k, ALL_FORCES, k->x, k->v, other);
  for (size_t i = 0; i < n; i++) {
    apart = fmax(apart, fabs(f[i] - other[i]));
    largest = fmax(largest, fabs(other[i]));
  }
  k->split_difference = apart / largest;
  if (!k->by_runs || !(k->split_difference < 1e-9)) k->split.by = 0;
}

/*------------------------------------- a sim ----------------------------------------------------*/

static void time_sim(kernel *k) {
  const truth *t = k->truth;
  msim_options options;
  msim_sim *sim = NULL;
  msim_options_init(&options, sizeof options);
  options.integrator = "velocity-verlet";
  options.threads = 1;
  options.h = t->limit / 4;
  options.steps = TIMES * CALLS;
  const double start = wall_seconds();
  if (msim_sim_create(t->scene, &options, &sim, NULL) != MSIM_OK) return;
  k->create_s = fmin(k->create_s, wall_seconds() - start);
  for (int i = 0; i < TIMES && !is_interrupted(); i++) {
    const double begun = wall_seconds();
    if (msim_sim_step(sim, CALLS, NULL) != MSIM_OK) break;
    k->step_s = fmin(k->step_s, (wall_seconds() - begun) / CALLS);
  }
  msim_sim_destroy(sim);
}

int kernel_make(const truth *t, kernel *k) {
  const size_t bytes = 3 * (size_t)t->view.nparticles * sizeof(double);
  *k = (kernel){.truth = t,
                .x = malloc(bytes),
                .v = malloc(bytes),
                .inverse = malloc(bytes),
                .create_s = INFINITY,
                .step_s = INFINITY,
                .stiff_s = NAN,
                .others_s = NAN,
                .split_difference = NAN};
  double *f = malloc(2 * bytes);
  const int made = runs_make(&t->view, &k->runs) && split_make(t->kind, &t->view, &k->split) &&
                   k->x && k->v && k->inverse && f;
  if (made) {
    choose(k, f);
    if (k->split.by) check_split(k, f);
    keep_start(k);
    for (int i = 0; i < TIMES && !is_interrupted(); i++) time_sim(k);
  }
  free(f);
  return made;
}

void kernel_free(kernel *k) {
  runs_free(&k->runs);
  split_free(&k->split);
  free(k->x), free(k->v), free(k->inverse);
  *k = (kernel){.by_runs = 0};
}
