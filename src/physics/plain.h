/* plain - forces in particle order, by the formula and without a layout */
#ifndef MS_PLAIN_H
#define MS_PLAIN_H

#include "scene/scene.h"

/* f = F(x, v) on every particle, 0 on pinned ones: for a state that a sim in fewer components
 * cannot hold. Flat 3n. */
void ms_plain_force(const ms_scene *scene, const double *x, const double *v, double *f);

#endif
