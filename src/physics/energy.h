/* energy - energies, momentum and angular momentum of a state */
#ifndef MS_ENERGY_H
#define MS_ENERGY_H

#include "scene/scene.h"

/* Kinetic sum m v.v/2, elastic sum k (l - L)^2/2, gravitational -sum m g.x, with the
 * potentials of constant forces and a force function; momentum sum m v, angular momentum
 * sum m x cross v. x, v: n x 3. */
void ms_energy_compute(const ms_scene *scene, const double *x, const double *v,
                       msim_energy *energy);

/* The total energy alone, J */
double ms_energy_total(const ms_scene *scene, const double *x, const double *v);

#endif
