/* rkc - how many stages the Runge-Kutta-Chebyshev method takes */
#ifndef MS_RKC_H
#define MS_RKC_H

#include "physics/bounds.h"

/* A mode of frequency w and damping rate g has the eigenvalues z = -g/2 +- sqrt(g^2/4 - w^2), none
 * beyond max(g, w). With s stages the method is stable on the real axis from -0.653 (s^2 - 1)/h on,
 * so s = sqrt(1 + h max(rate, omega)/0.653), rounded up.
 *
 * Modes that oscillate are stable, too, if h w^2 <= MS_RKC_STRIP g: then
 * |z|^2 h <= -2 MS_RKC_STRIP Re z, a disc through 0 that lies in the strip around the axis in which
 * the method is stable with any number of stages; with 3 it is the narrowest. So the mode with the
 * largest w^2/g decides (ms_bounds.ratio). Beyond that more stages do not help: h must be shorter,
 * or the method another one. Undamped motion gains energy at any h; motion across springs counts as
 * such unless there is drag.
 */
#define MS_RKC_STRIP 1.73
int32_t ms_rkc_stages(double h, ms_bounds bounds);

#endif
