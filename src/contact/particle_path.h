/* particle_path - computes the path of one particle in a step, in closed form: flight, impacts,
 * rest and sliding on planes
 *
 * The position, and the times of impacts, follow from a constant acceleration a:
 *   flight   x(t) is a parabola, the next impact the first root of a quadratic;
 *   bounces  of decreasing or very short duration are summed: after a bounce at the speed u against
 *            n.a = -g, m bounces take 2 u/g (1 - e^m)/(1 - e), all of them 2 u/(g (1 - e)), and the
 *            mean normal force over mass is g (1 + e)/2, which causes friction;
 *   contact  a particle that a presses on planes stays there and slides with friction (friction.h).
 *
 * The velocity w undergoes the same impacts at the same times with the acceleration b(t) = b0 +
 * (b1 - b0) t/h instead: dw = dt (b(t) + b(t + dt))/2 in flight, and two half kicks with friction
 * in contact. A step of velocity Verlet computes the path with a = b0 = b1 = a(x) to find x', and
 * once more with b1 = a(x') to find v'.
 *
 * Where obstacles move, a part of the path in contact is computed in the frame of the surface
 * (moving_obstacles.h), and ends where the surface recedes faster than the particle follows it, and
 * at each time of a motion, where velocities of surfaces may jump. */
#ifndef MS_PARTICLE_PARTICLE_PATH_H
#define MS_PARTICLE_PARTICLE_PATH_H

#include "contact/impacts.h"

typedef struct ms_particle_path {
  ms_collision_planes planes;
  double t;            /* s: the time at its start, where obstacles move */
  double h;            /* s: the length of the step */
  double bounce_reach; /* m: bounces with friction that reach farther are not summed */
  double x_error;      /* m: what the turning of curved surfaces may add to the error of x */
  double x[3], v[3];   /* in: at its start; out: at its end, by a */
  double a[3];         /* m/s^2 */
  double w[3];         /* in: velocity at the start; out: at the end, by b */
  double b0[3], b1[3];
  double work;          /* out: J/kg, of moving obstacles, over the mass: by the impulses on w */
  int without_w;        /* 1: w and work are not needed, and meaningless at the end */
  int64_t impacts;      /* out */
  int is_complete;      /* out: 0, the impacts are too many: the path ends before the step does */
  ms_plane_set touched; /* out: the planes that it touched */
} ms_particle_path;

void ms_particle_path_compute(ms_particle_path *p);

#endif
