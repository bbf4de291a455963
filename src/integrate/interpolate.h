/* interpolate - dense output: x and v at times within the step that was accepted last
 *
 * Until the next step begins, x_next and v_next hold the state at its start. */
#ifndef MS_INTERPOLATE_H
#define MS_INTERPOLATE_H

#include "integrate/integrator.h"

/* Hermite's cubic through y0 and y1 with slopes f0 and f1, ends = {y0, y1, f0, f1}, at the share
 * theta of a step of h:
 *   y0 + (3 t^2 - 2 t^3) (y1 - y0) + h (t - 2 t^2 + t^3) f0 + h (t^3 - t^2) f1 */
void ms_interpolate_hermite(ms_shape shape, double h, double theta, const double *const ends[4],
                            double *y);

/* x by the cubic of x and v at both ends, v by that of v and a. Computes the a if necessary. */
void ms_interpolate_cubic(ms_stepper *s, double theta, double *x, double *v);

/* By the method's own dense output, or else by the cubics. On input x has the pinned positions, and
 * v is 0 for pinned particles: stages are evaluated there. */
void ms_interpolate(const ms_integrator *integrator, ms_stepper *s, double theta, double *x,
                    double *v);

#endif
