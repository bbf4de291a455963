/* event_options - options, methods and a scene that the tests of collision = event share */
#ifndef TEST_EVENT_OPTIONS_H
#define TEST_EVENT_OPTIONS_H

#include <math.h>

#include "scenes.h"

static inline msim_options event_options(const char *method, double h) {
  msim_options opt = options(method, h);
  opt.collision = MSIM_COLLISION_EVENT;
  opt.solver_rtol = 1e-13;
  opt.newton_rtol = 1e-12;
  return opt;
}

/* 1 if the method does not take collision = event; then the i-th method that takes it, NULL past
 * the end. */
static inline int refuses_events(const char *method) {
  return refuses_planes(method) || strcmp(method, "verlet") == 0 || strcmp(method, "respa") == 0;
}

static inline const char *event_method_at(int32_t i) {
  const char *name = NULL;
  for (int32_t m = 0; (name = method_at(m)) != NULL; m++)
    if (!refuses_events(name) && i-- == 0) break;
  return name;
}

/* 64 particles just above a rough floor, from which they bounce all the time */
static inline msim_scene *bouncing_block(void) {
  const double g[3] = {-4.48, -1.52, -8.59};
  const msim_lattice block = {.size = sizeof block,
                              .n = {4, 4, 4},
                              .origin = {0, 0, 0.0207},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 740,
                              .damping = 0.97};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 1, 0.3);
  return scene;
}

#endif
