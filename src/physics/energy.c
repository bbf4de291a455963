#include "physics/energy.h"

#include "physics/external_force.h"
#include "physics/law.h"
#include "physics/reference.h"

static void add_particle_energy(const ms_scene *s, int32_t p, const double *x, const double *v,
                                msim_energy *e) {
  double m = s->mass[p];
  x += 3 * (size_t)p;
  v += 3 * (size_t)p;
  e->kinetic += 0.5 * m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  e->gravitational += ms_external_energy(&s->external, m, x);
  if (s->force) e->gravitational -= ms_vec3_dot(s->force + 3 * (size_t)p, x);
  for (int c = 0; c < 3; c++) {
    int a = (c + 1) % 3, b = (c + 2) % 3;
    e->momentum[c] += m * v[c];
    e->angular_momentum[c] += m * (x[a] * v[b] - x[b] * v[a]);
  }
}

static double elastic_energy_of(const ms_scene *s, int32_t spring, const double *x) {
  const double *a = x + 3 * (size_t)s->ij[2 * (size_t)spring];
  const double *b = x + 3 * (size_t)s->ij[2 * (size_t)spring + 1];
  double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  return ms_law_value_of(s, spring, ms_vec3_norm(d)).energy;
}

/* The potential of the force function of free particles, some at a time */
static double compute_function_potential(const ms_scene *s, const double *x) {
  enum { MOST = 64 };
  const msim_force_function *is = &s->force_function;
  int32_t particle[MOST], n = 0;
  double there[3 * MOST], sum = 0;
  for (int32_t p = 0; p < s->nparticles && is->potential; p++) {
    if (!s->pinned[p]) {
      for (size_t c = 0; c < 3; c++) there[3 * (size_t)n + c] = x[3 * (size_t)p + c];
      particle[n++] = p;
    }
    if (n == 0 || (n < MOST && p + 1 < s->nparticles)) continue;
    sum += is->potential(is->data, n, particle, there);
    n = 0;
  }
  return sum;
}

void ms_energy_compute(const ms_scene *scene, const double *x, const double *v,
                       msim_energy *energy) {
  msim_energy e = {.size = energy->size};
  for (int32_t p = 0; p < scene->nparticles; p++) add_particle_energy(scene, p, x, v, &e);
  e.gravitational += compute_function_potential(scene, x);
  for (int32_t i = 0; i < scene->nsprings; i++) e.elastic += elastic_energy_of(scene, i, x);
  e.elastic += ms_reference_compute_angle_energy(scene, x, 0);
  e.total = e.kinetic + e.elastic + e.gravitational;
  *energy = e;
}

double ms_energy_total(const ms_scene *scene, const double *x, const double *v) {
  msim_energy e = {.size = sizeof e};
  ms_energy_compute(scene, x, v, &e);
  return e.total;
}
