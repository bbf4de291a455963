/* rk4 - the classical Runge-Kutta method of order 4 */
#include <math.h>

#include "methods/methods.h"

/* k1 = f(y), k2 = f(y + h/2 k1), k3 = f(y + h/2 k2), k4 = f(y + h k3),
 * y' = y + h/6 (k1 + 2 k2 + 2 k3 + k4), with y = (x, v), f = (v, a) */
static msim_status rk4_step(ms_stepper *s, msim_error *err) {
  (void)err;
  static const double reach[4] = {0, 0.5, 0.5, 1}, weight[4] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
  const ms_shape shape = s->model->state_shape;
  double *a = s->work[0], *v_stage = s->work[1], *x_sum = s->work[2], *v_sum = s->v_next;
  ms_vector_copy(shape, s->x, x_sum);
  ms_vector_copy(shape, s->v, v_sum);
  for (int stage = 0; stage < 4; stage++) {
    const double *v = stage ? v_stage : s->v, *x = stage ? s->x_next : s->x;
    if (stage) {
      /* the slope of x is the velocity of the stage before */
      ms_vector_add_scaled(shape, s->x, s->h * reach[stage], stage == 1 ? s->v : v_stage,
                           s->x_next);
      ms_vector_add_scaled(shape, s->v, s->h * reach[stage], a, v_stage);
    }
    s->c = reach[stage];
    ms_stepper_evaluate(s, &(ms_fused_step){.x = x,
                                            .v = v,
                                            .a = a,
                                            .v_to = v_sum,
                                            .v_from = v_sum,
                                            .h = s->h * weight[stage],
                                            .x_to = x_sum,
                                            .x_from = x_sum,
                                            .along = v,
                                            .drift = s->h * weight[stage]});
    ms_stepper_add_work(s, weight[stage], x, v);
  }
  ms_vector_copy(shape, x_sum, s->x_next);
  ms_stepper_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

/* The region of stability contains the imaginary axis up to 2 sqrt 2, the real one down to -2.785,
 * and of the left half plane the half disc of radius 2.615, and radii up to 2 sqrt 2 for
 * -Re y < 0.3 |y|. */
static double rk4_limit(const ms_bounds *b) {
  const double w = b->omega, g = b->rate;
  return g <= 0.5 * w ? sqrt(8) / w : fmin(2.615 / w, 2.785 / g);
}

const ms_integrator ms_rk4 = {
    .entry = {.name = "rk4",
              .doc = "the classical Runge-Kutta method; stable below h omega = 2.83 (Kutta 1901)",
              .order = 4},
    .one_step = 1,
    .counts_work = 1,
    .nwork = 3,
    .step = rk4_step,
    .limit = rk4_limit};
