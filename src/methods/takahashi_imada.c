/* takahashi_imada - leapfrog with a modified force, of order 4 in transformed variables
 *
 * The leapfrog method for the potential V - h^2/24 |grad V|^2 / m, that is with
 *   a~(x) = a(x) + h^2/12 J a = a(x + h^2/12 a(x)) + O(h^4):
 *   v(t + h/2) = v(t - h/2) + h a~,  x(t + h) = x(t) + h v(t + h/2).
 * Its energy differs from the exact one by h^2/12 (v.V''v - V'.V'/m) + O(h^4), as does the exact
 * one after a change of variables by the flow of h^2/12 v.V': in
 *   X = x + h^2/12 a(x) + O(h^4),  V = v - h^2/12 J v
 * the method is of order 4. So it carries other variables than x and v, and converts them at the
 * start and for output; an error of the conversion does not grow.
 *
 * With y = (h omega)^2/12 a mode conserves V^2 + omega^2 (1 - y)(1 - 3 y + 3 y^2) X^2, before the
 * change of variables. So its energy is exact if V is scaled by 1 + y and X by
 *   (1 + y) sqrt((1 - y)(1 - 3 y + 3 y^2)).
 * A polynomial approximates this factor: its series up to y^2, 1 - y - y^2, with three more terms
 * that keep the error below 0.4 % for y <= 0.9, that is up to 0.95 of the longest stable step,
 * where the first term alone is wrong by a factor of 3.
 *
 * Takahashi and Imada, J. Phys. Soc. Japan 53 (1984) 3765; the change of variables: Rowlands,
 * J. Comput. Phys. 97 (1991) 235; to higher order: Blanes, Casas and Ros, SIAM J. Sci. Comput. 21
 * (1999) 711; a~ by a displaced point: Wisdom, Holman and Touma (1996).
 * On a cloth it costs a third of `force-gradient` at errors of 1e-6, where the longest stable step
 * of the latter is more accurate than necessary; from 1e-9 on it costs more. */

#include "methods/methods.h"

#define C (1.0 / 12)

enum { A, STAGE, X0, V0 }; /* work vectors; the last two hold x and v at the start of the run */

/* The force sweep for the stage x + h^2/12 a(x), at which a~ is evaluated */
static ms_fused_step make_stage_sweep(const ms_stepper *s) {
  double *a = s->work[A];
  return (ms_fused_step){.x = s->x,
                         .a = a,
                         .x_to = s->work[STAGE],
                         .x_from = s->x,
                         .along = a,
                         .drift = C * s->h * s->h};
}

/* to = x + sum_k POWER[k] (-h^2/12 J)^(k + 1) x, with J x replaced by a(x), and J d for the higher
 * powers by a(x + d) - a(x): (1 - y - y^2 + ..) x for linear forces */
static void convert_x(const ms_stepper *s, const double *x, double *to) {
  enum { POWERS = 5 };
  static const double POWER[POWERS] = {-1, -1, 0.33578852, 6.78221203, -5.88168404};
  const ms_shape shape = s->model->state_shape;
  const double factor = -C * s->h * s->h;
  double *a = s->work[A], *stage = s->work[STAGE], *change = s->scratch;
  ms_fused_step_run(s->model, &(ms_fused_step){.x = x, .a = a});
  ms_vector_add_scaled(shape, x, POWER[0] * factor, a, to);
  ms_vector_add_scaled(shape, x, factor, a, stage);
  for (int k = 1; k < POWERS; k++) {
    ms_fused_step_run(s->model, &(ms_fused_step){.x = stage, .a = change});
    ms_vector_axpy(shape, -1, a, change);
    ms_vector_axpy(shape, POWER[k] * factor, change, to);
    ms_vector_add_scaled(shape, x, factor, change, stage);
  }
}

/* to = v - h/12 (a(x + h v/2) - a(x - h v/2)) = (1 + y) v for linear forces; `to` may be v */
static void convert_v(const ms_stepper *s, const double *x, const double *v, double *to) {
  const ms_shape shape = s->model->state_shape;
  const double h = s->h;
  double *stage = s->work[STAGE], *ahead = s->scratch;
  ms_vector_add_scaled(shape, x, h / 2, v, stage);
  ms_fused_step_run(s->model, &(ms_fused_step){.x = stage, .a = ahead});
  ms_vector_add_scaled(shape, x, -h / 2, v, stage);
  ms_fused_step_run(
      s->model,
      &(ms_fused_step){
          .x = stage, .v_to = to, .v_from = v, .a_before = ahead, .h_before = -C * h, .h = C * h});
}

/* v_to = v_from + h a~(x) */
static void takahashi_imada_kick(const ms_stepper *s, const double *v_from, double h,
                                 double *v_to) {
  const ms_fused_step to_stage = make_stage_sweep(s);
  ms_fused_step_run(s->model, &to_stage);
  ms_fused_step_run(s->model,
                    &(ms_fused_step){.x = s->work[STAGE], .v_to = v_to, .v_from = v_from, .h = h});
}

enum { ROUNDS = 7 };

/* y += w (y0 - to); returns |y0 - to|^2 */
static double correct_toward(const ms_stepper *s, double w, const double *y0, const double *to,
                             double *y) {
  const ms_shape shape = s->model->state_shape;
  ms_vector_add_scaled(shape, y0, -1, to, s->scratch);
  ms_vector_axpy(shape, w, s->scratch, y);
  return ms_vector_dot(shape, s->scratch, s->scratch);
}

/* Inverts the conversion, from X0, V0 to s->x, s->v, by x += w (X0 - X(x)), and v likewise. An
 * iteration multiplies the error of a mode by 1 - w X/x, about y for slow modes with w = 1. The
 * last ones are for fast modes, with X/x down to 0.51 and V/v = 1 + y up to 1.9. Returns 0 if it
 * diverges by more than rounding. */
static int invert_conversion(ms_stepper *s) {
  static const double OF_X[ROUNDS] = {1, 1, 1, 1, 1, 1 / 0.65, 1 / 0.53},
                      OF_V[ROUNDS] = {1, 1, 1, 1, 1, 1 / 1.6, 1 / 1.85};
  const double *x0 = s->work[X0], *v0 = s->work[V0];
  double off[ROUNDS];
  for (int i = 0; i < ROUNDS; i++) {
    convert_x(s, s->x, s->x_next);
    off[i] = correct_toward(s, OF_X[i], x0, s->x_next, s->x);
  }
  for (int i = 0; i < ROUNDS; i++) {
    convert_v(s, s->x, s->v, s->v_next);
    correct_toward(s, OF_V[i], v0, s->v_next, s->v);
  }
  return off[ROUNDS - 1] <= off[0] + 1e-24 * ms_vector_dot(s->model->state_shape, x0, x0);
}

/* cached_stage = 1: the state is that at the start of the run. Far beyond the longest stable step
 * the conversion has no inverse: x and v stay as they are. */
static void takahashi_imada_start(ms_stepper *s) {
  const ms_shape shape = s->model->state_shape;
  ms_vector_copy_all(shape, s->x, s->work[X0]);
  ms_vector_copy_all(shape, s->v, s->work[V0]);
  ms_stepper_init_stage(s, s->work[STAGE], NULL);
  if (!invert_conversion(s)) {
    ms_vector_copy_all(shape, s->work[X0], s->x);
    ms_vector_copy_all(shape, s->work[V0], s->v);
  }
  takahashi_imada_kick(s, s->v, -s->h / 2, s->v);
  s->cached_stage = 1;
}

static msim_status takahashi_imada_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_fused_step to_stage = make_stage_sweep(s);
  ms_stepper_evaluate(s, &to_stage);
  ms_stepper_evaluate(s, &(ms_fused_step){.x = s->work[STAGE],
                                          .v_to = s->v_next,
                                          .v_from = s->v,
                                          .h = s->h,
                                          .x_to = s->x_next,
                                          .x_from = s->x,
                                          .drift = s->h});
  s->cached_stage_next = 0;
  return MSIM_OK;
}

static void takahashi_imada_show(const ms_stepper *s, double *x, double *v) {
  const ms_shape shape = s->model->state_shape;
  if (s->cached_stage) {
    ms_vector_copy_all(shape, s->work[X0], x);
    ms_vector_copy_all(shape, s->work[V0], v);
    return;
  }
  takahashi_imada_kick(s, s->v, s->h / 2, v);
  convert_x(s, s->x, x);
  convert_v(s, s->x, v, v);
}

/* Stable while 0 < h^2 omega^2 (1 - h^2 omega^2 / 12) < 4: h omega < sqrt(12) */
static double takahashi_imada_limit(const ms_bounds *b) { return 3.4641016151377544 / b->omega; }

const ms_integrator ms_takahashi_imada = {
    .entry = {.name = "takahashi-imada",
              .doc = "leapfrog with a(x + h^2/12 a(x)), in transformed variables; for forces that "
                     "do not depend on velocities, and scenes without planes; stable below h omega "
                     "= 3.46 (Takahashi and Imada 1984)",
              .order = 4},
    .separable = 1,
    .nwork = 4,
    .carried = 2,
    .carried_at = X0,
    .start = takahashi_imada_start,
    .step = takahashi_imada_step,
    .limit = takahashi_imada_limit,
    .convert_state = takahashi_imada_show};
