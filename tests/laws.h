/* laws - a scene with springs of every law, and these laws written out */
#ifndef TEST_LAWS_H
#define TEST_LAWS_H

#include <math.h>

#include "scenes.h"

enum { LAW_KINDS = 6 };

static const double law_coefficients[] = {1, -0.7, 4};
static const double law_stretch[] = {-0.4, -0.1, 0.05, 0.3}, law_force[] = {-9, -4, 3, 5};

/* As MSIM_LAW_CALLBACK: f = k sinh(e) */
static inline void sinh_law(void *data, const msim_law_batch *b) {
  (void)data;
  for (int32_t i = 0; i < b->n; i++) {
    b->force[i] = b->k[i] * sinh(b->stretch[i]);
    b->slope[i] = b->k[i] * cosh(b->stretch[i]);
    b->energy[i] = b->k[i] * (cosh(b->stretch[i]) - 1);
  }
}

/* Law 1 + i of add_laws() */
static inline msim_law make_law(int i) {
  msim_law law = {.size = sizeof law, .kind = MSIM_LAW_TENSION + i};
  if (law.kind == MSIM_LAW_DEAD_BAND) law.half_width = 0.1;
  if (law.kind == MSIM_LAW_POLYNOMIAL)
    law.n = 3, law.coefficients = law_coefficients, law.limit = 0.3;
  if (law.kind == MSIM_LAW_TABLE) law.n = 4, law.stretch = law_stretch, law.force = law_force;
  if (law.kind == MSIM_LAW_CALLBACK) law.function = sinh_law, law.largest_slope = 1000;
  return law;
}

static inline void add_laws(msim_scene *scene) {
  for (int i = 0; i < LAW_KINDS; i++) {
    const msim_law law = make_law(i);
    int32_t index;
    assert_ok(msim_scene_add_law(scene, &law, &index, err));
    assert_int_equal(index, i + 1);
  }
}

/* The slopes of the monotone cubic through that table: secants 50/3, 140/3 and 8; at both inner
 * points the parabola's slope, limited by three times the smaller secant beside it. */
static inline double table_force(double e) {
  const double *x = law_stretch, *f = law_force, m0 = 5 / 0.3, m3 = 2 / 0.25;
  const double d1 = 7 / 0.15;
  const double m[4] = {m0, (m0 * 0.15 + d1 * 0.3) / 0.45, (d1 * 0.25 + m3 * 0.15) / 0.4, m3};
  double slope[4] = {m[0], m[1], m[2], m[3]};
  for (int i = 0; i < 3; i++) {
    const double d = (f[i + 1] - f[i]) / (x[i + 1] - x[i]);
    const double size = sqrt(slope[i] * slope[i] + slope[i + 1] * slope[i + 1]) / d;
    if (size > 3) slope[i] *= 3 / size, slope[i + 1] *= 3 / size;
  }
  if (e < x[0]) return f[0] + slope[0] * (e - x[0]);
  if (e > x[3]) return f[3] + slope[3] * (e - x[3]);
  int i = 0;
  while (i < 2 && e > x[i + 1]) i++;
  const double h = x[i + 1] - x[i], t = (e - x[i]) / h; /* Hermite's basis */
  return (1 + 2 * t) * (1 - t) * (1 - t) * f[i] + t * t * (3 - 2 * t) * f[i + 1] +
         h * (t * (1 - t) * (1 - t) * slope[i] - t * t * (1 - t) * slope[i + 1]);
}

/* The force of a spring of law 0 to LAW_KINDS */
static inline double law_value(int law, double k, double e) {
  const double *a = law_coefficients, c = fmax(-0.3, fmin(0.3, e));
  switch (law ? law - 1 + MSIM_LAW_TENSION : MSIM_LAW_LINEAR) {
    case MSIM_LAW_TENSION:
      return k * fmax(e, 0);
    case MSIM_LAW_COMPRESSION:
      return k * fmin(e, 0);
    case MSIM_LAW_DEAD_BAND:
      return fabs(e) <= 0.1 ? 0 : k * (e - copysign(0.1, e));
    case MSIM_LAW_POLYNOMIAL:
      return k * (a[0] * c + a[1] * c * c + a[2] * c * c * c +
                  (a[0] + 2 * a[1] * c + 3 * a[2] * c * c) * (e - c));
    case MSIM_LAW_TABLE:
      return table_force(e);
    case MSIM_LAW_CALLBACK:
      return k * sinh(e);
    default:
      return k * e;
  }
}

/* A net of n particles in a unit cube, or square, and m springs of all laws in turn, the linear
 * one among them; particle 0 is pinned. */
static inline msim_scene *law_net(int32_t n, int32_t m, int planar, double damping, unsigned seed) {
  msim_scene *scene;
  double *x = calloc((size_t)(3 * n), sizeof *x), mass = 0.3;
  assert_ok(msim_scene_create(NULL, &scene, err));
  add_laws(scene);
  for (int32_t i = 0; i < 3 * n; i++) x[i] = planar && i % 3 == 1 ? 0.5 : uniform(&seed);
  for (int32_t i = 0; i < n; i++)
    assert_ok(msim_scene_add_particles(scene, 1, x + 3 * i, NULL, &mass, err));
  for (int32_t e = 0; e < m; e++) {
    const int32_t i = e % n, j = (i + 1 + (int32_t)(uniform(&seed) * (n - 1))) % n;
    const int32_t ij[2] = {i, j};
    const double k = 20 + 50 * uniform(&seed), rest = 1.2 * uniform(&seed);
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, err));
    assert_ok(msim_scene_set_law(scene, 1, &e, e % (LAW_KINDS + 1), err));
  }
  assert_ok(msim_scene_pin(scene, 1, &(int32_t){0}, err));
  free(x);
  return scene;
}

#endif
