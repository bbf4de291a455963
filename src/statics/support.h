/* support - bodies that nothing can hold: no equilibrium exists */
#ifndef MS_SUPPORT_H
#define MS_SUPPORT_H

#include "scene/scene.h"

/* MSIM_NOT_CONVERGED: a body, connected to no pinned particle, is moved by external forces of more
 * than `accepted` (N), and from the positions x (3n) no obstacle can hold it: it falls, or slides
 * along planes, and has passed all colliders. A force function may balance them elsewhere. */
msim_status ms_support_check(const ms_scene *scene, const double *x, double accepted,
                             msim_error *err);

#endif
