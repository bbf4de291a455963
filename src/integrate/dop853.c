#include "integrate/dop853_table.h"
#include <math.h>

#include "integrate/methods.h"

/* Dormand and Prince's method of order 8 for y' = f(y), with y = (x, v), f = (v, a), written for
 * accelerations alone (Nystroem):
 *   k_i = a(X_i, V_i),  V_i = v + h sum_j A_ij k_j,
 *   X_i = x + C_i h v + h^2 sum_j AA_ij k_j
 * The state after the step is stage RESULT, and its k is the first one of the next step.
 *
 * Work vectors: the k of both ends, in turn; of the stages; of those of the interpolant. warm: 1 +
 * the vector that holds the k of the present state. */
static void find_slopes(const ms_stepper *s, int at, double *k[STAGES]) {
  for (int j = 1; j < RESULT; j++) k[j] = s->work[j + 1];
  for (int j = RESULT + 1; j < STAGES; j++) k[j] = s->work[j];
  k[0] = s->work[at];
  k[RESULT] = s->work[1 - at];
}

/* z = base + drift v + scale sum_j row_j k_j. Nullable: base. */
static void add_slopes(const ms_stepper *s, const double *base, double drift, const double *v,
                       double scale, const double row[STAGES], double *const k[STAGES], double *z) {
  const double *y[STAGES + 1];
  double w[STAGES + 1];
  int n = 0;
  if (drift != 0) w[n] = drift, y[n++] = v;
  for (int j = 0; j < STAGES; j++)
    if (row[j] != 0) w[n] = scale * row[j], y[n++] = k[j];
  ms_add_all(s->model->shape, base, n, w, y, z);
}

/* X and V of stage i of a step from x, v. Nullable: V. */
static void put_stage(const ms_stepper *s, const double *x, const double *v, int i,
                      double *const k[STAGES], double *X, double *V) {
  add_slopes(s, x, C[i] * s->h, v, s->h * s->h, AA[i], k, X);
  if (V) add_slopes(s, v, 0, v, s->h, A[i], k, V);
}

/* k of stage i; X and V may be anywhere. */
static void evaluate_stage(ms_stepper *s, const double *x, const double *v, int i,
                           double *const k[STAGES], double *X, double *V) {
  if (ms_is_separable(s)) V = NULL;
  put_stage(s, x, v, i, k, X, V);
  ms_acceleration(s, X, V, k[i]);
}

static msim_status step(ms_stepper *s, msim_error *err) {
  (void)err;
  const int now = s->warm == 2;
  double *k[STAGES];
  find_slopes(s, now, k);
  if (!s->warm) ms_acceleration(s, s->x, s->v, k[0]);
  for (int i = 1; i < RESULT; i++) evaluate_stage(s, s->x, s->v, i, k, s->x_next, s->v_next);
  put_stage(s, s->x, s->v, RESULT, k, s->x_next, s->v_next);
  const int64_t reflected = ms_reflect(s, s->x_next, s->v_next);
  if (!reflected) ms_acceleration(s, s->x_next, s->v_next, k[RESULT]);
  s->warm_next = reflected ? 0 : 2 - now;
  return MSIM_OK;
}

/* On the imaginary axis and on the real one; between them the region is no smaller. */
static double limit(const ms_bounds *b) { return fmin(5.96 / b->omega, 6.39 / b->rate); }

const ms_integrator ms_dop853 = {.entry = {.name = "dop853",
                                           .doc = "12 stages; stable below h omega = 5.96 (Dormand "
                                                  "and Prince; Hairer, Norsett and Wanner 1993)",
                                           .order = 8},
                                 .nwork = STAGES,
                                 .step = step,
                                 .limit = limit};
