/* moving_colliders - motions of colliders, the energy balance and distances, shared by tests */
#ifndef TEST_MOVING_COLLIDERS_H
#define TEST_MOVING_COLLIDERS_H

#include <math.h>

#include "colliders.h"
#include "physics/signed_distance.h"
#include "sim/sim.h"

static inline void set_motion(msim_scene *scene, int32_t collider, int32_t nt, const double *t,
                              const double *x, const double *rotation, int32_t interpolation) {
  const msim_collider_motion m = {.size = sizeof m,
                                  .collider = collider,
                                  .nt = nt,
                                  .t = t,
                                  .x = x,
                                  .rotation = rotation,
                                  .interpolation = interpolation};
  assert_ok(msim_scene_set_collider_motion(scene, &m, err));
}

/* The last collider moves from x with the velocity u for 100 s, and rotates by w in each second. */
static inline void set_uniform(msim_scene *scene, const double x[3], const double u[3],
                               const double w[3]) {
  const double t[2] = {0, 100};
  double points[6], rotation[6] = {0};
  for (int c = 0; c < 3; c++) {
    points[c] = x[c], points[3 + c] = x[c] + 100 * u[c];
    rotation[3 + c] = w ? 100 * w[c] : 0;
  }
  set_motion(scene, scene->data->ncolliders - 1, 2, t, points, w ? rotation : NULL, 0);
}

static inline msim_energy energies_of(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  return e;
}

static inline double balance_of(msim_sim *sim) {
  const msim_energy e = energies_of(sim);
  return e.total - e.work;
}

/* The least distance of a particle from all colliders at the time of the state: negative inside */
static inline double least_distance(msim_sim *sim) {
  const ms_scene *s = sim->scene;
  const msim_state now = state_of(sim);
  double least = INFINITY, unused[3];
  for (int32_t i = 0; i < s->ncolliders; i++) {
    ms_solid room;
    const ms_solid *solid = ms_collider_motion_place(s, i, (ms_instant){.t = now.t}, &room);
    for (int32_t p = 0; p < now.n; p++)
      if (!s->pinned[p]) least = fmin(least, ms_signed_distance(solid, now.x + 3 * p, unused));
  }
  return least;
}

#endif
