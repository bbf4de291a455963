/* newton - the equation of an implicit stage, solved for the velocity
 *
 *   v = w + ah a(x, v),  x = x0 + ah v:     R(v) = M (w - v) + ah F(x0 + ah v, v) = 0
 * by v += d,  (M - ah D - ah^2 J) d = R.  The residual is exact always; the matrix leaves out what
 * the direction of dashpots adds to J, which has no symmetry, and is the clamped one until the
 * residual has dropped (Teran et al. 2005), so that far from the solution each d leads downhill.
 * Then it is the exact one: by conjugate gradients that leave out compressed springs where they
 * make it indefinite (linear/compression.h), else by solves in a trust region, clamped where that
 * matrix is indefinite. Each d is shortened until it reduces the incremental potential
 *   E(v) = |v - w|_M^2/2 + U(x0 + ah v),
 * which is measured spring by spring (physics/excess.h), or, where damping or contacts leave no
 * potential, until its slope at the end is no steep ascent (Matthies and Strang 1979). The whole
 * matrix, with the turning of dampers (physics/turning.h), takes over where a full step leaves a
 * third of the residual or more, and from the start where dampers are strong; then d is followed as
 * far as the residual drops. Each d is solved for as well as the residual has dropped (Eisenstat
 * and Walker 1996).
 *
 * Where dampers keep the lengths of springs, more than springs do, the exact and whole matrix makes
 * each d, which is followed whatever becomes of the residual, as far as no spring turns by more
 * than a quarter: a plate that turns by 80 degrees in a step takes 34 iterations so, and more than
 * 1000 where each had to reduce the residual.
 *
 * Cloth that buckles has many solutions v, the minima of E, of nearly the same energy. Which one is
 * found depends on rounding and tolerances; newton.rtol is the error with respect to that one. */
#ifndef MS_NEWTON_H
#define MS_NEWTON_H

#include "integrate/integrator.h"

typedef struct ms_stage {
  double ah;            /* the stage's share of the step */
  const double *x0, *w; /* what is known of x and v */
  double *x, *v;        /* out; v: the first guess in. Pinned rows of x are right */
  double *work[4];
} ms_stage;

/* Until the error of v is below newton.rtol times its change from the present state, or that of
 * free fall where this is larger, in the norm of M: the last correction was a whole one, and its
 * size times theta/(1 - theta), theta the ratio of the last two, is below that; or the correction
 * is at rounding level. MSIM_NOT_CONVERGED after newton.max_iterations. */
msim_status ms_newton_solve(ms_stepper *s, const ms_stage *stage, msim_error *err);

#endif
