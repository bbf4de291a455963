/* contact_step - one iteration of the search for an equilibrium in contact with obstacles
 *
 * Newton's method with an active set (Nocedal and Wright, Numerical Optimization, 2006, 16.5, 18.1)
 * minimizes
 *   U(x + d) + |d|_M^2/(2 h^2),  x + d not behind an obstacle,
 * by linear solves (M + h^2 H) d = h^2 F, H the Hessian of contact_curvature.h, in which d has
 * given components along the normals of planes in the active set. At first these are the planes, or
 * tangents of solids, against which forces press particles; after each solve planes that would have
 * to pull leave the set, and those behind which d leads join it at their distance. Then a line
 * search along x + alpha d, moved onto the surfaces, reduces U.
 *
 * Friction: in the active set particles stick as long as Coulomb's law lets friction hold them;
 * others slide, against slightly less friction than could hold them, so that they come to rest
 * within the cone. With friction the line search also ends before U less its work rises again, with
 * the friction there, as forces on a sliding body need not balance before it stops.
 *
 * h is the length of a step of pseudo-transient continuation, and a trust region: d is no longer
 * than `radius`. Both grow after steps that reduce U as predicted. */
#ifndef MS_CONTACT_STEP_H
#define MS_CONTACT_STEP_H

#include "sim/sim.h"

typedef struct ms_contact_step {
  double h;             /* s */
  double radius;        /* m: the longest way of a particle in a step */
  double length;        /* m: of springs */
  int32_t most, solves; /* linear solves: allowed, and made so far */
} ms_contact_step;

/* x (3n) += alpha d, in a sim of static_sim.h; h and radius become those of the next step. After
 * MSIM_NOT_CONVERGED x stays: no alpha reduces the energy, and h is shorter. */
msim_status ms_contact_step_make(ms_contact_step *step, msim_sim *sim, double *x, msim_error *err);

#endif
