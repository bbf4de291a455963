/* stiff_bodies - stiff bodies that fall on colliders, shared by tests of contact at long steps */
#ifndef TEST_STIFF_BODIES_H
#define TEST_STIFF_BODIES_H

#include <math.h>

#include "base/vec3.h"
#include "colliders.h"

enum { SIDE = 16, SCENES = 4 };

/* A cloth on a sphere, on a box, a rope over a capsule, a jelly in a bowl, without damping */
static inline msim_scene *stiff_body(int i, double k, double e, double mu) {
  static const int32_t pinned[2] = {0, SIDE - 1};
  const double at[3] = {0}, along[3] = {0, 0.6, 0};
  msim_scene *scene = new_scene();
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = SIDE,
                            .columns = SIDE,
                            .origin = {-0.5, -0.5, 0.32},
                            .row = {1, 0, 0.01},
                            .column = {0, 1, 0.02},
                            .mass = 0.3,
                            .k_structural = k,
                            .k_shear = k / 3,
                            .k_bend = k / 15,
                            .npinned = i == SCENES ? 2 : 0,
                            .pinned = pinned};
  const msim_rope rope = {.size = sizeof rope,
                          .n = 30,
                          .from = {-0.8, 0.1, 0.5},
                          .to = {0.6, 0, 0.5},
                          .mass = 0.2,
                          .k = k};
  const msim_lattice jelly = {.size = sizeof jelly,
                              .n = {4, 4, 4},
                              .origin = {0.1, -0.1, -0.4},
                              .extent = {0.4, 0.4, 0.4},
                              .mass = 1,
                              .k = k};
  if (i == 2) assert_ok(msim_scene_add_rope(scene, &rope, err));
  else if (i == 3) assert_ok(msim_scene_add_lattice(scene, &jelly, err));
  else assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  if (i == 1) add(scene, box(0.05, 0, 0, 0.5, e, mu), 0);
  else if (i == 2) add(scene, round_bar(MSIM_COLLIDER_CAPSULE, at, along, 0.2, e, mu), 0);
  else if (i == 3) add(scene, sphere(0, 0, 0, 1, e, mu), 1);
  else add(scene, sphere(0, 0, 0, 0.3, e, mu), 0);
  return scene;
}

/* The distance of x from the collider, negative inside */
static inline double distance_from(int i, const double *x) {
  const double d[3] = {fabs(x[0] - 0.05) - 0.25, fabs(x[1]) - 0.25, fabs(x[2]) - 0.25};
  const double from_axis[3] = {x[0], fmax(0, fabs(x[1]) - 0.6), x[2]};
  if (i == 1) return fmax(d[0], fmax(d[1], d[2]));
  if (i == 2) return ms_vec3_norm(from_axis) - 0.2;
  return i == 3 ? 1 - ms_vec3_norm(x) : ms_vec3_norm(x) - 0.3;
}

#endif
