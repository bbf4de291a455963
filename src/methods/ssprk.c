/* ssprk - explicit Runge-Kutta methods with ten stages for damping, of order 2 and 4 */
#include <math.h>

#include "methods/methods.h"

/* Methods for y' = f(y), y = (x, v), f = (v, a), of which all stages are steps of explicit Euler,
 *   Y_1 = y,  Y_(i+1) = Y_i + h/n f(Y_i),  y' = y + h/10 sum_i f(Y_i).
 * ssprk102 (Kraaijevanger, BIT 31 (1991) 482), n = 9, has no other stages:
 *   y' = y + 9/10 (Y_10 - y) + h/10 f(Y_10),
 * and the amplification factor (1 + 9 w^10)/10, w = 1 + z/9. ssprk104 (Ketcheson, SIAM J. Sci.
 * Comput. 30 (2008) 2113), n = 6, goes back once:
 *   Y_6 = y + 2/5 (q - y),  q = Y_5 + h/6 f(Y_5),
 *   y' = y + 9/25 (q - y) + 3/5 (Y_10 - y) + h/10 f(Y_10),
 * and has the amplification factor (1 + 18 w^5 + 6 w^10)/25, w = 1 + z/6.
 *
 * The error estimate is the difference from y + h sum_i d_i f(Y_i). With d of ssprk104 that has
 * order 3: the sums of d over 1, c, c^2 and A c are 1, 1/2, 1/3 and 1/6. With d of ssprk102, the
 * 3/8 rule, it has order 2, and the difference is about as large as the error, O(h^3). */
enum { STAGES = 10, NONE = -1 };

typedef struct coefficients {
  double n;
  int back; /* the stage after which the method goes back */
  double c[STAGES], d[STAGES];
} coefficients;

static const coefficients order_2 = {
    .n = 9,
    .back = NONE,
    .c = {0, 1. / 9, 2. / 9, 1. / 3, 4. / 9, 5. / 9, 2. / 3, 7. / 9, 8. / 9, 1},
    .d = {0.125, 0, 0, 0.375, 0, 0, 0.375, 0, 0, 0.125}};
static const coefficients order_4 = {
    .n = 6,
    .back = 4,
    .c = {0, 1. / 6, 1. / 3, 1. / 2, 2. / 3, 1. / 3, 1. / 2, 2. / 3, 5. / 6, 1},
    .d = {0.2, 0, 0, 0.3, 0, 0, 0.2, 0, 0.3, 0}};

/* work vectors; X and V, and x_next and v_next, alternate as stages; Q_X and Q_V: of ssprk104 */
enum { X, V, A, ERROR_X, ERROR_V, Q_X, Q_V };

typedef struct stage {
  double *x, *v;
} stage;

static void ssprk_start(ms_stepper *s) { ms_stepper_init_stage(s, s->work[X], s->work[V]); }

/* to = from + length f(Y_i), and the part of stage i in the error estimate */
static void advance_stage(ms_stepper *s, const coefficients *k, int i, stage at, stage from,
                          stage to, double length) {
  const ms_shape shape = s->model->state_shape;
  s->c = k->c[i];
  ms_stepper_evaluate(s, &(ms_fused_step){.x = at.x,
                                          .v = at.v,
                                          .a = k->d[i] > 0 ? s->work[A] : NULL,
                                          .v_to = to.v,
                                          .v_from = from.v,
                                          .h = length,
                                          .x_to = to.x,
                                          .x_from = from.x,
                                          .along = at.v,
                                          .drift = length});
  ms_stepper_add_work(s, 1. / STAGES, at.x, at.v);
  if (k->d[i] == 0) return;
  ms_vector_axpy(shape, -k->d[i] * s->h, at.v, s->work[ERROR_X]);
  ms_vector_axpy(shape, -k->d[i] * s->h, s->work[A], s->work[ERROR_V]);
}

/* to = y + a (Y_one - y) + b (Y_two - y) */
static void combine_stages(const ms_stepper *s, double a, stage one, double b, stage two,
                           stage to) {
  const ms_shape shape = s->model->state_shape;
  ms_vector_three_term(shape, s->x, a, one.x, b, two.x, 0, s->x, to.x);
  ms_vector_three_term(shape, s->v, a, one.v, b, two.v, 0, s->v, to.v);
}

static msim_status ssprk_step(ms_stepper *s, const coefficients *k) {
  const ms_shape shape = s->model->state_shape;
  const stage start = {s->x, s->v}, q = {s->work[Q_X], s->work[Q_V]};
  const stage at[2] = {{s->x_next, s->v_next}, {s->work[X], s->work[V]}};
  const stage error = {s->work[ERROR_X], s->work[ERROR_V]};
  ms_vector_add_scaled(shape, s->x, -1, s->x, error.x);
  ms_vector_add_scaled(shape, s->v, -1, s->v, error.v);
  for (int i = 0; i < STAGES - 1; i++) {
    const stage from = i ? at[i % 2] : start;
    advance_stage(s, k, i, from, from, i == k->back ? q : at[1 - i % 2], s->h / k->n);
    if (i == k->back) combine_stages(s, 0.4, q, 0, start, at[1 - i % 2]);
  }
  const stage last = at[1], end = at[0];
  if (k->back == NONE) combine_stages(s, 0.9, last, 0, start, end);
  else combine_stages(s, 0.36, q, 0.6, last, end);
  advance_stage(s, k, STAGES - 1, last, end, end, s->h / STAGES);
  ms_vector_add_two_scaled(shape, error.x, 1, end.x, -1, s->x, error.x);
  ms_vector_add_two_scaled(shape, error.v, 1, end.v, -1, s->v, error.v);
  ms_stepper_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

static msim_status ssprk102_step(ms_stepper *s, msim_error *err) {
  (void)err;
  return ssprk_step(s, &order_2);
}

static msim_status ssprk104_step(ms_stepper *s, msim_error *err) {
  (void)err;
  return ssprk_step(s, &order_4);
}

static void ssprk_estimate(ms_stepper *s, int which, double *dx, double *dv) {
  (void)which;
  ms_vector_copy(s->model->state_shape, s->work[ERROR_X], dx);
  ms_vector_copy(s->model->state_shape, s->work[ERROR_V], dv);
}

/* |w| <= 1 in the disc |z + 9| <= 9: every mode is stable with h w^2 <= 9 g and h g <= 18. Without
 * damping it grows by the factor 1 + 0.0057 (h w)^4 a step. */
static double ssprk102_limit(const ms_bounds *b) {
  return fmin(b->omega > 0 ? 9 / b->ratio : INFINITY, 18 / b->rate);
}

/* The region of stability contains the left half of the disc whose radius is the limit on the
 * imaginary axis, and the real axis down to -13.917. */
static double ssprk104_limit(const ms_bounds *b) {
  return fmin(4.92145 / b->omega, 13.917 / b->rate);
}

const ms_integrator ms_ssprk102 = {
    .entry = {.name = "ssprk102",
              .doc = "Runge-Kutta with 10 stages; for moderate damping at low accuracy; undamped "
                     "motion gains energy (Kraaijevanger 1991)",
              .order = 2},
    .counts_work = 1,
    .nwork = 5,
    .start = ssprk_start,
    .step = ssprk102_step,
    .estimate = ssprk_estimate,
    .limit = ssprk102_limit};

const ms_integrator ms_ssprk104 = {
    .entry = {.name = "ssprk104",
              .doc =
                  "Runge-Kutta with 10 stages; for moderate damping; stable below h omega = 4.92 "
                  "(Ketcheson 2008)",
              .order = 4},
    .counts_work = 1,
    .nwork = 7,
    .start = ssprk_start,
    .step = ssprk104_step,
    .estimate = ssprk_estimate,
    .low_estimate = 1,
    .limit = ssprk104_limit};
