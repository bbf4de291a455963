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

/* 200 steps: the energy less work never grows by more than `rounding` of the largest energy, and is
 * kept where impacts are elastic; no particle is inside by more than `depth` m. */
static inline void expect_balance(int scene, msim_sim *sim, int elastic, double rounding,
                                  double depth) {
  double last = balance_of(sim), largest = 1;
  for (int step = 0; step < 200; step++) {
    assert_ok(msim_sim_step(sim, 1, err));
    const double now = balance_of(sim);
    largest = fmax(largest, fmax(fabs(energies_of(sim).work), energies_of(sim).kinetic));
    if (!(now <= last + rounding * largest) || (elastic && !(now >= last - rounding * largest)))
      fail_msg("scene %d, step %d: %.17g J after %.17g J", scene, step, now, last);
    if (!(least_distance(sim) >= -depth))
      fail_msg("scene %d, step %d: %g m inside", scene, step, -least_distance(sim));
    last = now;
  }
}

#endif
