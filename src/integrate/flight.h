/* flight - the path of one particle over a step that was made: Hermite's cubic */
#ifndef MS_FLIGHT_H
#define MS_FLIGHT_H

#include "integrate/contacts.h"
#include "physics/crossing.h"

typedef struct ms_flight {
  ms_cubic path[3]; /* x, over the share of the step */
  double h;         /* of the step */
} ms_flight;

/* From s->x, s->v to s->x_next, s->v_next in s->h. */
ms_flight ms_flight_of(const ms_stepper *s, int32_t row);

/* Where it is after a share q of the step, its velocity and acceleration there. */
void ms_flight_at(const ms_flight *f, double q, double x[3], double v[3], double a[3]);

/* The share of the step at which it first meets a plane after `from`; held: planes that it rests
 * on, and does not meet. MS_NOWHERE: it meets none. */
double ms_flight_meets(const ms_flight *f, const ms_walls *walls, const ms_touch *held, double from,
                       const msim_plane **plane);

/* What many impacts in one step come to, each particle treated for itself; h: the whole step, of
 * which that from s->x to s->x_next may be a part. */
void ms_flights_correct(ms_stepper *s, double h);

#endif
