/* rk6 - an explicit Runge-Kutta method of order 6 with eleven stages, for moderate damping */
#include "methods/rk6_table.h"

#include <math.h>

#include "methods/methods.h"

static const ms_nystrom table = {RESULT, STAGES, C, A, AA};

static msim_status rk6_step(ms_stepper *s, msim_error *err) {
  (void)err;
  ms_nystrom_step(&table, s);
  return MSIM_OK;
}

static void rk6_estimate(ms_stepper *s, int which, double *dx, double *dv) {
  (void)which;
  ms_nystrom_estimate(&table, s, EE, E, dx, dv);
}

/* On the imaginary axis and on the real one; the region of stability is no smaller between them. */
static double rk6_limit(const ms_bounds *b) { return fmin(2.48 / b->omega, 11.92 / b->rate); }

const ms_integrator ms_rk6 = {
    .entry = {.name = "rk6",
              .doc =
                  "Runge-Kutta with 11 stages; for moderate damping and small errors; stable below "
                  "h omega = 2.48",
              .order = 6},
    .counts_work = 1,
    .nwork = STAGES,
    .carried = 1,
    .step = rk6_step,
    .estimate = rk6_estimate,
    .low_estimate = 1,
    .limit = rk6_limit};
