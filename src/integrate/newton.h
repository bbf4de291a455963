/* newton - Newton's method for the nonlinear equation of an implicit stage, in terms of velocities
 *
 *   v = w + ah a(x, v),  x = x0 + ah v:     R(v) = M (w - v) + ah F(x0 + ah v, v) = 0
 * by v += lambda d,  (M - ah D - ah^2 J) d = R.  The residual is always exact, but 0 in
 * directions in which contacts prescribe v, as solves leave v there. The matrix omits the
 * non-symmetric damping term, d(D v)/dx, and is the clamped one until the residual has dropped
 * (Teran et al. 2005), so that d is a descent direction far from the solution. Then it is the exact
 * one. Solvers with descend() use conjugate gradients that leave out the negative stiffness of
 * compressed springs where it makes the matrix indefinite (linear/compression.h); with other
 * solvers d is truncated at a trust radius, and an indefinite matrix is clamped. The line search
 * shortens d until it reduces the incremental potential
 *   E(v) = |v - w|_M^2/2 + U(x0 + ah v),
 * whose change is summed spring by spring (physics/nonlinearity.h), or, where damping or contacts
 * leave no potential, until its slope at the end is no steep ascent (Matthies and Strang 1979).
 * Without descend() the exact matrix is the full one, with the non-symmetric damping term
 * (physics/damping_derivative.h); with it, strong dampers need the full one after an iteration that
 * leaves more than 0.6 of the residual. The line search then reduces the residual. The tolerance of
 * each solve follows the drop of the residual (Eisenstat and Walker 1996).
 *
 * Where dampers, more than springs, keep the lengths of springs (integrate/damper_strength.h), each
 * d is that of the exact full matrix, where BiCGStab solves for it from the 16th iteration on, and
 * lambda is limited only so that the ends of no spring move by more than a quarter of its length,
 * even if the residual rises: a plate that turns by 80 degrees in a step takes 34 iterations so,
 * and more than 1000 if each must reduce the residual.
 *
 * Cloth that buckles has many solutions v, the minima of E, of nearly the same energy. Which one is
 * found depends on rounding and tolerances; newton.rtol is the error with respect to that one. */
#ifndef MS_NEWTON_H
#define MS_NEWTON_H

#include "integrate/integrator.h"

typedef struct ms_newton_stage {
  double ah;            /* s: the coefficient of the stage times h */
  const double *x0, *w; /* the known parts of x and v */
  double *x, *v;        /* out; in: the initial guess in v, the pinned positions in x */
  double *work[4];
} ms_newton_stage;

/* Iterates until the error of v, in the norm of M, is below newton.rtol times the change of v from
 * the present state, or that of free fall if larger (s->solve_tolerance may require less). The
 * estimate of the error after an iteration with lambda = 1, |d| theta/(1 - theta), must be below a
 * tenth of that; theta: the ratio of the last two |d|, or the tolerance of the solve if larger. A
 * correction at rounding level ends the iteration, too. MSIM_NOT_CONVERGED after
 * newton.max_iterations, or, with incomplete = accept, s->incomplete. */
msim_status ms_newton_solve(ms_stepper *s, const ms_newton_stage *stage, msim_error *err);

#endif
