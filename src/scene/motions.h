/* motions - prescribed motions of pinned particles, piecewise linear or cubic in time */
#ifndef MS_MOTIONS_H
#define MS_MOTIONS_H

#include "msim/scene.h"
#include "base/memory.h"

/* n particles at nt times; the arrays belong to the scene. */
typedef struct ms_motion {
  int32_t n, nt, interpolation;
  int32_t *particles; /* n */
  double *t;          /* nt, s, increasing */
  double *x;          /* nt x n x 3, m */
} ms_motion;

/* The names of MSIM_MOTION_LINEAR and _CUBIC in scene files */
extern const char *const ms_motion_interpolations[2];

/* An instant. Where it is a time of the motion, up to rounding, velocities are those of the
 * interval after it, or before it. */
typedef struct ms_instant {
  double t; /* s */
  int before;
} ms_instant;

/* Position and velocity of particle i of the motion. Linear: x0 + s (x1 - x0), 0 <= s <= 1 in each
 * interval of length H. Cubic: Hermite's interpolant with the slopes of the parabola through three
 * successive points, and 0 at both ends:
 *   x0 + s^2 (3 - 2 s) (x1 - x0) + H (s (1 - s)^2 v0 - s^2 (1 - s) v1).
 * Before the first and after the last time the particle rests there. */
void ms_motion_evaluate(const ms_motion *motion, int32_t i, ms_instant at, double x[3],
                        double v[3]);

/* The first time of the motion after t, by more than rounding; INFINITY: none */
double ms_motion_next_time(const ms_motion *motion, double t);

/* The largest mean speed of a particle in an interval, m/s */
double ms_motion_find_speed(const ms_motion *motion);

msim_status ms_motion_copy(const msim_allocator *alloc, const ms_motion *from, ms_motion *to,
                           msim_error *err);
void ms_motion_free(const msim_allocator *alloc, ms_motion *motion);

#endif
