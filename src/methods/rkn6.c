/* rkn6 - a symplectic Runge-Kutta-Nystroem method of order 6
 *
 * v += h b_i a(x),  x += h a_i v,  alternating: b_1 a_1 b_2 a_2 ... a_11 b_12, symmetric.
 * Coefficients: Blanes and Moan, J. Comput. Appl. Math. 142 (2002) 313, method SRKN_11^6, with 11
 * evaluations a step. */
#include "methods/methods.h"
#include "methods/composition.h"

enum { DRIFTS = 11, KICKS = 12 };

#define B6                                                                                   \
  (0.5 - (0.0414649985182624 + 0.198128671918067 - 0.0400061921041533 + 0.0752539843015807 - \
          0.0115113874206879))
#define A6                                                                                  \
  (1 - 2 * (0.123229775946271 + 0.290553797799558 - 0.127049212625417 - 0.246331761062075 + \
            0.357208872795928))
static const double kick[KICKS] = {0.0414649985182624,
                                   0.198128671918067,
                                   -0.0400061921041533,
                                   0.0752539843015807,
                                   -0.0115113874206879,
                                   B6,
                                   B6,
                                   -0.0115113874206879,
                                   0.0752539843015807,
                                   -0.0400061921041533,
                                   0.198128671918067,
                                   0.0414649985182624};
static const double drift[DRIFTS] = {0.123229775946271,  0.290553797799558,  -0.127049212625417,
                                     -0.246331761062075, 0.357208872795928,  A6,
                                     0.357208872795928,  -0.246331761062075, -0.127049212625417,
                                     0.290553797799558,  0.123229775946271};

static const ms_composition rkn6_composition = {.drifts = DRIFTS, .kick = kick, .drift = drift};

static msim_status rkn6_step(ms_stepper *s, msim_error *err) {
  (void)err;
  ms_composition_step(s, &rkn6_composition);
  return MSIM_OK;
}

/* For z = h w from 3.1414 to 3.1424 a mode grows by up to 4e-4 a step; from there to 6.3 none
 * grows. */
static double rkn6_limit(const ms_bounds *b) { return 3.1414 / b->omega; }

const ms_integrator ms_rkn6 = {
    .entry = {.name = "rkn6",
              .doc =
                  "Runge-Kutta-Nystroem, symplectic, 11 stages; for forces that do not depend on "
                  "velocities; stable below h omega = 3.1 (Blanes and Moan 2002)",
              .order = 6},
    .separable = 1,
    .one_step = 1,
    .counts_work = 1,
    .nwork = MS_COMPOSITION_WORK,
    .carried = 1,
    .start = ms_composition_start,
    .step = rkn6_step,
    .limit = rkn6_limit};
