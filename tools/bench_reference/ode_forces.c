#include "ode_forces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "ode.h"

enum { TIMES = 5, CALLS = 200 };

/*------------------------------------- orders ---------------------------------------------------*/

/* Converts from x0 y0 z0 x1 ... to arrays by components. */
static void split_components(const ode_forces *k, const double *from, double *to) {
  const int32_t n = k->view.nparticles;
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3; c++) to[c * n + i] = from[3 * i + c];
}

void ode_forces_interleave(const ode_forces *k, const double *from, double *to) {
  const int32_t n = k->view.nparticles;
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3; c++) to[3 * i + c] = k->by_runs ? from[c * n + i] : from[3 * i + c];
}

static void store_initial_state(ode_forces *k) {
  const int32_t n = k->view.nparticles;
  const double *const from[] = {k->view.x, k->view.v};
  double *const to[] = {k->x, k->v};
  for (int i = 0; i < 2; i++) {
    if (k->by_runs) split_components(k, from[i], to[i]);
    else memcpy(to[i], from[i], 3 * (size_t)n * sizeof(double));
  }
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3; c++)
      k->inverse[k->by_runs ? c * n + i : 3 * i + c] = k->view.pinned[i] ? 0 : 1 / k->view.mass[i];
}

/*------------------------------------- forces ---------------------------------------------------*/

void ode_forces_evaluate(const ode_forces *k, int part, const double *x, const double *v,
                         double *f) {
  if (part == STIFF_FORCES) spring_runs_force(&k->split.stiff, x, v, f);
  else if (part == OTHER_FORCES) spring_runs_force(&k->split.others, x, v, f);
  else if (k->by_runs) spring_runs_force(&k->runs, x, v, f);
  else msim_sim_force(k->sim, x, v, f);
}

static double time_forces(const ode_forces *k, int part, const double *x, const double *v,
                          double *f) {
  double best = INFINITY;
  for (int i = 0; i < TIMES; i++) {
    const double start = clock_seconds();
    for (int call = 0; call < CALLS; call++) ode_forces_evaluate(k, part, x, v, f);
    best = fmin(best, (clock_seconds() - start) / CALLS);
  }
  return best;
}

/* max |f - flat| / max |flat| over free particles; spring_runs_force sets forces on pinned ones,
 * too. */
static double compare_forces(const ode_forces *k, const double *f, const double *flat) {
  const int32_t n = k->view.nparticles;
  double apart = 0, largest = 0;
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3 && !k->view.pinned[i]; c++) {
      apart = fmax(apart, fabs(f[c * n + i] - flat[3 * i + c]));
      largest = fmax(largest, fabs(flat[3 * i + c]));
    }
  return apart / largest;
}

/* Times and compares both implementations. f: scratch, 6n. */
static void choose_implementation(ode_forces *k, const double *x, const double *v, double *f) {
  double *flat = f + 3 * (size_t)k->view.nparticles;
  k->flat_s = time_forces(k, ALL_FORCES, x, v, flat);
  k->by_runs = 1;
  split_components(k, x, k->x);
  split_components(k, v, k->v);
  k->runs_s = time_forces(k, ALL_FORCES, k->x, k->v, f);
  k->difference = compare_forces(k, f, flat);
  k->by_runs = (k->runs_s < k->flat_s || k->split.by) && k->difference < 1e-9;
}

/* Times the parts of split forces and compares their sum with the whole. */
static void check_split(ode_forces *k, double *f) {
  const size_t n = 3 * (size_t)k->view.nparticles;
  double *other = f + n, apart = 0, largest = 0;
  k->stiff_s = time_forces(k, STIFF_FORCES, k->x, k->v, f);
  k->others_s = time_forces(k, OTHER_FORCES, k->x, k->v, other);
  for (size_t i = 0; i < n; i++) f[i] += other[i];
  ode_forces_evaluate(k, ALL_FORCES, k->x, k->v, other);
  for (size_t i = 0; i < n; i++) {
    apart = fmax(apart, fabs(f[i] - other[i]));
    largest = fmax(largest, fabs(other[i]));
  }
  k->split_difference = apart / largest;
  if (!k->by_runs || !(k->split_difference < 1e-9)) k->split.by = 0;
}

/*------------------------------------- a sim ----------------------------------------------------*/

static void time_sim(const msim_scene *scene, double h, ode_forces *k) {
  msim_options options;
  msim_sim *sim = NULL;
  msim_options_init(&options, sizeof options);
  options.integrator = "velocity-verlet";
  options.threads = 1;
  options.h = h;
  options.steps = TIMES * CALLS;
  const double start = clock_seconds();
  if (msim_sim_create(scene, &options, &sim, NULL) != MSIM_OK) return;
  k->create_s = fmin(k->create_s, clock_seconds() - start);
  for (int i = 0; i < TIMES; i++) {
    const double begun = clock_seconds();
    if (msim_sim_step(sim, CALLS, NULL) != MSIM_OK) break;
    k->step_s = fmin(k->step_s, (clock_seconds() - begun) / CALLS);
  }
  msim_sim_destroy(sim);
}

int ode_forces_create(const msim_scene *scene, msim_sim *sim, int split_by, double stiff,
                      const double *x, const double *v, double h, ode_forces *k) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  const size_t bytes = 3 * (size_t)view.nparticles * sizeof(double);
  *k = (ode_forces){.view = view,
                    .sim = sim,
                    .x = malloc(bytes),
                    .v = malloc(bytes),
                    .inverse = malloc(bytes),
                    .create_s = INFINITY,
                    .step_s = INFINITY,
                    .stiff_s = NAN,
                    .others_s = NAN,
                    .split_difference = NAN};
  double *f = malloc(2 * bytes);
  const int made = spring_runs_create(&view, &k->runs) &&
                   force_split_create(&view, split_by, stiff, &k->split) && k->x && k->v &&
                   k->inverse && f;
  if (made) {
    choose_implementation(k, x, v, f);
    if (k->split.by) check_split(k, f);
    store_initial_state(k);
    for (int i = 0; i < TIMES; i++) time_sim(scene, h, k);
  }
  free(f);
  return made;
}

void ode_forces_free(ode_forces *k) {
  spring_runs_free(&k->runs);
  force_split_free(&k->split);
  free(k->x), free(k->v), free(k->inverse);
  *k = (ode_forces){.by_runs = 0};
}
