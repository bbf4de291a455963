/* stability - frequency bounds, step-size limits, and a linear scene for which both are known
 * exactly */
#ifndef TEST_STABILITY_H
#define TEST_STABILITY_H

#include "methods/methods.h"
#include "scenes.h"

enum { RING = 8 };

/* A closed chain on a line: particles of 1 kg, springs of k = 100 N/m and rest length 0. It is
 * linear, and its highest frequency is omega = sqrt(4 k/m) = 20/s, which is also Gershgorin's
 * bound. */
#define RING_OMEGA 20.0
static inline msim_scene *ring(double damping, double drag) {
  double x[3 * RING] = {0}, v[3 * RING] = {0}, mass[RING], k[RING], rest[RING] = {0}, c[RING];
  int32_t ij[2 * RING];
  unsigned seed = 3;
  for (int i = 0; i < RING; i++) {
    x[3 * i] = i + 0.3 * uniform(&seed), v[3 * i] = uniform(&seed) - 0.5, mass[i] = 1;
    ij[2 * i] = i, ij[2 * i + 1] = (i + 1) % RING, k[i] = 100, c[i] = damping;
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, RING, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, RING, ij, k, rest, c, err));
  assert_ok(msim_scene_set_drag(scene, drag, err));
  return scene;
}

static inline ms_bounds bounds_of(const msim_scene *scene, int sharp) {
  ms_bounds b;
  assert_ok(ms_bounds_compute(scene->data, sharp, &b, err));
  return b;
}

/* 1 if the method has a stability limit and a fixed number of stages. */
static inline int has_limit(const char *method) {
  const ms_integrator *integrator;
  assert_ok(ms_methods_find(method, &integrator, err));
  return integrator->limit && !integrator->stages;
}

static inline double limit_of(const char *method, ms_bounds b) {
  const ms_integrator *integrator;
  assert_ok(ms_methods_find(method, &integrator, err));
  assert_non_null(integrator->limit);
  return integrator->limit(&b);
}

#endif
