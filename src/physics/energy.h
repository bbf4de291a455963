/* energy - energies, momentum and angular momentum of a state */
#ifndef MS_ENERGY_H
#define MS_ENERGY_H

#include "scene/section.h"

/* The energies of each part of a scene, J */
typedef struct ms_energies {
  double *kinetic, *elastic, *gravitational;
} ms_energies;

/* Add the energies below of each part of a scene, in the order of its particles, springs, ... part:
 * that of each particle; a spring belongs to the first part that it touches. */
void ms_energy_add_parts(const ms_scene *scene, const double *x, const double *v,
                         const int32_t *part, const ms_energies *to);

/* Kinetic sum m v.v/2, elastic sum k (l - L)^2/2, gravitational -sum m g.x, with the
 * potentials of constant forces and a force function; momentum sum m v, angular momentum
 * sum m x cross v. x, v: n x 3. */
void ms_energy_compute(const ms_scene *scene, const double *x, const double *v,
                       msim_energy *energy);

/* The same sums where sections follow each other: add what a section has to energy, in round 0 for
 * one section after the other, and then in round 1; the bits are those of one section. In the end
 * set the total. */
enum { MS_ENERGY_ROUNDS = 2 };
void ms_energy_add_section(const ms_scene *scene, const ms_section *section, const double *x,
                           const double *v, int round, msim_energy *energy);
void ms_energy_set_total(msim_energy *energy);

/* The total energy alone, J */
double ms_energy_total(const ms_scene *scene, const double *x, const double *v);

#endif
