/* collider_motions - prescribed motions of colliders: where their solids are at an instant, and how
 * their points move */
#ifndef MS_COLLIDER_MOTIONS_H
#define MS_COLLIDER_MOTIONS_H

#include "scene/colliders.h"
#include "scene/motions.h"

/* The motion of a collider; x.nt = 0: it rests. */
typedef struct ms_collider_motion {
  ms_motion x;        /* of its center: 1 point */
  ms_motion rotation; /* of its rotation vector w: 1 point; rotation.nt = 0: it does not rotate */
} ms_collider_motion;

struct ms_scene;

/* axis[i] = R e_i, with the rotation R by the vector w and the unit vectors e_i; not finite if w is
 * too long */
void ms_collider_motion_rotate_axes(const double w[3], double axis[3][3]);

/* Collider i of the scene at an instant: where it rests, or in *room with its velocities. The
 * rotation of w follows that of the collider at rest; its angular velocity is
 *   w' + (1 - cos a)/a^2 w x w' + (a - sin a)/a^3 w x (w x w'),  a = |w|. */
const ms_solid *ms_collider_motion_place(const struct ms_scene *scene, int32_t i, ms_instant at,
                                         ms_solid *room);

/* Its center at an instant, and its rotation vector, 0 at rest */
void ms_collider_motion_get_pose(const struct ms_scene *scene, int32_t i, ms_instant at,
                                 double x[3], double rotation[3]);

/* 1: a collider of the scene has a motion. */
int ms_collider_motion_is_there(const struct ms_scene *scene);

/* All solids of the scene at an instant: those at rest, or in room[ncolliders] */
const ms_solid *ms_collider_motion_place_all(const struct ms_scene *scene, ms_instant at,
                                             ms_solid *room);

/* The first time of a motion of a collider after t, by more than rounding; INFINITY: none */
double ms_collider_motion_next_time(const struct ms_scene *scene, double t);

msim_status ms_collider_motion_copy(const msim_allocator *alloc, const ms_collider_motion *from,
                                    ms_collider_motion *to, msim_error *err);
void ms_collider_motion_free(const msim_allocator *alloc, ms_collider_motion *motion);

#endif
