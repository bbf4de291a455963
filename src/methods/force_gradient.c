/* force_gradient - a composition method of order 4 with a force-gradient kick
 *
 * v += b_i h a,  x += a_i h v,  alternating: b_1 a_1 b_2 a_2 b_3 a_2 b_2 a_1 b_1. The kick in the
 * middle is that of the modified force F + g h^2 J M^-1 F; it is computed as F(x + g h^2 a(x)),
 * which is equal up to O(h^4) and takes one more evaluation (Wisdom, Holman and Touma 1996). So the
 * method is reversible and volume preserving, and symplectic to that order. A kernel for J a would
 * read both x and a of neighbours, as that of damping does, and take 1.3 times as many instructions
 * as the force. The last kick and the first of the next step use the same force: 5 evaluations a
 * step.
 *
 * Form: Omelyan, Mryglod and Folk, Phys. Rev. E 66 (2002) 026701. Two conditions on its four
 * coefficients give order 4. Two more, order 6 for linear forces, determine those below; for
 * nonlinear forces their error is close to the least possible, and at equal cost about 1/20 of that
 * of Chin's method 4A (1997). The method of Takahashi and Imada (takahashi_imada.c) is of order 4
 * in other variables than x and v, and is less expensive if errors may be larger. */
#include "methods/methods.h"
#include "methods/composition.h"

enum { DRIFTS = 4 };

#define A1 0.24004250742648506
#define B1 0.0891007659901135
#define B2 0.28694996084206753
#define G  0.023037733119604515
static const double kick[DRIFTS + 1] = {B1, B2, 1 - 2 * (B1 + B2), B2, B1};
static const double drift[DRIFTS] = {A1, 0.5 - A1, 0.5 - A1, A1};

static const ms_composition force_gradient_composition = {
    .drifts = DRIFTS, .kick = kick, .drift = drift, .gradient = G};

static msim_status force_gradient_step(ms_stepper *s, msim_error *err) {
  (void)err;
  ms_composition_step(s, &force_gradient_composition);
  return MSIM_OK;
}

static double force_gradient_limit(const ms_bounds *b) { return 3.1 / b->omega; }

const ms_integrator ms_force_gradient = {
    .entry = {.name = "force-gradient",
              .doc =
                  "symmetric, 5 evaluations, the middle one at x + g h^2 a(x); for forces that "
                  "do not depend on velocities; stable below h omega = 3.1 (Omelyan et al. 2002)",
              .order = 4},
    .separable = 1,
    .one_step = 1,
    .counts_work = 1,
    .nwork = MS_COMPOSITION_WORK,
    .carried = 1,
    .start = ms_composition_start,
    .step = force_gradient_step,
    .limit = force_gradient_limit};
