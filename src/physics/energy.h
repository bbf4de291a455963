/* energy - energies and momenta of a state, and bounds on frequencies, from the scene alone */
#ifndef MS_ENERGY_H
#define MS_ENERGY_H

#include "scene/scene.h"

/* Kinetic sum m v.v/2, elastic sum k (l - L)^2/2, gravitational -sum m g.x; momentum sum m v,
 * angular momentum sum m x cross v. x and v are flat 3n. */
void ms_energy(const ms_scene *scene, const double *x, const double *v, msim_energy *energy);

/* Bounds that hold in every configuration, from Gershgorin's discs of the graph Laplacian with
 * weights k: omega^2 <= max_i 2/m_i sum k, and the damping rate g <= max_i (2 sum c + b)/m_i. */
typedef struct ms_bounds {
  double omega; /* 1/s */
  double rate;  /* 1/s */
} ms_bounds;
msim_status ms_bounds_compute(const ms_scene *scene, ms_bounds *bounds, msim_error *err);

#endif
