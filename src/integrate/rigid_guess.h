/* rigid_guess - an initial guess of velocities: the body goes on as a rigid one
 *
 * Newton's method starts from it. Where the velocities at the start are nearly those of a rigid
 * body that turns with w about its centre, which moves with V, they become
 *   v' = V' + R (v - V),   R = 1 + K + K^2/(1 + sqrt(1 - |dt w|^2)),   K u = dt w x u,
 * R being the rotation by the angle whose sine is dt |w|: velocities of implicit Euler are chords
 * (x - x_before)/dt, from which w follows as the sine over dt. From v itself Newton's method would
 * start at x + dt v, where springs that turn are stretched by (dt w)^2/2, a hundred times the
 * change of the motion of a stiff body. V' is exact: forces of springs do not change momentum. */
#ifndef MS_RIGID_GUESS_H
#define MS_RIGID_GUESS_H

#include "integrate/integrator.h"

/* v: in, the velocities of the unknowns at s->x; out, the guess for dt (s) later. Unchanged where
 * particles are pinned; particles in contact keep their velocities, and V' = V where there are
 * any, or a force function. Uses s->scratch. Collective */
void ms_rigid_guess_advance(ms_stepper *s, double dt, double *v);

#endif
