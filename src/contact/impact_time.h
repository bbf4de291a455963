/* impact_time - when a particle on a parabola meets a solid: no impact is passed over, as each step
 * of the iteration leads to a lower bound of its time */
#ifndef MS_IMPACT_TIME_H
#define MS_IMPACT_TIME_H

#include "contact/obstacles.h"

/* The parabola from x at time t (s) with v and a */
typedef struct ms_parabola {
  const ms_collision_planes *planes;
  double t;
  const double *x, *v, *a;
} ms_parabola;

/* 1: it may touch a plane or solid within h. Solids that move are where they are at t. */
int ms_impact_time_may_touch(const ms_parabola *parabola, double h);

/* When s + u t + g t^2/2 falls below 0; INFINITY: never. */
double ms_impact_time_to_plane(double s, double u, double g);

/* Solids with samples: impacts on parts of the surface that it meets for less than 1/16 of a cell
 * may be passed over, where they are grazing. */
enum { MS_IMPACT_TIME_SHARES = 16 };

/* When the particle comes closer to solid i than the tolerance, from the time `from` after the
 * start on; INFINITY: not before `left`, until which no motion of the solid reaches a new time, or
 * not found within 100,000 lower bounds. */
double ms_impact_time_find(const ms_parabola *parabola, int32_t i, double from, double left,
                           double tolerance);

/* 1: at that time it is in the solid, by more than the tolerance. */
int ms_impact_time_is_inside(const ms_parabola *parabola, int32_t i, double when, double tolerance);

#endif
