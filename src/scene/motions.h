/* motions - prescribed motions of points, piecewise linear or cubic in time: of pinned particles,
 * or of colliders (collider_motions.h) */
#ifndef MS_MOTIONS_H
#define MS_MOTIONS_H

#include "msim/scene.h"
#include "base/memory.h"

/* n points at nt times; the arrays belong to the scene. */
typedef struct ms_motion {
  int32_t n, nt, interpolation;
  int32_t *particles; /* n; NULL: of a collider */
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

/* Position and velocity of point i of the motion. Linear: x0 + s (x1 - x0), 0 <= s <= 1 in each
 * interval of length H. Cubic: Hermite's interpolant with the slopes of the parabola through three
 * successive points, and 0 at both ends:
 *   x0 + s^2 (3 - 2 s) (x1 - x0) + H (s (1 - s)^2 v0 - s^2 (1 - s) v1).
 * Before the first and after the last time the point rests there. */
void ms_motion_evaluate(const ms_motion *motion, int32_t i, ms_instant at, double x[3],
                        double v[3]);

/* The acceleration of point i at an instant, m/s^2; 0 between the times of a linear motion */
void ms_motion_find_acceleration(const ms_motion *motion, int32_t i, ms_instant at, double a[3]);

/* The largest speed, m/s, and acceleration, m/s^2, of points within intervals */
typedef struct ms_motion_bounds {
  double speed, acceleration;
} ms_motion_bounds;

ms_motion_bounds ms_motion_find_bounds(const ms_motion *motion);

/* The first time of the motion after t, by more than rounding; INFINITY: none */
double ms_motion_next_time(const ms_motion *motion, double t);

/* The largest mean speed of a point in an interval, m/s */
double ms_motion_find_speed(const ms_motion *motion);

/* Refuse times that do not increase, or are not finite, or none, and an unknown interpolation. */
msim_status ms_motion_check_times(int32_t nt, const double *t, int32_t interpolation,
                                  msim_error *err);

/* Refuse points, named `what` in messages, at distances or speeds whose squares overflow. */
msim_status ms_motion_check_range(const char *what, const ms_motion *motion, msim_error *err);

/* 1: the same bits */
int ms_motion_is_equal(const ms_motion *a, const ms_motion *b);

msim_status ms_motion_copy(const msim_allocator *alloc, const ms_motion *from, ms_motion *to,
                           msim_error *err);
void ms_motion_free(const msim_allocator *alloc, ms_motion *motion);

#endif
