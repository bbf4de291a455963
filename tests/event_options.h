/* event_options - options and methods that the tests of collision = event share */
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

#endif
