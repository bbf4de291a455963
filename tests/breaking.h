/* breaking - laws by which springs break */
#ifndef TEST_BREAKING_H
#define TEST_BREAKING_H

#include "scenes.h"

enum { MOST = 150 }; /* springs */

static const double never = 1e30; /* a threshold that no spring exceeds */

static inline msim_scene_view view_of(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  return view;
}

static inline int32_t add_law(msim_scene *scene, msim_law law, double strain, double force) {
  int32_t index;
  law.break_strain = strain, law.break_force = force;
  assert_ok(msim_scene_add_law(scene, &law, &index, err));
  return index;
}

static inline int32_t add_linear(msim_scene *scene, double strain, double force) {
  const msim_law law = {.size = sizeof law, .kind = MSIM_LAW_LINEAR};
  return add_law(scene, law, strain, force);
}

static inline int is_broken(const msim_sim *sim, int32_t spring) {
  uint8_t broken[MOST];
  assert_int_equal(msim_sim_broken(sim, broken), MSIM_OK);
  return broken[spring];
}

static inline msim_energy energy_of(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  return e;
}

#endif
