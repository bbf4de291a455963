#include "integrate/methods.h"

/* x' = x + h v,  v' = v + h a(x, v) */
static msim_status explicit_step(ms_stepper *s, msim_error *err) {
  (void)err;
  ms_pass pass = ms_kick_drift(s);
  pass.along = s->v;
  ms_evaluate(s, &pass);
  ms_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

/* v' = v + h a(x, v),  x' = x + h v' */
static msim_status symplectic_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_pass pass = ms_kick_drift(s);
  ms_evaluate(s, &pass);
  ms_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

const ms_integrator ms_explicit_euler = {
    .entry = {.name = "explicit-euler",
              .doc = "x' = x + h v, v' = v + h a; grows without damping (Teschner)",
              .order = 1},
    .step = explicit_step};

const ms_integrator ms_symplectic_euler = {
    .entry = {.name = "symplectic-euler",
              .doc = "v' = v + h a, x' = x + h v'; stable below h omega = 2 (de Vogelaere 1956)",
              .order = 1},
    .step = symplectic_step};
