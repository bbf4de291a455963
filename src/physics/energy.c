#include "physics/energy.h"

#include "physics/external_force.h"
#include "physics/reference.h"

/* x, v: of the particle */
static void add_particle_energy(const ms_scene *s, int32_t p, const double *x, const double *v,
                                double *kinetic, double *gravitational) {
  double m = s->mass[p];
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
static void add_function_potential(const ms_scene *s, const ms_section *section, const double *x,
                                   const int32_t *part, double *gravitational) {
  int32_t particle[MS_POTENTIAL_BATCH], n = 0;
  double there[3 * MS_POTENTIAL_BATCH];
  for (int32_t p = section->first; p < section->first + section->n; p++, x += 3) {
    if (s->pinned[p]) continue;
    if (n == MS_POTENTIAL_BATCH || (n > 0 && find_part(part, p) != find_part(part, *particle))) {
      add_potential(s, n, particle, there, part, gravitational);
      n = 0;
    }
    for (size_t c = 0; c < 3; c++) there[3 * (size_t)n + c] = x[c];
    particle[n++] = p;
  }
  add_potential(s, n, particle, there, part, gravitational);
}

static void add_particles(const ms_scene *s, const ms_section *section, const double *x,
                          const double *v, const int32_t *part, const ms_energies *to) {
  for (int32_t p = section->first; p < section->first + section->n; p++, x += 3, v += 3)
    add_particle_energy(s, p, x, v, &to->kinetic[find_part(part, p)],
                        &to->gravitational[find_part(part, p)]);
}

static void add_springs(const ms_scene *s, const ms_section *section, const double *x,
                        const int32_t *part, double *elastic) {
  for (int32_t e = section->first_spring; e < section->first_spring + section->nsprings; e++)
    elastic[find_first_part(part, 2, s->ij + 2 * (size_t)e)] +=
        ms_reference_compute_spring_energy(s, section, e, x);
}

static void add_angles(const ms_scene *s, const ms_section *section, const double *x,
                       const int32_t *part, double *elastic) {
  for (int32_t e = section->first_angle; e < section->first_angle + section->nangles; e++)
    elastic[find_first_part(part, 3, s->angles.ijk + 3 * (size_t)e)] +=
        ms_reference_compute_angle_energy(s, section, e, x);
}

/* Particles and springs come in the first round, what follows them in the second one. */
static void add_round(const ms_scene *s, const ms_section *section, const double *x,
                      const double *v, const int32_t *part, int round, const ms_energies *to) {
  if (round == 0) {
    add_particles(s, section, x, v, part, to);
    add_springs(s, section, x, part, to->elastic);
    return;
  }
  if (s->force_function.potential) add_function_potential(s, section, x, part, to->gravitational);
  add_angles(s, section, x, part, to->elastic);
}

void ms_energy_add_parts(const ms_scene *scene, const double *x, const double *v,
                         const int32_t *part, const ms_energies *to) {
  const ms_section all = ms_section_whole(scene);
  for (int round = 0; round < MS_ENERGY_ROUNDS; round++)
    add_round(scene, &all, x, v, part, round, to);
}

/* x, v: of a particle of mass m */
static void add_momentum(double m, const double *x, const double *v, msim_energy *e) {
  for (int c = 0; c < 3; c++) {
    int a = (c + 1) % 3, b = (c + 2) % 3;
    e->momentum[c] += m * v[c];
    e->angular_momentum[c] += m * (x[a] * v[b] - x[b] * v[a]);
  }
}

void ms_energy_add_section(const ms_scene *scene, const ms_section *section, const double *x,
                           const double *v, int round, msim_energy *e) {
  add_round(scene, section, x, v, NULL, round,
            &(ms_energies){&e->kinetic, &e->elastic, &e->gravitational});
  for (size_t i = 0; i < (size_t)section->n && round == 0; i++)
    add_momentum(scene->mass[(size_t)section->first + i], x + 3 * i, v + 3 * i, e);
}

void ms_energy_set_total(msim_energy *e) { e->total = e->kinetic + e->elastic + e->gravitational; }

void ms_energy_compute(const ms_scene *scene, const double *x, const double *v,
                       msim_energy *energy) {
  const ms_section all = ms_section_whole(scene);
  msim_energy e = {.size = energy->size};
  for (int round = 0; round < MS_ENERGY_ROUNDS; round++)
    ms_energy_add_section(scene, &all, x, v, round, &e);
  ms_energy_set_total(&e);
  *energy = e;
}

double ms_energy_total(const ms_scene *scene, const double *x, const double *v) {
  msim_energy e = {.size = sizeof e};
  ms_energy_compute(scene, x, v, &e);
  return e.total;
}
