/* interpolate - states inside the step that was accepted last, for those who look there
 *
 * Until the next step begins the old state lies in x_next, v_next. */
#ifndef MS_INTERPOLATE_H
#define MS_INTERPOLATE_H

#include "integrate/integrator.h"

/* y = the cubic through y0 and y1 with slopes f0 and f1, a share theta of the way of length h:
 *   y0 + (3 t^2 - 2 t^3) (y1 - y0) + h (t - 2 t^2 + t^3) f0 + h (t^3 - t^2) f1 */
void ms_hermite(ms_shape shape, double h, double theta, const double *y0, const double *f0,
                const double *y1, const double *f1, double *y);

/* x and v of the cubics of both: the same to order 4 and 3 as what any method computes. */
void ms_interpolate_cubic(ms_stepper *s, double theta, double *x, double *v);

/* By the method's own interpolant, or else the cubic one. x has the pinned rows right, in v they
 * are 0. */
void ms_interpolate(const ms_integrator *integrator, ms_stepper *s, double theta, double *x,
                    double *v);

#endif
