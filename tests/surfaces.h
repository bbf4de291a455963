/* surfaces - scenes with self-contact, and runs of them that are looked at after every step */
#ifndef TEST_SURFACES_H
#define TEST_SURFACES_H

#include "intersections.h"
#include "scenes.h"

#define THICKNESS 0.01

static inline msim_scene *surfaces(double g, double friction) {
  msim_scene *scene;
  const double gravity[3] = {0, 0, -g};
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  if (friction >= 0) assert_ok(msim_scene_set_self_contact(scene, THICKNESS, friction, err));
  return scene;
}

/* side^2 particles, with edge vectors of the whole cloth, that all move with v */
static inline void add_cloth(msim_scene *scene, int32_t side, double k, const double origin[3],
                             const double row[3], const double column[3], const double v[3]) {
  msim_cloth cloth = {.size = sizeof cloth,
                      .rows = side,
                      .columns = side,
                      .mass = 0.3,
                      .k_structural = k,
                      .k_shear = k,
                      .k_bend = 0.02 * k,
                      .damping = 0.005};
  msim_scene *alone;
  msim_scene_view view = {.size = sizeof view}, whole = {.size = sizeof whole};
  memcpy(cloth.origin, origin, sizeof cloth.origin);
  memcpy(cloth.row, row, sizeof cloth.row);
  memcpy(cloth.column, column, sizeof cloth.column);
  assert_ok(msim_scene_create(NULL, &alone, err));
  assert_ok(msim_scene_add_cloth(alone, &cloth, err));
  msim_scene_get(alone, &view), msim_scene_get(scene, &whole);
  const int32_t first = whole.nparticles;
  double *all = malloc(3 * sizeof *all * (size_t)view.nparticles);
  int32_t *ij = malloc(2 * sizeof *ij * (size_t)view.nsprings),
          *faces = malloc(3 * sizeof *faces * (size_t)view.nfaces);
  for (int32_t i = 0; i < 3 * view.nparticles; i++) all[i] = v ? v[i % 3] : 0;
  for (int32_t i = 0; i < 2 * view.nsprings; i++) ij[i] = first + view.ij[i];
  for (int32_t i = 0; i < 3 * view.nfaces; i++) faces[i] = first + view.faces[i];
  assert_ok(msim_scene_add_particles(scene, view.nparticles, view.x, all, view.mass, err));
  assert_ok(msim_scene_add_springs(scene, view.nsprings, ij, view.k, NULL, view.damping, err));
  assert_ok(msim_scene_add_faces(scene, view.nfaces, faces, err));
  free(all), free(ij), free(faces);
  msim_scene_destroy(alone);
}

/* Horizontal, of edge length `size` around (x, y, z) */
static inline void add_sheet(msim_scene *scene, int32_t side, double k, double size, double x,
                             double y, double z, const double v[3]) {
  const double origin[3] = {x - size / 2, y - size / 2, z}, row[3] = {0, size, 0},
               column[3] = {size, 0, 0};
  add_cloth(scene, side, k, origin, row, column, v);
}

/* Three particles of 1 kg and springs without damping */
static inline void add_triangle(msim_scene *scene, double k, const double x[9], const double v[3]) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  const int32_t a = view.nparticles, corners[3] = {a, a + 1, a + 2},
                ij[6] = {a, a + 1, a + 1, a + 2, a, a + 2};
  const double all[9] = {v[0], v[1], v[2], v[0], v[1], v[2], v[0], v[1], v[2]}, mass[3] = {1, 1, 1},
               stiffness[3] = {k, k, k};
  assert_ok(msim_scene_add_particles(scene, 3, x, all, mass, err));
  assert_ok(msim_scene_add_springs(scene, 3, ij, stiffness, NULL, NULL, err));
  assert_ok(msim_scene_add_faces(scene, 1, corners, err));
}

static inline void add_sphere(msim_scene *scene, double x, double y, double z, double radius) {
  const msim_collider sphere = {.size = sizeof sphere,
                                .type = MSIM_COLLIDER_SPHERE,
                                .center = {x, y, z},
                                .radius = radius,
                                .friction = 0.3};
  assert_ok(msim_scene_add_collider(scene, &sphere, err));
}

static inline double total_energy(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  return e.kinetic + e.elastic + e.gravitational;
}

/* Make n steps; after each one no faces, and no face and segment, intersect. Returns the largest
 * energy. */
static inline double run_without_intersections(msim_sim *sim, const msim_scene *scene, int64_t n,
                                               int32_t nsegments, const int32_t *segments) {
  msim_scene_view view = {.size = sizeof view};
  double most = -INFINITY;
  msim_scene_get(scene, &view);
  for (int64_t i = 0; i < n; i++) {
    assert_ok(msim_sim_step(sim, 1, err));
    const int64_t count =
        count_intersections(state_of(sim).x, view.nfaces, view.faces, nsegments, segments);
    if (count) fail_msg("step %lld: %lld intersections", (long long)i + 1, (long long)count);
    most = fmax(most, total_energy(sim));
  }
  return most;
}

#endif
