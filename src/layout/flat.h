/* flat - scenes in which nothing ever moves along one axis of space: they need two components */
#ifndef MS_FLAT_H
#define MS_FLAT_H

#include "scene/scene.h"

/* The last axis along which all particles lie level and at rest, gravity is 0 and no plane pushes;
 * -1: there is none, or skip_off (MSIM_SKIP_...) keeps it. */
int32_t ms_flat_axis(const ms_scene *scene, unsigned skip_off);

/* Whether a state, flat 3n, lies level with the scene along that axis, and moves across it alone.
 * Nullable: v. */
int ms_is_level(const ms_scene *scene, int32_t axis, const double *x, const double *v);

#endif
