/* constrain - a step of an implicit method with planes and springs that are stiff for it
 *
 * Where springs swing many times in a step an impact is not one of a particle alone: what it is
 * tied to pushes on. So nothing is located. If in a step of the method contacts stay what they are,
 * that is the step. Else it is made anew by implicit Euler, which damps what an impact excites,
 * with velocities as unknowns and positions as conditions (Stewart and Trinkle, Int. J. Numer.
 * Meth. Eng. 39 (1996) 2673): along the normal of its planes a particle has a given velocity all
 * through the step,
 *   n.v = -gap/h       it reaches the plane,
 *   n.v = -e n.v_n     it bounces, faster than 2 h g,
 *   n.v = 0            it rests,
 * which the matrix knows. Friction is viscous there: -mu N v/w, with N and the speed w = |v| of the
 * last solve, so that it takes energy whatever N is; a particle that nearly stops sticks, until it
 * takes more than mu N to hold it. Particles that end behind a plane join, those on which a plane
 * would pull leave, and the step is made again until nothing changes. In stiff solids more than
 * four passes change only which few particles stick: from the fourth on contacts only join, until
 * no particle is left behind a plane. The matrix constrains velocities by large weights, so in the
 * end x and v along normals are set to what was given, by rounding and solver tolerance: a stiff
 * solid cannot be moved farther without energy.
 *
 * Velocities given to many particles of a stiff solid do work on it. Where energy has grown,
 * impacts are made without restitution; where it still has, planes have pulled, and the step is
 * made with n.v = 0 at all distances, which does no work. linearly-implicit-euler takes its own
 * steps in the first attempt, of one solve each. */
#ifndef MS_CONSTRAIN_H
#define MS_CONSTRAIN_H

#include "integrate/contacts.h"

/* Work vectors that implicit methods need for it: those of implicit Euler. */
enum { MS_CONSTRAIN_WORK = 6 };

msim_status ms_constrain_step(const ms_integrator *method, ms_stepper *s, msim_error *err);

#endif
