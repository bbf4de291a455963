/* rkc - the number of stages of the Runge-Kutta-Chebyshev method, an explicit method for strong
 * damping */
#ifndef MS_RKC_H
#define MS_RKC_H

#include "physics/bounds.h"

/* A mode of frequency w and damping rate g has the eigenvalues z = -g/2 +- sqrt(g^2/4 - w^2), with
 * |z| <= max(g, w). With s stages the method is stable on the real axis from -0.653 (s^2 - 1)/h to
 * 0, so s = sqrt(1 + h max(rate, omega)/0.653), rounded up; at least 2, at most 1000.
 *
 * Modes that oscillate are stable, too, if h w^2 <= MS_RKC_STRIP g: then
 * |z|^2 h <= -2 MS_RKC_STRIP Re z, a disc through 0 that lies in the strip around the axis in which
 * the method is stable with any number of stages; the strip is narrowest with 3. So the mode with
 * the largest w^2/g decides (ms_bounds.ratio). Beyond this limit more stages do not help: a shorter
 * h or another method is necessary. Undamped motion gains energy for any h; motion across springs
 * is undamped unless there is drag. */
#define MS_RKC_STRIP 1.73
int32_t ms_rkc_count_stages(double h, ms_bounds bounds);

#endif
