#include "physics/reference.h"

#include <string.h>

#include "physics/angle.h"
#include "physics/external_force.h"
#include "physics/law.h"
#include "physics/spring_law.h"
#include "scene/angles.h"

/* (f(l) + c u.(v_j - v_i)) u on i, the opposite on j */
static void add_spring_force(const ms_scene *s, size_t e, const double *x, const double *v,
                             double *f) {
  const size_t i = 3 * (size_t)s->ij[2 * e], j = 3 * (size_t)s->ij[2 * e + 1];
  double d[3], dv[3];
  for (size_t c = 0; c < 3; c++) d[c] = x[j + c] - x[i + c], dv[c] = v[j + c] - v[i + c];
  const double l2 = ms_vec3_dot(d, d), l = sqrt(l2);
  if (l2 <= MS_MIN_LENGTH2) return;
  const double pull = (ms_law_value_of(s, (int32_t)e, l).force +
                       MS_DASHPOT_FORCE(ms_scene_damping(s, (int32_t)e), ms_vec3_dot(d, dv)) / l) /
                      l;
  for (size_t c = 0; c < 3; c++) f[i + c] += pull * d[c], f[j + c] -= pull * d[c];
}

static ms_angle measure_angle(const int32_t *ijk, const double *x) {
  ms_angle at;
  double p[3], q[3];
  for (size_t c = 0; c < 3; c++) {
    p[c] = x[3 * (size_t)ijk[0] + c] - x[3 * (size_t)ijk[1] + c];
    q[c] = x[3 * (size_t)ijk[2] + c] - x[3 * (size_t)ijk[1] + c];
  }
  ms_angle_measure(p, q, &at);
  return at;
}

static ms_angle_spring get_angle_spring(const ms_scene *s, size_t e) {
  return (ms_angle_spring){s->angles.k[e], MS_PI - s->angles.rest[e], s->angles.damping[e]};
}

static void add_angle_force(const ms_scene *s, size_t e, const double *x, const double *v,
                            double *f) {
  const int32_t *ijk = s->angles.ijk + 3 * e;
  const size_t i = 3 * (size_t)ijk[0], j = 3 * (size_t)ijk[1], k = 3 * (size_t)ijk[2];
  const ms_angle_spring spring = get_angle_spring(s, e);
  const ms_angle at = measure_angle(ijk, x);
  double vp[3], vq[3], fi[3], fk[3];
  for (size_t c = 0; c < 3; c++) vp[c] = v[i + c] - v[j + c], vq[c] = v[k + c] - v[j + c];
  ms_angle_force(&at, &spring, vp, vq, fi, fk);
  for (size_t c = 0; c < 3; c++) f[i + c] += fi[c], f[j + c] -= fi[c] + fk[c], f[k + c] += fk[c];
}

double ms_reference_compute_spring_energy(const ms_scene *s, int32_t spring, const double *x) {
  const double *a = x + 3 * (size_t)s->ij[2 * (size_t)spring];
  const double *b = x + 3 * (size_t)s->ij[2 * (size_t)spring + 1];
  const double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  return ms_law_value_of(s, spring, ms_vec3_norm(d)).energy;
}

double ms_reference_compute_angle_energy(const ms_scene *s, int32_t angle, const double *x) {
  const ms_angle_spring spring = get_angle_spring(s, (size_t)angle);
  const ms_angle at = measure_angle(s->angles.ijk + 3 * (size_t)angle, x);
  return ms_angle_energy(&at, &spring);
}

/* The forces on all particles, those on pinned ones included */
static void sum_forces(const ms_scene *scene, const double *x, const double *v, double *f) {
  const size_t n = (size_t)scene->nparticles;
  for (size_t i = 0; i < 3 * n; i++)
    f[i] = ms_external_force(&scene->external, (int32_t)(i % 3), scene->mass[i / 3], x[i], v[i]) +
           (scene->force ? scene->force[i] : 0);
  for (size_t e = 0; e < (size_t)scene->nsprings; e++) add_spring_force(scene, e, x, v, f);
  for (size_t e = 0; e < (size_t)scene->angles.n; e++) add_angle_force(scene, e, x, v, f);
}

void ms_reference_compute_force(const ms_scene *scene, const double *x, const double *v,
                                double *f) {
  sum_forces(scene, x, v, f);
  for (size_t p = 0; p < (size_t)scene->nparticles; p++)
    if (scene->pinned[p]) memset(f + 3 * p, 0, 3 * sizeof *f);
}

/* A pinned particle does not accelerate: F + R = 0. */
void ms_reference_compute_reactions(const ms_scene *scene, const double *x, const double *v,
                                    double *reaction) {
  sum_forces(scene, x, v, reaction);
  for (size_t i = 0; i < 3 * (size_t)scene->nparticles; i++)
    reaction[i] = scene->pinned[i / 3] ? 0 - reaction[i] : 0;
}

double ms_reference_compute_tension(const ms_scene *s, int32_t spring, const double *x,
                                    const double *v, double *elongation) {
  const size_t e = (size_t)spring;
  const size_t i = 3 * (size_t)s->ij[2 * e], j = 3 * (size_t)s->ij[2 * e + 1];
  double d[3], dv[3];
  for (size_t c = 0; c < 3; c++) d[c] = x[j + c] - x[i + c], dv[c] = v[j + c] - v[i + c];
  const double l = ms_vec3_norm(d), rate = l * l > MS_MIN_LENGTH2 ? ms_vec3_dot(d, dv) / l : 0;
  *elongation = l - s->rest[e];
  return ms_law_value_of(s, spring, l).force + MS_DASHPOT_FORCE(ms_scene_damping(s, spring), rate);
}
