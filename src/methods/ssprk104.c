/* ssprk104 - an explicit Runge-Kutta method of order 4 with ten stages, for moderate damping */
#include <math.h>

#include "methods/methods.h"

/* The method for y' = f(y), y = (x, v), f = (v, a), of which all stages are steps h/6 of explicit
 * Euler (Ketcheson, SIAM J. Sci. Comput. 30 (2008) 2113):
 *   Y_1 = y,  Y_(i+1) = Y_i + h/6 f(Y_i),  but  Y_6 = y + 2/5 (q - y),  q = Y_5 + h/6 f(Y_5),
 *   y' = y + 9/25 (q - y) + 3/5 (Y_10 - y) + h/10 f(Y_10) = y + h/10 sum_i f(Y_i).
 * Its amplification factor is (1 + 18 w^5 + 6 w^10)/25, w = 1 + z/6.
 *
 * y + h (f(Y_1)/5 + 3/10 f(Y_4) + f(Y_7)/5 + 3/10 f(Y_9)) has order 3: of these weights the sums
 * over 1, c, c^2 and A c are 1, 1/2, 1/3 and 1/6. The difference is the error estimate. */
enum { STAGES = 10, MIDDLE = 5 };
static const double C[STAGES] = {0,      1. / 6, 1. / 3, 1. / 2, 2. / 3,
                                 1. / 3, 1. / 2, 2. / 3, 5. / 6, 1};
static const double ORDER3[STAGES] = {0.2, 0, 0, 0.3, 0, 0, 0.2, 0, 0.3, 0};

/* work vectors; X and V, and x_next and v_next, alternate as stages */
enum { X, V, Q_X, Q_V, A, ERROR_X, ERROR_V };

typedef struct stage {
  double *x, *v;
} stage;

static void ssprk104_start(ms_stepper *s) { ms_stepper_init_stage(s, s->work[X], s->work[V]); }

/* to = from + length f(Y_i), and the part of stage i in the error estimate */
static void advance_stage(ms_stepper *s, int i, const double *x, const double *v, stage from,
                          stage to, double length) {
  const ms_shape shape = s->model->state_shape;
  s->c = C[i];
  ms_stepper_evaluate(s, &(ms_fused_step){.x = x,
                                          .v = v,
                                          .a = ORDER3[i] > 0 ? s->work[A] : NULL,
                                          .v_to = to.v,
                                          .v_from = from.v,
                                          .h = length,
                                          .x_to = to.x,
                                          .x_from = from.x,
                                          .along = v,
                                          .drift = length});
  ms_stepper_add_work(s, 1. / STAGES, x, v);
  if (ORDER3[i] == 0) return;
  ms_vector_axpy(shape, -ORDER3[i] * s->h, v, s->work[ERROR_X]);
  ms_vector_axpy(shape, -ORDER3[i] * s->h, s->work[A], s->work[ERROR_V]);
}

/* to = y + a (Y_one - y) + b (Y_two - y) */
static void combine_stages(const ms_stepper *s, double a, stage one, double b, stage two,
                           stage to) {
  const ms_shape shape = s->model->state_shape;
  ms_vector_three_term(shape, s->x, a, one.x, b, two.x, 0, s->x, to.x);
  ms_vector_three_term(shape, s->v, a, one.v, b, two.v, 0, s->v, to.v);
}

static msim_status ssprk104_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_shape shape = s->model->state_shape;
  const stage start = {s->x, s->v}, q = {s->work[Q_X], s->work[Q_V]};
  const stage at[2] = {{s->x_next, s->v_next}, {s->work[X], s->work[V]}};
  const stage error = {s->work[ERROR_X], s->work[ERROR_V]};
  ms_vector_add_scaled(shape, s->x, -1, s->x, error.x);
  ms_vector_add_scaled(shape, s->v, -1, s->v, error.v);
  for (int i = 0; i < STAGES - 1; i++) {
    const stage from = i ? at[i % 2] : start;
    advance_stage(s, i, from.x, from.v, from, i == MIDDLE - 1 ? q : at[1 - i % 2], s->h / 6);
    if (i == MIDDLE - 1) combine_stages(s, 0.4, q, 0, start, at[1 - i % 2]);
  }
  const stage last = at[1], end = at[0];
  combine_stages(s, 0.36, q, 0.6, last, end);
  advance_stage(s, STAGES - 1, last.x, last.v, end, end, s->h / 10);
  ms_vector_add_two_scaled(shape, error.x, 1, end.x, -1, s->x, error.x);
  ms_vector_add_two_scaled(shape, error.v, 1, end.v, -1, s->v, error.v);
  ms_stepper_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

static void ssprk104_estimate(ms_stepper *s, int which, double *dx, double *dv) {
  (void)which;
  ms_vector_copy(s->model->state_shape, s->work[ERROR_X], dx);
  ms_vector_copy(s->model->state_shape, s->work[ERROR_V], dv);
}

/* The region of stability contains the left half of the disc whose radius is the limit on the
 * imaginary axis, and the real axis down to -13.917. */
static double ssprk104_limit(const ms_bounds *b) {
  return fmin(4.92145 / b->omega, 13.917 / b->rate);
}

const ms_integrator ms_ssprk104 = {
    .entry = {.name = "ssprk104",
              .doc =
                  "Runge-Kutta with 10 stages; for moderate damping; stable below h omega = 4.92 "
                  "(Ketcheson 2008)",
              .order = 4},
    .counts_work = 1,
    .nwork = 7,
    .start = ssprk104_start,
    .step = ssprk104_step,
    .estimate = ssprk104_estimate,
    .low_estimate = 1,
    .limit = ssprk104_limit};
