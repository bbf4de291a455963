#include "physics/energy.h"

#include "physics/external_force.h"
#include "physics/reference.h"

static void add_particle_energy(const ms_scene *s, int32_t p, const double *x, const double *v,
                                double *kinetic, double *gravitational) {
  double m = s->mass[p];
  x += 3 * (size_t)p;
  v += 3 * (size_t)p;
  *kinetic += 0.5 * m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  *gravitational += ms_external_energy(&s->external, m, x);
  if (s->force) *gravitational -= ms_vec3_dot(s->force + 3 * (size_t)p, x);
}

static int32_t find_part(const int32_t *part, int32_t p) { return part ? part[p] : 0; }

/* The part of a spring: the first of those of its particles */
static int32_t find_first_part(const int32_t *part, int n, const int32_t *particles) {
  int32_t first = find_part(part, particles[0]);
  for (int i = 1; i < n; i++)
    if (find_part(part, particles[i]) < first) first = part[particles[i]];
  return first;
}

static void add_potential(const ms_scene *s, int32_t n, const int32_t *particles, const double *x,
                          const int32_t *part, double *gravitational) {
  const msim_force_function *is = &s->force_function;
  if (n > 0) gravitational[find_part(part, *particles)] += is->potential(is->data, n, particles, x);
}

/* The potential of the force function of free particles, some of one part at a time */
static void add_function_potential(const ms_scene *s, const double *x, const int32_t *part,
                                   double *gravitational) {
  enum { MOST = 64 };
  int32_t particle[MOST], n = 0;
  double there[3 * MOST];
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (s->pinned[p]) continue;
    if (n == MOST || (n > 0 && find_part(part, p) != find_part(part, *particle))) {
      add_potential(s, n, particle, there, part, gravitational);
      n = 0;
    }
    for (size_t c = 0; c < 3; c++) there[3 * (size_t)n + c] = x[3 * (size_t)p + c];
    particle[n++] = p;
  }
  add_potential(s, n, particle, there, part, gravitational);
}

void ms_energy_add(const ms_scene *s, const double *x, const double *v, const int32_t *part,
                   const ms_energies *to) {
  for (int32_t p = 0; p < s->nparticles; p++)
    add_particle_energy(s, p, x, v, &to->kinetic[find_part(part, p)],
                        &to->gravitational[find_part(part, p)]);
  if (s->force_function.potential) add_function_potential(s, x, part, to->gravitational);
  for (int32_t e = 0; e < s->nsprings; e++)
    to->elastic[find_first_part(part, 2, s->ij + 2 * (size_t)e)] +=
        ms_reference_compute_spring_energy(s, e, x);
  for (int32_t e = 0; e < s->angles.n; e++)
    to->elastic[find_first_part(part, 3, s->angles.ijk + 3 * (size_t)e)] +=
        ms_reference_compute_angle_energy(s, e, x);
}

static void add_momentum(const ms_scene *s, int32_t p, const double *x, const double *v,
                         msim_energy *e) {
  const double m = s->mass[p];
  x += 3 * (size_t)p;
  v += 3 * (size_t)p;
  for (int c = 0; c < 3; c++) {
    int a = (c + 1) % 3, b = (c + 2) % 3;
    e->momentum[c] += m * v[c];
    e->angular_momentum[c] += m * (x[a] * v[b] - x[b] * v[a]);
  }
}

void ms_energy_compute(const ms_scene *scene, const double *x, const double *v,
                       msim_energy *energy) {
  msim_energy e = {.size = energy->size};
  ms_energy_add(scene, x, v, NULL, &(ms_energies){&e.kinetic, &e.elastic, &e.gravitational});
  for (int32_t p = 0; p < scene->nparticles; p++) add_momentum(scene, p, x, v, &e);
  e.total = e.kinetic + e.elastic + e.gravitational;
  *energy = e;
}

double ms_energy_total(const ms_scene *scene, const double *x, const double *v) {
  msim_energy e = {.size = sizeof e};
  ms_energy_compute(scene, x, v, &e);
  return e.total;
}
