/* planar - detects planar scenes, in which nothing ever moves along one axis of space: two
 * components suffice */
#ifndef MS_PLANAR_H
#define MS_PLANAR_H

#include "scene/scene.h"

/* The last axis along which all particles have the same coordinate and velocity 0, and neither
 * gravity nor a plane's normal has a component; -1: none, or there are colliders, or skip_off has
 * MSIM_SKIP_TWO_D. */
int32_t ms_planar_find_axis(const ms_scene *scene, unsigned skip_off);

/* The same of one axis for some of the particles, if all have this coordinate; 1: yes */
int ms_planar_has_axis(const ms_scene *scene, unsigned skip_off, int32_t axis, double level);

/* Returns 1 if along this axis all particles have the coordinate of the scene's first particle, and
 * velocity 0. x, v: n x 3. Nullable: v. */
int ms_planar_is_in_plane(const ms_scene *scene, int32_t axis, const double *x, const double *v);

#endif
