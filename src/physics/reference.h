/* reference - reference implementation of the forces: particle by particle, without half-edges */
#ifndef MS_REFERENCE_H
#define MS_REFERENCE_H

#include "scene/section.h"

/* f = F(x, v) of force.h on every particle, 0 on pinned ones. Serves states with 3 components in
 * sims with 2. x, v, f: n x 3. */
void ms_reference_compute_force(const ms_scene *scene, const double *x, const double *v, double *f);

/* The force that its support exerts on each pinned particle, minus F on it; 0 on all others. x, v,
 * reaction: of a section that has the ends of all springs and angular springs at pinned particles
 */
void ms_reference_compute_reactions(const ms_scene *scene, const ms_section *section,
                                    const double *x, const double *v, double *reaction);

/* f(l) + c u.v (N, spring_law.h) of a spring; *elongation: l - L (m). x, v: n x 3. */
double ms_reference_compute_tension(const ms_scene *scene, int32_t spring, const double *x,
                                    const double *v, double *elongation);

/* The elastic energy (J) of a spring and of an angular spring. x: of a section that has its ends */
double ms_reference_compute_spring_energy(const ms_scene *scene, const ms_section *section,
                                          int32_t spring, const double *x);
double ms_reference_compute_angle_energy(const ms_scene *scene, const ms_section *section,
                                         int32_t angle, const double *x);

#endif
