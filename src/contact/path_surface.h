/* path_surface - the surfaces in contact with a particle on its path: their frame, its motion in
 * it, edges, release and work */
#ifndef MS_PATH_SURFACE_H
#define MS_PATH_SURFACE_H

#include "contact/path_progress.h"

/* 1: a solid of the scene moves. Else v and w stay absolute, and the frame 0. */
int ms_path_surface_moves(const ms_path_progress *k);

/* Places obstacles at the time t of the path, at the start or at the end of a part of it: a motion
 * may change between. */
void ms_path_surface_place(const ms_path_progress *k, double t, int is_end);

/* The frame gets the velocity of the surfaces of `on` at x. */
void ms_path_surface_set_frame(ms_path_progress *k, const ms_plane_set *on);

/* Makes v and w relative to the surfaces of `on`. */
void ms_path_surface_enter_frame(ms_path_progress *k, const ms_plane_set *on);

/* Makes them absolute. */
void ms_path_surface_leave_frame(ms_path_progress *k);

/* Moves x by dx relative to the surfaces of `on`, and with them by dt, as the point at the middle
 * of its path. */
void ms_path_surface_move(ms_path_progress *k, const ms_plane_set *on, const double dx[3],
                          double dt);

/* a - A in the frame of the surfaces of `on`; v: relative */
void ms_path_surface_make_relative(const ms_path_progress *k, const ms_plane_set *on,
                                   const double v[3], double a[3]);

/* Normal accelerations of a particle that stays on the planes of `on`; v: relative */
void ms_path_surface_find_least(const ms_path_progress *k, const ms_plane_set *on,
                                const double v[3], double *least);

/* 1: dx leads beyond an edge of the solid. */
int ms_path_surface_is_beyond_edge(const ms_path_progress *k, const ms_solid *solid,
                                   const double dx[3]);

/* 1: after the time t a particle that slides by dx, as far as it is free, is in the solid: so its
 * sampled surface still holds the particle. */
int ms_path_surface_holds(const ms_path_progress *k, const msim_plane *plane, const double dx[3],
                          double t);

/* When the surface of the only plane in contact starts to recede faster than a particle with the
 * acceleration a follows it, which is found from the normal accelerations at both ends of the time
 * left: they are linear in time where it does not rotate; `left`: never. */
double ms_path_surface_time_to_release(const ms_path_progress *k, double left);

/* The time in which the surfaces in contact rotate by little, and their acceleration, whose change
 * dA moves x by dA dt^2/12, is nearly constant */
double ms_path_surface_limit_motion(const ms_path_progress *k, double left);

/* Move x onto the surfaces in contact, and turn v and w with their tangent planes (parallel
 * transport), which keeps speeds. n: the normal of the first one before */
void ms_path_surface_follow(ms_path_progress *k, const ms_plane_set *on, const double n[3]);

/* The work of the surfaces in contact on w in the part of dt: of the impulse that accelerates w
 * with the frame, from its velocity `from`, and of the one that acts against b and, by friction,
 * changed w from `before`, as that of a constant force along the displacement of the surfaces */
void ms_path_surface_add_work(ms_path_progress *k, const double before[3], const double from[3],
                              double dt);

#endif
