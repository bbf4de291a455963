/* rigid_guess - an initial guess of velocities: the body goes on as a rigid one
 *
 * Newton's method starts from it. Where the velocities at the start are nearly those of a rigid
 * body that turns about its centre X, which moves with V, they are taken as chords of the step
 * before, as those of implicit Euler are: particles were at y = x - dt (v - V), x from the centre.
 * The rotation R takes the y nearest to the x (Kabsch 1976), and in the frame of the body particles
 * go on as before,
 *   v' = V' + (R (x + (x - R y)) - x)/dt.
 * From v itself Newton's method would start at x + dt v, where springs that turn by an angle a are
 * stretched by a^2/2, a hundred times the change of the motion of a stiff body.
 *
 * Forces of springs change neither momentum nor angular momentum. The first gives V' exactly; by
 * the second the positions x' = x0 + ah v' are turned until the residual has no moment about their
 * centre: implicit Euler slows a rotation by the share a^2 in a step. */
#ifndef MS_RIGID_GUESS_H
#define MS_RIGID_GUESS_H

#include "integrate/newton.h"

/* stage: v in, the velocities of the unknowns at s->x; out, the guess for dt (s) later. Unchanged
 * where particles are pinned. With contacts or a force function, which change momentum,
 * v' = V + R (v - V), and particles in contact keep their velocities. Uses s->scratch.
 * Collective */
void ms_rigid_guess_advance(ms_stepper *s, double dt, const ms_newton_stage *stage);

#endif
