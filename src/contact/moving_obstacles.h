/* moving_obstacles - solids that move: where they are at an instant, and the velocity and
 * acceleration of the frame in which contact with them is computed
 *
 * A particle in contact moves with the surface: v = u + v', u the velocity of the point of the
 * solid at x, so that impacts, friction and rest are those of the relative velocity v'. Along a
 * path with velocity v, with the velocity c', acceleration c'', angular velocity w and angular
 * acceleration w' of the solid, and r = x - c,
 *   u = c' + w x r,   du/dt = A = c'' + w' x r + w x (v - c'),
 * and v' obeys dv'/dt = a - A. The distance s from the surface, of normal n, obeys
 *   s' = n.v',   s'' = n.(a - A) + (w x n).v' + v'.(dn/dx) v'.
 * Where surfaces with different velocities touch a particle, u is the mean of these, changed along
 * the normals so that n.u is right for each of them; A likewise. */
#ifndef MS_MOVING_OBSTACLES_H
#define MS_MOVING_OBSTACLES_H

#include "contact/obstacles.h"

/* Places the solids that move at an instant. */
void ms_moving_obstacles_place(const ms_collision_planes *planes, ms_instant at);

/* Solid i at an instant: as it is if it rests, or in *room */
const ms_solid *ms_moving_obstacles_get(const ms_collision_planes *planes, int32_t i, ms_instant at,
                                        ms_solid *room);

/* 1: solid i moves at some time. */
int ms_moving_obstacles_moves(const ms_collision_planes *planes, int32_t i);

/* The first time of a motion after t, by more than rounding; INFINITY: none */
double ms_moving_obstacles_next_time(const ms_collision_planes *planes, double t);

/* The vector of a frame from those of its planes, of[on->n] */
void ms_moving_obstacles_combine(const ms_plane_set *on, double of[][3], double u[3]);

/* u at x of the planes that touch a particle; 0 for those at rest */
void ms_moving_obstacles_find_velocity(const ms_collision_planes *planes, const ms_plane_set *on,
                                       const double x[3], double u[3]);

/* A at x, for a particle with velocity v */
void ms_moving_obstacles_find_acceleration(const ms_collision_planes *planes,
                                           const ms_plane_set *on, const double x[3],
                                           const double v[3], double a[3]);

/* c'' + w' x (x - c) + w x (v - c'), of a point of a solid at x, with v its own velocity */
void ms_moving_obstacles_find_point_acceleration(const ms_solid *solid, const double x[3],
                                                 const double v[3], double a[3]);

/* n.a of a particle that stays on solid i, of normal n, at x with velocity v: s'' = 0 */
double ms_moving_obstacles_find_normal_acceleration(const ms_solid *solid, const double n[3],
                                                    const double x[3], const double v[3]);

/* The frame of a contact in a step; 0 if none of its solids moves */
typedef struct ms_contact_frame {
  int moves;
  double velocity[3], acceleration[3]; /* m/s, m/s^2: at the start of the step */
  double displacement[3];              /* m: in the step */
  double end[3];                       /* m/s: its velocity at the end */
} ms_contact_frame;

/* Sets the frame of planes that touch x in a step of h, its displacement and end to order h^2. */
void ms_moving_obstacles_set_frame(const ms_collision_planes *planes, const ms_plane_set *on,
                                   const double x[3], const double v[3], double h,
                                   ms_contact_frame *frame);

/* A bound on the displacement of the points of solid i within `distance` of x, relative to x, in a
 * time (m) */
double ms_moving_obstacles_bound_displacement(const ms_collision_planes *planes, int32_t i,
                                              const double x[3], double distance, double time);

/* The poses of the solids of a contact, before they move */
typedef struct ms_poses {
  int n;
  ms_solid solid[MS_MAX_TOUCHED_PLANES];
} ms_poses;

void ms_moving_obstacles_save_poses(const ms_collision_planes *planes, const ms_plane_set *on,
                                    ms_poses *poses);

/* displacement += that of the point x of a solid between two poses */
void ms_moving_obstacles_add_displacement(const ms_solid *from, const ms_solid *to,
                                          const double x[3], double displacement[3]);

/* Moves x as the points of the solids at x have moved since: by the mean of their displacements. */
void ms_moving_obstacles_carry(const ms_collision_planes *planes, const ms_plane_set *on,
                               const ms_poses *poses, double x[3]);

#endif
