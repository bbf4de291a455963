/* colliders - colliders and scenes of bodies that meet them, which several tests share */
#ifndef TEST_COLLIDERS_H
#define TEST_COLLIDERS_H

#include "scenes.h"

static inline msim_collider sphere(double x, double y, double z, double radius, double e,
                                   double mu) {
  return (msim_collider){.size = sizeof(msim_collider),
                         .type = MSIM_COLLIDER_SPHERE,
                         .center = {x, y, z},
                         .radius = radius,
                         .restitution = e,
                         .friction = mu};
}

static inline msim_collider box(double x, double y, double z, double side, double e, double mu) {
  msim_collider c = sphere(x, y, z, 0, e, mu);
  c.type = MSIM_COLLIDER_BOX;
  for (int i = 0; i < 3; i++) c.extent[i] = side;
  return c;
}

/* From x - along to x + along */
static inline msim_collider round_bar(int32_t type, const double x[3], const double along[3],
                                      double radius, double e, double mu) {
  msim_collider c = sphere(0, 0, 0, radius, e, mu);
  c.type = type;
  for (int i = 0; i < 3; i++) c.from[i] = x[i] - along[i], c.to[i] = x[i] + along[i];
  return c;
}

static inline void add(msim_scene *scene, msim_collider c, int inside) {
  c.inside = inside;
  assert_ok(msim_scene_add_collider(scene, &c, err));
}

static const double down[3] = {0, 0, -9.81};

static inline msim_scene *new_scene(void) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_set_gravity(scene, down, err));
  return scene;
}

/* Of 2 kg, 0.05 m above z = 0 */
static inline msim_scene *falling_block(double k) {
  const msim_lattice block = {.size = sizeof block,
                              .n = {3, 3, 3},
                              .origin = {-0.1, -0.1, 0.05},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 2,
                              .k = k};
  msim_scene *scene = new_scene();
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  return scene;
}

static inline void add_cloth(msim_scene *scene, double z, double e) {
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 12,
                            .columns = 12,
                            .origin = {-0.5, -0.5, z},
                            .row = {1, 0, 0.01},
                            .column = {0, 1, 0.02},
                            .mass = 0.3,
                            .k_structural = 300,
                            .k_shear = 100,
                            .k_bend = 20,
                            .damping = 0.02};
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  add(scene, sphere(0, 0, 0, 0.3, e, 0.2), 0);
  add(scene, box(0.1, 0, -0.6, 0.8, e, 0.2), 0);
}

static inline void add_rope(msim_scene *scene, double z, double e) {
  const double at[3] = {3, 0, 0}, along[3] = {0, 0.6, 0};
  const msim_rope rope = {.size = sizeof rope,
                          .n = 30,
                          .from = {2.2, 0.1, z},
                          .to = {3.6, 0, z},
                          .mass = 0.2,
                          .k = 400,
                          .damping = 0.02};
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  add(scene, round_bar(MSIM_COLLIDER_CAPSULE, at, along, 0.2, e, 0.3), 0);
}

static inline void add_jelly(msim_scene *scene, double z, double e) {
  const double at[3] = {-3, 0, -0.9}, up[3] = {0, 0, 0.1};
  const msim_lattice jelly = {.size = sizeof jelly,
                              .n = {5, 5, 5},
                              .origin = {-3.2, -0.1, z},
                              .extent = {0.4, 0.4, 0.4},
                              .mass = 1,
                              .k = 500,
                              .damping = 0.1};
  assert_ok(msim_scene_add_lattice(scene, &jelly, err));
  add(scene, sphere(0, 0, 0, 5, e, 0.1), 1);
  add(scene, round_bar(MSIM_COLLIDER_CYLINDER, at, up, 0.3, e, 0.1), 0);
}

/* A cloth on a sphere and a box, a rope over a capsule, a jelly on a cylinder, all in a bowl */
static inline msim_scene *bodies(double z, double e) {
  msim_scene *scene = new_scene();
  add_cloth(scene, z, e), add_rope(scene, z, e), add_jelly(scene, z, e);
  return scene;
}

#endif
