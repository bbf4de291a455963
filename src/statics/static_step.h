/* static_step - one iteration of the search for an equilibrium
 *
 * A step of linearly implicit pseudo-transient continuation (Kelley and Keyes 1998), one of
 * Newton's method for
 *   min_d  U(x + d) + |d|_M^2/(2 h^2),
 * is a solve of (M + h^2 K) d = h^2 F; where K is not positive definite enough, it is clamped, or,
 * by conjugate gradients without obstacles, has less compression (linear/compression.h). A line
 * search along x + alpha d reduces U. h also serves as a trust region: d is no longer than
 * `radius`. Both grow after steps that reduce U as predicted.
 *
 * With obstacles, behind which x + d must not be, it is one of an active set method (Nocedal and
 * Wright, Numerical Optimization, 2006, 16.5, 18.1): d has given components along the normals of
 * planes in the active set, and K has the curvature of contact_curvature.h. At first these are the
 * planes, or tangents of solids, against which forces press particles; after each solve planes that
 * would have to pull leave the set, and those behind which d leads join it at their distance. The
 * line search moves particles onto the surfaces.
 *
 * Friction: in the active set particles stick as long as Coulomb's law lets friction hold them;
 * others slide, against slightly less friction than could hold them, so that they come to rest
 * within the cone. With friction the line search also ends before U less its work rises again, with
 * the friction there, as forces on a sliding body need not balance before it stops. */
#ifndef MS_STATIC_STEP_H
#define MS_STATIC_STEP_H

#include "sim/sim.h"

typedef struct ms_static_step {
  double h;             /* s */
  double radius;        /* m: the largest displacement of a particle in a step */
  double length;        /* m: of springs */
  int32_t most, solves; /* linear solves: allowed, and made so far */
} ms_static_step;

/* x (3n) += alpha d, in a sim of static_sim.h; h and radius become those of the next step. After
 * MSIM_NOT_CONVERGED x stays: no alpha reduces the energy, and h is shorter. */
msim_status ms_static_step_make(ms_static_step *step, msim_sim *sim, double *x, msim_error *err);

#endif
