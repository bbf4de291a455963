/* sampled_colliders - height fields and grids of signed distances, which several tests share */
#ifndef TEST_SAMPLED_COLLIDERS_H
#define TEST_SAMPLED_COLLIDERS_H

#include "moving_colliders.h"

enum { MOST = 24 * 24 * 24 }; /* samples of a grid */

static inline msim_collider heights(const double origin[3], const double spacing[2], int32_t nx,
                                    int32_t ny, const double *values, double e, double mu) {
  msim_collider c = sphere(0, 0, 0, 0, e, mu);
  c.type = MSIM_COLLIDER_HEIGHTFIELD;
  for (int i = 0; i < 3; i++) c.origin[i] = origin[i];
  c.spacing[0] = spacing[0], c.spacing[1] = spacing[1];
  c.n[0] = nx, c.n[1] = ny, c.values = values;
  return c;
}

static inline void sample_sphere(int32_t n, double *values) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++)
      for (int k = 0; k < n; k++) {
        const double x[3] = {-1.5 + 3. * i / (n - 1), -1.5 + 3. * j / (n - 1),
                             -1.5 + 3. * k / (n - 1)};
        values[(i * n + j) * n + k] = ms_vec3_norm(x) - 1;
      }
}

static inline msim_collider sampled_sphere(int32_t n, const double *values, double e, double mu) {
  msim_collider c = sphere(0, 0, 0, 0, e, mu);
  c.type = MSIM_COLLIDER_SDF;
  for (int i = 0; i < 3; i++) c.origin[i] = -1.5, c.spacing[i] = 3. / (n - 1), c.n[i] = n;
  c.values = values;
  return c;
}

/* A cloth over a coarse ball and rough ground */
static inline msim_scene *rough_scene(unsigned *seed, double e) {
  static double values[MOST];
  const double origin[3] = {-1.5, -1.5, -1}, spacing[2] = {0.25, 0.3};
  double ground[13 * 11];
  for (int k = 0; k < 13 * 11; k++) ground[k] = 0.3 * uniform(seed);
  msim_scene *scene = new_scene();
  add_cloth(scene, 1.12, e);
  sample_sphere(12, values);
  for (int k = 0; k < 12 * 12 * 12; k++) values[k] *= 0.3;
  msim_collider ball = sampled_sphere(12, values, e, 0.2);
  for (int c = 0; c < 3; c++) ball.origin[c] *= 0.3, ball.spacing[c] *= 0.3;
  ball.origin[2] += 0.8;
  add(scene, ball, 0);
  add(scene, heights(origin, spacing, 13, 11, ground, e, 0.3), 0);
  return scene;
}

#endif
