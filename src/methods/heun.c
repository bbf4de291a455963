/* heun - Heun's method of order 2 */
#include <math.h>

#include "methods/methods.h"

/* x* = x + h v, v* = v + h a;  a* = a(x*, v*);
 * x' = x + h/2 (v + v*),  v' = v + h/2 (a + a*)
 *
 * Option heun.collision determines which states are reflected:
 *   final     the stage, for a* only, and the result
 *   standard  the result
 *   literal   the stage, for a* and for v* in x', and not the result, as in Teschner's exercises.
 *             The impulse then acts on the stage alone, and a particle never bounces. */
static msim_status heun_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_shape shape = s->model->state_shape;
  const double h = s->h;
  const int mode = s->opt->heun_collision;
  double *a = s->work[0], *a_stage = s->work[1], *v_predicted = s->work[2];
  ms_fused_step predict = ms_stepper_kick_drift(s);
  predict.along = s->v;
  predict.a = a;
  ms_stepper_evaluate(s, &predict);
  if (mode != MSIM_HEUN_LITERAL) ms_vector_copy(shape, s->v_next, v_predicted);
  if (mode != MSIM_HEUN_STANDARD) ms_stepper_reflect_stage(s, s->x_next, s->v_next);
  if (mode == MSIM_HEUN_LITERAL) ms_vector_copy(shape, s->v_next, v_predicted);
  s->c = 1;
  ms_stepper_acceleration(s, s->x_next, s->v_next, a_stage);
  ms_vector_add_two_scaled(shape, s->x, h / 2, s->v, h / 2, v_predicted, s->x_next);
  ms_vector_add_two_scaled(shape, s->v, h / 2, a, h / 2, a_stage, s->v_next);
  if (mode != MSIM_HEUN_LITERAL) ms_stepper_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

/* |1 + y + y^2/2| <= 1, y = h lambda with lambda^2 + g lambda + w^2 = 0: h g <= 2, and for complex
 * y, with z = h w and zeta = g/(2 w),  z^3 - 4 zeta z^2 + 8 zeta^2 z - 8 zeta <= 0.  This cubic has
 * one real root (Cardano's formula), which exceeds the other limit from zeta = 1/2 on. */
static double heun_limit(const ms_bounds *b) {
  if (!(b->least_rate < b->omega)) return 2 / b->rate;
  if (b->least_rate == 0) return 0;
  const double zeta = b->least_rate / (2 * b->omega);
  const double p = 8 * zeta * zeta / 9, q = zeta * (4 - 80 * zeta * zeta / 27);
  const double u = cbrt(q + sqrt(q * q + p * p * p));
  return fmin((u - p / u + 4 * zeta / 3) / b->omega, 2 / b->rate);
}

const ms_integrator ms_heun = {
    .entry =
        {.name = "heun",
         .doc =
             "x' = x + h/2 (v + v*), v' = v + h/2 (a + a*), stage * by explicit Euler (Teschner)",
         .order = 2},
    .one_step = 1,
    .nwork = 3,
    .step = heun_step,
    .limit = heun_limit};
