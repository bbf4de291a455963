#include "physics/reference.h"

#include <string.h>

#include "physics/angle.h"
#include "physics/external_force.h"
#include "physics/law.h"
#include "physics/spring_law.h"
#include "scene/angles.h"

/* (f(l) + c u.(v_j - v_i)) u on i, the opposite on j */
static void add_spring_force(const ms_scene *s, const ms_section *section, size_t e,
                             const double *x, const double *v, double *f) {
  const size_t i = 3 * ms_section_row(section, s->ij[2 * e]),
               j = 3 * ms_section_row(section, s->ij[2 * e + 1]);
  double d[3], dv[3];
  for (size_t c = 0; c < 3; c++) d[c] = x[j + c] - x[i + c], dv[c] = v[j + c] - v[i + c];
  const double l2 = ms_vec3_dot(d, d), l = sqrt(l2);
  if (l2 <= MS_MIN_LENGTH2) return;
  const double pull = (ms_law_value_of(s, (int32_t)e, l).force +
                       MS_DASHPOT_FORCE(ms_scene_damping(s, (int32_t)e), ms_vec3_dot(d, dv)) / l) /
                      l;
  for (size_t c = 0; c < 3; c++) f[i + c] += pull * d[c], f[j + c] -= pull * d[c];
}

/* corner: where those of an angular spring begin in x */
typedef struct corners {
  size_t i, j, k;
} corners;

static corners find_corners(const ms_scene *s, const ms_section *section, size_t e) {
  const int32_t *ijk = s->angles.ijk + 3 * e;
  return (corners){3 * ms_section_row(section, ijk[0]), 3 * ms_section_row(section, ijk[1]),
                   3 * ms_section_row(section, ijk[2])};
}

static ms_angle measure_angle(corners at_x, const double *x) {
  ms_angle at;
  double p[3], q[3];
  for (size_t c = 0; c < 3; c++) {
    p[c] = x[at_x.i + c] - x[at_x.j + c];
    q[c] = x[at_x.k + c] - x[at_x.j + c];
  }
  ms_angle_measure(p, q, &at);
  return at;
}

static ms_angle_spring get_angle_spring(const ms_scene *s, size_t e) {
  return (ms_angle_spring){s->angles.k[e], MS_PI - s->angles.rest[e], s->angles.damping[e]};
}

static void add_angle_force(const ms_scene *s, const ms_section *section, size_t e, const double *x,
                            const double *v, double *f) {
  const corners of = find_corners(s, section, e);
  const size_t i = of.i, j = of.j, k = of.k;
  const ms_angle_spring spring = get_angle_spring(s, e);
  const ms_angle at = measure_angle(of, x);
  double vp[3], vq[3], fi[3], fk[3];
  for (size_t c = 0; c < 3; c++) vp[c] = v[i + c] - v[j + c], vq[c] = v[k + c] - v[j + c];
  ms_angle_force(&at, &spring, vp, vq, fi, fk);
  for (size_t c = 0; c < 3; c++) f[i + c] += fi[c], f[j + c] -= fi[c] + fk[c], f[k + c] += fk[c];
}

double ms_reference_compute_spring_energy(const ms_scene *s, const ms_section *section,
                                          int32_t spring, const double *x) {
  const double *a = x + 3 * ms_section_row(section, s->ij[2 * (size_t)spring]);
  const double *b = x + 3 * ms_section_row(section, s->ij[2 * (size_t)spring + 1]);
  const double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  return ms_law_value_of(s, spring, ms_vec3_norm(d)).energy;
}

double ms_reference_compute_angle_energy(const ms_scene *s, const ms_section *section,
                                         int32_t angle, const double *x) {
  const ms_angle_spring spring = get_angle_spring(s, (size_t)angle);
  const ms_angle at = measure_angle(find_corners(s, section, (size_t)angle), x);
  return ms_angle_energy(&at, &spring);
}

/* The force of gravity, drag and constant forces on a particle; x, v, f: its own */
static void set_external_force(const ms_scene *s, size_t p, const double *x, const double *v,
                               double *f) {
  for (size_t c = 0; c < 3; c++)
    f[c] = ms_external_force(&s->external, (int32_t)c, s->mass[p], x[c], v[c]) +
           (s->force ? s->force[3 * p + c] : 0);
}

void ms_reference_compute_force(const ms_scene *scene, const double *x, const double *v,
                                double *f) {
  const ms_section all = ms_section_whole(scene);
  for (size_t p = 0; p < (size_t)scene->nparticles; p++)
    set_external_force(scene, p, x + 3 * p, v + 3 * p, f + 3 * p);
  for (size_t e = 0; e < (size_t)scene->nsprings; e++) add_spring_force(scene, &all, e, x, v, f);
  for (size_t e = 0; e < (size_t)scene->angles.n; e++) add_angle_force(scene, &all, e, x, v, f);
  for (size_t p = 0; p < (size_t)scene->nparticles; p++)
    if (scene->pinned[p]) memset(f + 3 * p, 0, 3 * sizeof *f);
}

static int any_is_pinned(const ms_scene *s, const int32_t *particle, int n) {
  int pinned = 0;
  for (int k = 0; k < n; k++) pinned |= s->pinned[particle[k]];
  return pinned;
}

/* A pinned particle does not accelerate: F + R = 0. */
void ms_reference_compute_reactions(const ms_scene *scene, const ms_section *section,
                                    const double *x, const double *v, double *reaction) {
  const size_t n = (size_t)section->n + (size_t)section->nothers;
  memset(reaction, 0, 3 * n * sizeof *reaction);
  for (int32_t p = 0; p < scene->nparticles; p++) {
    if (!scene->pinned[p]) continue;
    const size_t row = 3 * ms_section_row(section, p);
    set_external_force(scene, (size_t)p, x + row, v + row, reaction + row);
  }
  for (size_t e = 0; e < (size_t)scene->nsprings; e++)
    if (any_is_pinned(scene, scene->ij + 2 * e, 2))
      add_spring_force(scene, section, e, x, v, reaction);
  for (size_t e = 0; e < (size_t)scene->angles.n; e++)
    if (any_is_pinned(scene, scene->angles.ijk + 3 * e, 3))
      add_angle_force(scene, section, e, x, v, reaction);
  for (size_t i = 0; i < n; i++) {
    const int32_t p = ms_section_particle(section, i);
    for (size_t c = 0; c < 3; c++)
      reaction[3 * i + c] = scene->pinned[p] ? 0 - reaction[3 * i + c] : 0;
  }
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
