/* rkc - how many stages the Runge-Kutta-Chebyshev method takes */
#ifndef MS_RKC_H
#define MS_RKC_H

#include "physics/bounds.h"

/* A mode of frequency w and damping rate g has the eigenvalues z = -g/2 +- sqrt(g^2/4 - w^2), none
 * beyond max(g, w). With s stages the method is stable on the real axis from -0.653 (s^2 - 1)/h on,
 * so s = sqrt(1 + h max(rate, omega)/0.653), rounded up.
 *
 * That also holds the modes that oscillate, if rates grow as springs do, g = rate (w/omega)^2:
 * their eigenvalues lie on a circle through 0 about -omega^2/rate, and the strip around the axis
 * in which the method is stable holds it where h omega^2 <= MS_RKC_STRIP rate. Beyond that more
 * stages do not help: h must be shorter, or the method another one. Undamped motion gains energy
 * at any h. */
#define MS_RKC_STRIP 1.88
int32_t ms_rkc_stages(double h, ms_bounds bounds);

#endif
