/* angle_scenes - scenes with angular springs */
#ifndef TEST_ANGLE_SCENES_H
#define TEST_ANGLE_SCENES_H

#include <math.h>
#include <stdlib.h>

#include "scenes.h"

#define PI 3.14159265358979323846

/* n particles along x, 0.1 m apart, with springs and, at each inner one, an angular spring; damping
 * of both; planar: bent in a plane */
typedef struct chain {
  int32_t n;
  double k, bend, damping;
  int planar;
} chain;

static inline msim_scene *make_chain(chain c) {
  msim_scene *scene;
  const double damping = c.damping, dashpot = c.damping * 0.01;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t i = 0; i < c.n; i++) {
    const double x[3] = {0.1 * i, 0, 0}, mass = 0.01 + 0.002 * (i % 3);
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  }
  for (int32_t i = 0; i + 1 < c.n; i++)
    assert_ok(msim_scene_add_springs(scene, 1, (int32_t[]){i, i + 1}, &c.k, NULL, &damping, err));
  for (int32_t i = 0; i + 2 < c.n; i++)
    assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){i, i + 1, i + 2}, &c.bend, NULL, &dashpot,
                                    err));
  return scene;
}

/* Positions and velocities of a chain that is bent in space and moves */
static inline void bend_state(int32_t n, double *x, double *v) {
  for (int32_t i = 0; i < n; i++) {
    const double s = 0.1 * i;
    x[3 * i] = s - 0.02 * s * s, x[3 * i + 1] = 0.04 * sin(9 * s), x[3 * i + 2] = 0.2 * s * s;
    v[3 * i] = 0.1 * cos(5 * s), v[3 * i + 1] = 0.3 * sin(4 * s), v[3 * i + 2] = -0.2 * s;
  }
}

/* A scene with the particles of another one in a bent state, and its springs and angles */
static inline msim_scene *bent_scene(chain c) {
  msim_scene *like = make_chain(c), *scene;
  msim_scene_view w = {.size = sizeof w};
  double *x = calloc(6 * (size_t)c.n, sizeof *x), *v = x + 3 * c.n;
  msim_scene_get(like, &w);
  bend_state(c.n, x, v);
  for (int32_t i = 0; i < c.n && c.planar; i++) x[3 * i + 2] = v[3 * i + 2] = 0;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, c.n, x, v, w.mass, err));
  assert_ok(msim_scene_add_springs(scene, w.nsprings, w.ij, w.k, w.rest, w.damping, err));
  assert_ok(msim_scene_add_angles(scene, w.nangles, w.ijk, w.angle_k, w.angle_rest, w.angle_damping,
                                  err));
  free(x);
  msim_scene_destroy(like);
  return scene;
}

static inline msim_energy energy_of(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_ok(msim_sim_energy(sim, &e));
  return e;
}

/* A cloth of side^2 particles with angular springs along rows and columns */
static inline msim_scene *bending_cloth(int32_t side, double k, double bend, double damping) {
  msim_scene *scene = hanging_cloth(side, k, damping);
  for (int32_t r = 0; r < side; r++)
    for (int32_t c = 0; c + 2 < side; c++) {
      const int32_t along[3] = {side * r + c, side * r + c + 1, side * r + c + 2};
      const int32_t across[3] = {side * c + r, side * (c + 1) + r, side * (c + 2) + r};
      assert_ok(msim_scene_add_angles(scene, 1, along, &bend, NULL, &damping, err));
      assert_ok(msim_scene_add_angles(scene, 1, across, &bend, NULL, &damping, err));
    }
  return scene;
}

static inline void run_to(msim_sim *sim) { assert_ok(msim_sim_run(sim, NULL, NULL, err)); }

static inline msim_options accurate(double t_end) {
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-13, opt.steps = -1, opt.t_end = t_end;
  return opt;
}

/* 1 if the method takes angular springs, damped if `damped`. */
static inline int takes_angles(const char *method, int damped) {
  return strcmp(method, "respa") != 0 && !(damped && takes_positions_only(method));
}

#endif
