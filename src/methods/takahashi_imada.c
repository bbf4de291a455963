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
 * Where forces depend on velocities, a is the whole acceleration, and J v its derivative along the
 * motion, da/dt. With u = v(t - h/2) and u' = v(t - 3h/2), a(x) is taken at the velocity v1, and
 * forces at the displaced point at v2:
 *   v1 = u + s (u - u'),  v2 = u + (u - u')/12 + 5/12 h a(x, v1).
 * For a smooth U through all v(t +- h/2), whose mean is U + h^2/8 U'', V is U + h^2/24 U''. v2 is V
 * but for h^3/288 V''' in modes of linear forces, 5/144 h^3 dJ/dt V where stiffness turns, and
 * O(h^3) that damping multiplies; v1, whose error counts h^2/12-fold, is V but for O(h^2) if
 * s = 1/2. So errors of damping are of order 3, small, and proportional to it.
 *
 * With w = (h omega)^2 and z = h g of a mode with the frequency omega and the damping rate g, and
 * q = (w + 5 z)/12, steps multiply by the roots of
 *   r^3 + (w (1 - q) + z b - 2) r^2 + (1 - z (b + c)) r + z c,
 *   b = 13/12 - (1 + s) q,  c = 1/12 - s q.
 * By Jury's criterion none exceeds 1 while q < 1 and 1 + (w + z) c > 0, that is for
 *   s < (1 + 12/(w + z))/(w + 5 z);
 * other conditions follow (a test). Where damping is weak this allows s = 1/2 up to w = 6, and 1/6
 * at w = 12.
 *
 * Takahashi and Imada, J. Phys. Soc. Japan 53 (1984) 3765; the change of variables: Rowlands,
 * J. Comput. Phys. 97 (1991) 235; to higher order: Blanes, Casas and Ros, SIAM J. Sci. Comput. 21
 * (1999) 711; a~ by a displaced point: Wisdom, Holman and Touma (1996).
 * On a cloth it costs a third of `force-gradient` at errors of 1e-6, where the longest stable step
 * of the latter is more accurate than necessary; from 1e-9 on it costs more. */

#include <math.h>

#include "methods/methods.h"

#define C (1.0 / 12)

/* Work vectors: X0, V0 hold x and v at the start of the run; where forces depend on velocities,
 * BEFORE holds u', V_STAGE v1 and then v2 */
enum { A, STAGE, X0, V0, BEFORE, V_STAGE, NWORK };

/* cached_stage, which selects the pair of work vectors that later steps read. 0: none, as where no
 * force depends on velocities, or where an unstable run has returned to an earlier state; AT_START:
 * x, v are those of X0, V0; HAS_HISTORY: BEFORE is set, and with it V_STAGE, which is not read. */
enum { AT_START = 1, HAS_HISTORY };

/* u + share (u - u') + ah a; NULL where no force depends on velocities. At the start V0, as these
 * are extrapolations to it. Without history u' is u, for one step. */
static const double *extrapolate(const ms_stepper *s, double share, double ah, const double *a) {
  const double *before = s->cached_stage == HAS_HISTORY ? s->work[BEFORE] : s->v;
  if (ms_stepper_is_separable(s)) return NULL;
  if (s->cached_stage == AT_START) return s->work[V0];
  ms_vector_three_term(s->model->state_shape, s->v, -share, before, 0, s->v, ah, a,
                       s->work[V_STAGE]);
  return s->work[V_STAGE];
}

/* v1, with an s below that of the stability limit for every mode within the bounds, so that the
 * fastest modes are damped */
static const double *extrapolate_stably(const ms_stepper *s) {
  const double BELOW = 0.8;
  const double w = s->h * s->h * s->bounds.omega * s->bounds.omega, z = s->h * s->bounds.rate;
  return extrapolate(s, fmin(0.5, BELOW * (1 + 12 / (w + z)) / (w + 5 * z)), 0, s->v);
}

/* v2, with the a(x, v1) that the force sweep to the stage left in A */
static const double *extrapolate_accurately(const ms_stepper *s) {
  return extrapolate(s, 1. / 12, 5. / 12 * s->h, s->work[A]);
}

/* After a step to v_next */
static void keep_velocities(ms_stepper *s) {
  s->cached_stage_next = ms_stepper_is_separable(s) ? 0 : HAS_HISTORY;
  if (s->cached_stage_next) ms_vector_copy(s->model->state_shape, s->v, s->work[BEFORE]);
}

/* The force sweep for the stage x + h^2/12 a(x), at which a~ is evaluated */
static ms_fused_step make_stage_sweep(const ms_stepper *s, const double *velocities) {
  double *a = s->work[A];
  return (ms_fused_step){.x = s->x,
                         .v = velocities,
                         .a = a,
                         .x_to = s->work[STAGE],
                         .x_from = s->x,
                         .along = a,
                         .drift = C * s->h * s->h};
}

/* Coefficients of y, y^2, .. in X/x, and in x/X, whose largest error for y <= 0.9 is 1.6 %; both
 * series begin with 1. */
enum { POWERS = 5 };
static const double TO_X[POWERS] = {-1, -1, 0.33578852, 6.78221203, -5.88168404},
                    FROM_X[POWERS] = {1, 2, 10.16958365, -33.98535583, 22.50474748};

/* to = x + sum_k power[k] (-h^2/12 J)^(k + 1) x, with J x replaced by a(x), and J d for the higher
 * powers by a(x + d) - a(x): (1 + power[0] y + ..) x for linear forces. A becomes a(x). */
static void convert_x(const ms_stepper *s, const double *power, const double *x,
                      const double *velocities, double *to) {
  const ms_shape shape = s->model->state_shape;
  const double factor = -C * s->h * s->h;
  double *a = s->work[A], *stage = s->work[STAGE], *change = s->scratch;
  ms_fused_step_run(s->model, &(ms_fused_step){.x = x, .v = velocities, .a = a});
  ms_vector_add_scaled(shape, x, power[0] * factor, a, to);
  ms_vector_add_scaled(shape, x, factor, a, stage);
  for (int k = 1; k < POWERS; k++) {
    ms_fused_step_run(s->model, &(ms_fused_step){.x = stage, .v = velocities, .a = change});
    ms_vector_axpy(shape, -1, a, change);
    ms_vector_axpy(shape, power[k] * factor, change, to);
    ms_vector_add_scaled(shape, x, factor, change, stage);
  }
}

/* Set STAGE to x + h v/2, and V_STAGE to v + h a/2, with the a(x) that convert_x left in A. Returns
 * V_STAGE, or NULL where no force depends on velocities. */
static const double *move_along(const ms_stepper *s, double h, const double *x, const double *v) {
  ms_vector_add_scaled(s->model->state_shape, x, h / 2, v, s->work[STAGE]);
  if (ms_stepper_is_separable(s)) return NULL;
  ms_vector_add_scaled(s->model->state_shape, v, h / 2, s->work[A], s->work[V_STAGE]);
  return s->work[V_STAGE];
}

/* to = v - h/12 (a(x + h v/2) - a(x - h v/2)) = (1 + y) v for linear forces; `to` may be v */
static void convert_v(const ms_stepper *s, const double *x, const double *v, double *to) {
  const double h = s->h;
  double *stage = s->work[STAGE], *ahead = s->scratch;
  const double *velocities = move_along(s, h, x, v);
  ms_fused_step_run(s->model, &(ms_fused_step){.x = stage, .v = velocities, .a = ahead});
  velocities = move_along(s, -h, x, v);
  ms_fused_step_run(s->model, &(ms_fused_step){.x = stage,
                                               .v = velocities,
                                               .v_to = to,
                                               .v_from = v,
                                               .a_before = ahead,
                                               .h_before = -C * h,
                                               .h = C * h});
}

/* v_to = v_from + h a~(x) */
static void takahashi_imada_kick(const ms_stepper *s, const double *v_from, double h,
                                 double *v_to) {
  const ms_fused_step to_stage = make_stage_sweep(s, extrapolate_stably(s));
  ms_fused_step_run(s->model, &to_stage);
  ms_fused_step_run(s->model, &(ms_fused_step){.x = s->work[STAGE],
                                               .v = extrapolate_accurately(s),
                                               .v_to = v_to,
                                               .v_from = v_from,
                                               .h = h});
}

enum { MOST_ROUNDS = 7, V_ROUNDS = 5 };

/* y += w (y0 - to); returns |y0 - to|^2 */
static double correct_toward(const ms_stepper *s, double w, const double *y0, const double *to,
                             double *y) {
  const ms_shape shape = s->model->state_shape;
  ms_vector_add_scaled(shape, y0, -1, to, s->scratch);
  ms_vector_axpy(shape, w, s->scratch, y);
  return ms_vector_dot(shape, s->scratch, s->scratch);
}

/* Inverts the conversion, from X0, V0 to s->x, s->v: x by the series for x/X, then x += X0 - X(x),
 * once unless X is far from linear; v += w (V0 - V(v)) by iterations that multiply the error of a
 * mode by 1 - w (1 + y), the last two for fast modes. Returns 0 if it diverges by more than
 * rounding. */
static int invert_conversion(ms_stepper *s) {
  static const double LINEAR = 0.02, OF_V[V_ROUNDS] = {1, 1, 1, 1 / 1.6, 1 / 1.85};
  const ms_shape shape = s->model->state_shape;
  const double *x0 = s->work[X0], *v0 = s->work[V0];
  const double *velocities = ms_stepper_is_separable(s) ? NULL : v0;
  const double rounding = (shape.single ? 1e-12 : 1e-24) * ms_vector_dot(shape, x0, x0);
  convert_x(s, FROM_X, x0, velocities, s->x);
  ms_vector_add_scaled(shape, s->x, -1, x0, s->scratch);
  const double change = ms_vector_dot(shape, s->scratch, s->scratch);
  double off = INFINITY;
  for (int i = 0; i < MOST_ROUNDS && off > LINEAR * LINEAR * change + rounding; i++) {
    convert_x(s, TO_X, s->x, velocities, s->x_next);
    off = correct_toward(s, 1, x0, s->x_next, s->x);
  }
  for (int i = 0; i < V_ROUNDS; i++) {
    convert_v(s, s->x, s->v, s->v_next);
    correct_toward(s, OF_V[i], v0, s->v_next, s->v);
  }
  return off <= change + rounding;
}

/* Far beyond the longest stable step the conversion has no inverse: x and v stay as they are. */
static void takahashi_imada_start(ms_stepper *s) {
  const ms_shape shape = s->model->state_shape;
  ms_vector_copy_all(shape, s->x, s->work[X0]);
  ms_vector_copy_all(shape, s->v, s->work[V0]);
  ms_stepper_init_stage(s, s->work[STAGE], s->work[V_STAGE]);
  if (!invert_conversion(s)) {
    ms_vector_copy_all(shape, s->work[X0], s->x);
    ms_vector_copy_all(shape, s->work[V0], s->v);
  }
  s->cached_stage = AT_START;
  takahashi_imada_kick(s, s->v, -s->h / 2, s->v);
}

static msim_status takahashi_imada_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_fused_step to_stage = make_stage_sweep(s, extrapolate_stably(s));
  ms_stepper_evaluate(s, &to_stage);
  ms_stepper_evaluate(s, &(ms_fused_step){.x = s->work[STAGE],
                                          .v = extrapolate_accurately(s),
                                          .v_to = s->v_next,
                                          .v_from = s->v,
                                          .h = s->h,
                                          .x_to = s->x_next,
                                          .x_from = s->x,
                                          .drift = s->h});
  keep_velocities(s);
  return MSIM_OK;
}

static void takahashi_imada_show(const ms_stepper *s, double *x, double *v) {
  const ms_shape shape = s->model->state_shape;
  if (s->cached_stage == AT_START) {
    ms_vector_copy_all(shape, s->work[X0], x);
    ms_vector_copy_all(shape, s->work[V0], v);
    return;
  }
  takahashi_imada_kick(s, s->v, s->h / 2, v);
  convert_x(s, TO_X, s->x, ms_stepper_is_separable(s) ? NULL : v, x);
  convert_v(s, s->x, v, v);
}

/* q = 1 for the bounds */
static double takahashi_imada_limit(const ms_bounds *b) {
  return 24 / (5 * b->rate + hypot(5 * b->rate, sqrt(48) * b->omega));
}

const ms_integrator ms_takahashi_imada = {
    .entry = {.name = "takahashi-imada",
              .doc =
                  "leapfrog with a(x + h^2/12 a(x)), in transformed variables; errors of damping "
                  "are of order 3; for scenes without planes; stable below h omega = 3.46, with "
                  "damping below h^2 omega^2 + 5 h g = 12 (Takahashi and Imada 1984)",
              .order = 4},
    .needs_bounds = 1,
    .nwork = NWORK,
    .carried = 2,
    .carried_at = X0,
    .start = takahashi_imada_start,
    .step = takahashi_imada_step,
    .limit = takahashi_imada_limit,
    .convert_state = takahashi_imada_show};
