/* euler - the explicit and the symplectic Euler method */
#include <math.h>

#include "methods/methods.h"

/* x' = x + h v,  v' = v + h a(x, v) */
static msim_status explicit_euler_step(ms_stepper *s, msim_error *err) {
  (void)err;
  ms_fused_step sweep = ms_stepper_kick_drift(s);
  sweep.along = s->v;
  ms_stepper_evaluate(s, &sweep);
  ms_stepper_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

/* |1 + h lambda| <= 1, lambda^2 + g lambda + w^2 = 0:  h w^2 <= g  for complex lambda, and, as
 * lambda = -g is possible,  h g <= 2 */
static double explicit_limit(const ms_bounds *b) {
  if (b->omega == 0) return 2 / b->rate;
  return fmin(b->least_rate / (b->omega * b->omega), 2 / b->rate);
}

/* v' = v + h a(x, v),  x' = x + h v' */
static msim_status symplectic_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_fused_step sweep = ms_stepper_kick_drift(s);
  ms_stepper_evaluate(s, &sweep);
  ms_stepper_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

const ms_integrator ms_explicit_euler = {
    .entry = {.name = "explicit-euler",
              .doc = "x' = x + h v, v' = v + h a; undamped motion gains energy (Teschner)",
              .order = 1},
    .one_step = 1,
    .step = explicit_euler_step,
    .limit = explicit_limit};

const ms_integrator ms_symplectic_euler = {
    .entry = {.name = "symplectic-euler",
              .doc = "v' = v + h a, x' = x + h v'; stable below h omega = 2 (de Vogelaere 1956)",
              .order = 1},
    .one_step = 1,
    .step = symplectic_step,
    .limit = ms_bounds_verlet_limit};
