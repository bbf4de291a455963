/* rank_scenes - scenes that ranks divide: regular, shuffled and irregular ones */
#ifndef TEST_RANK_SCENES_H
#define TEST_RANK_SCENES_H

#include <math.h>

#include "scenes.h"

/* n random points in a cube, in random order, each joined to near ones by springs at rest or
 * stretched, some damped, some twice; 1 in 40 is pinned, particle 0 is a hub. damping: N s/m */
static inline msim_scene *random_mesh(int32_t n, unsigned seed, double damping) {
  const double g[3] = {0.3, 0, -9.81}, reach = 1.3 * cbrt(2.0 / n);
  double *x = malloc(3 * (size_t)n * sizeof *x), *v = malloc(3 * (size_t)n * sizeof *v),
         *mass = malloc((size_t)n * sizeof *mass);
  msim_scene *scene;
  assert_non_null(x);
  assert_non_null(v);
  assert_non_null(mass);
  for (int32_t i = 0; i < 3 * n; i++) x[i] = uniform(&seed), v[i] = uniform(&seed) - 0.5;
  for (int32_t i = 0; i < n; i++) mass[i] = (0.5 + uniform(&seed)) / n;
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3 && i % 40 == 7; c++) v[3 * i + c] = 0;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, n, x, v, mass, err));
  for (int32_t i = 0; i < n; i++) {
    if (i % 40 == 7) assert_ok(msim_scene_pin(scene, 1, &i, err));
    for (int32_t j = i + 1; j < n; j++) {
      double d2 = 0;
      for (int c = 0; c < 3; c++)
        d2 += (x[3 * i + c] - x[3 * j + c]) * (x[3 * i + c] - x[3 * j + c]);
      if (d2 > reach * reach && (i > 0 || j % 7)) continue;
      const int32_t ij[2] = {j % 3 ? i : j, j % 3 ? j : i};
      const double k = 20 * (0.5 + uniform(&seed)), rest = sqrt(d2) * (j % 2 ? 1 : 0.9),
                   c = damping * (j % 5 == 0);
      for (int twice = 0; twice <= (j % 23 == 0); twice++)
        assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &c, err));
    }
  }
  assert_ok(msim_scene_set_gravity(scene, g, err));
  free(x), free(v), free(mass);
  return scene;
}

/* Move two corners of a square cloth, pinned in it, along a polyline. */
static inline void move_corners(msim_scene *cloth, int32_t side) {
  const int32_t corners[2] = {0, side - 1};
  const double t[3] = {0, 0.003, 0.009},
               x[18] = {0, 0, 0, 1, 0, 0, 0.1, 0, 0.1, 0.9, 0, 0.1, 0, 0.2, 0, 1, 0.1, 0};
  const msim_motion motion = {
      .size = sizeof motion, .n = 2, .particles = corners, .nt = 3, .t = t, .x = x};
  assert_ok(msim_scene_add_motion(cloth, &motion, err));
}

#endif
