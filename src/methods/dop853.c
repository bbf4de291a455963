/* dop853 - the explicit Runge-Kutta method of order 8 of Dormand and Prince, with dense output */
#include "methods/dop853_table.h"

#include <math.h>

#include "contact/contact_set.h"
#include "integrate/interpolate.h"
#include "methods/methods.h"
#include "physics/force_function.h"

/* The method for y' = f(y), with y = (x, v), f = (v, a), written for accelerations alone (Nystroem
 * form):
 *   k_i = a(X_i, V_i),  V_i = v + h sum_j A_ij k_j,
 *   X_i = x + C_i h v + h^2 sum_j AA_ij k_j
 * The state after the step is stage RESULT, and its k is the first one of the next step.
 *
 * Work vectors: the k of both ends, alternating; of the other stages; of the dense output.
 * cached_stage: 1 + the index of the work vector that holds k of the present state. */
enum { DENSE_STAGES_AT = 2 };

static void find_slopes(const ms_stepper *s, int at, double *k[STAGES]) {
  for (int j = 1; j < RESULT; j++) k[j] = s->work[j + 1];
  for (int j = RESULT + 1; j < STAGES; j++) k[j] = s->work[j];
  k[0] = s->work[at];
  k[RESULT] = s->work[1 - at];
}

/* Where the sums of slopes begin, NULL: at 0, and where they go; to_v NULL: x alone */
typedef struct slope_sums {
  const double *x, *v;
  double time; /* x begins at x + time v */
  double *to_x, *to_v;
} slope_sums;

/* x = its beginning + h^2 sum_j row2_j k_j,  v = its beginning + h sum_j row_j k_j. Terms that only
 * one of both has are added to the other one with weight 0. */
static void add_slopes(const ms_stepper *s, slope_sums of, const double row2[STAGES],
                       const double row[STAGES], double *const k[STAGES]) {
  const double *y[STAGES + 1];
  double x_weight[STAGES + 1], v_weight[STAGES + 1];
  int n = 0;
  if (of.time != 0) x_weight[n] = of.time, v_weight[n] = 0, y[n++] = of.v;
  for (int j = 0; j < STAGES; j++) {
    if (row2[j] == 0 && !(of.to_v && row[j] != 0)) continue;
    x_weight[n] = s->h * s->h * row2[j], v_weight[n] = s->h * row[j], y[n++] = k[j];
  }
  const ms_combination sums[2] = {{of.x, x_weight, of.to_x}, {of.v, v_weight, of.to_v}};
  if (of.to_v) ms_vector_two_combinations(s->model->shape, n, y, sums);
  else ms_vector_linear_combination(s->model->shape, of.x, n, x_weight, y, of.to_x);
}

/* A step from x, v: its stages are X and V, V NULL where no force depends on velocities; k: their
 * accelerations */
typedef struct stages {
  const double *x, *v;
  double *X, *V, *k[STAGES];
} stages;

/* X and V of stage i */
static void put_stage(const ms_stepper *s, const stages *of, int i) {
  const slope_sums sums = {of->x, of->v, C[i] * s->h, of->X, of->V};
  add_slopes(s, sums, AA[i], A[i], of->k);
}

/* k of the stages from..to - 1; of->X and of->V: scratch, with pinned positions in X */
static void evaluate_stages(ms_stepper *s, const stages *of, int from, int to) {
  stages with = *of;
  if (ms_stepper_is_separable(s) && !ms_force_function_does_work(s->model)) with.V = NULL;
  for (int i = from; i < to; i++) {
    put_stage(s, &with, i);
    s->c = C[i];
    ms_stepper_acceleration(s, with.X, with.V, with.k[i]);
    if (i < RESULT) ms_stepper_add_work(s, A[RESULT][i], with.X, with.V);
  }
}

static msim_status dop853_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const int now = s->cached_stage == 2;
  stages of = {.x = s->x, .v = s->v, .X = s->x_next, .V = s->v_next};
  find_slopes(s, now, of.k);
  if (!s->cached_stage) ms_stepper_acceleration(s, s->x, s->v, of.k[0]);
  else ms_stepper_evaluate_function(s, s->x, s->v);
  ms_stepper_add_work(s, A[RESULT][0], s->x, s->v);
  evaluate_stages(s, &of, 1, RESULT);
  put_stage(s, &of, RESULT);
  s->c = 1;
  const int64_t reflected = ms_stepper_reflect(s, s->x_next, s->v_next);
  if (!reflected) ms_stepper_acceleration(s, s->x_next, s->v_next, of.k[RESULT]);
  s->cached_stage_next = reflected ? 0 : 2 - now;
  return MSIM_OK;
}

/* The difference of the result, before reflection, from those of order 5 (which = 0) and 3 (1):
 *   dv = h sum_j E_j k_j,  dx = h^2 sum_j EE_j k_j */
static void dop853_estimate(ms_stepper *s, int which, double *dx, double *dv) {
  double *k[STAGES];
  find_slopes(s, s->cached_stage == 2, k);
  add_slopes(s, (slope_sums){.to_x = dx, .to_v = dv}, EE[which], E[which], k);
}

/* Computes the stages of the dense output of the step from x, v. tag: that of the cached stages at
 * its end. dense_output: DENSE_STAGES_AT + the index of the work vector that holds k of its end */
static void evaluate_dense_stages(ms_stepper *s, int tag, const double *x, const double *v,
                                  double *X, double *V) {
  stages of = {.x = x, .v = v, .X = X, .V = V};
  s->dense_output = DENSE_STAGES_AT + (tag == 2);
  find_slopes(s, tag != 2, of.k);
  evaluate_stages(s, &of, RESULT + 1, STAGES);
}

/* v: the cubic interpolant + h sum_j d_j k_j,  x: the cubic interpolant + h^2 sum_j dd_j k_j,
 *   d_j = t^2 u^2 D_0j + t^3 u^2 D_1j + t^3 u^3 D_2j + t^4 u^3 D_3j,  t = theta,  u = 1 - theta
 * with three more stages; dd_j: with DD. If the end was reflected: the cubic one alone. */
static void interpolate_step(ms_stepper *s, double theta, double *x, double *v) {
  const double t = theta, u = 1 - theta;
  const double w[4] = {t * t * u * u, t * t * t * u * u, t * t * t * u * u * u,
                       t * t * t * t * u * u * u};
  const ms_shape shape = s->model->shape;
  double *k[STAGES], row[STAGES] = {0}, row2[STAGES] = {0};
  find_slopes(s, s->dense_output == DENSE_STAGES_AT, k);
  for (int j = 0; j < STAGES; j++)
    for (int n = 0; n < 4; n++) row[j] += w[n] * D[n][j], row2[j] += w[n] * DD[n][j];
  const double *const x_ends[] = {s->x_next, s->x, s->v_next, s->v};
  const double *const v_ends[] = {s->v_next, s->v, k[0], k[RESULT]};
  ms_interpolate_hermite(shape, s->h, theta, x_ends, x);
  ms_interpolate_hermite(shape, s->h, theta, v_ends, v);
  add_slopes(s, (slope_sums){.x = x, .v = v, .to_x = x, .to_v = v}, row2, row, k);
}

static void dop853_interpolate(ms_stepper *s, double theta, double *x, double *v) {
  if (!s->dense_output && s->cached_stage)
    evaluate_dense_stages(s, s->cached_stage, s->x_next, s->v_next, x, v);
  if (s->dense_output < DENSE_STAGES_AT) ms_interpolate_cubic(s, theta, x, v);
  else if (s->h_made == 0) interpolate_step(s, theta, x, v);
  else {
    ms_stepper made = *s;
    made.h = s->h_made, made.x = s->x_spare[1], made.v = s->v_spare[1];
    interpolate_step(&made, theta * s->h / s->h_made, x, v);
  }
}

/* t^2 u^2, t^3 u^2, t^3 u^3 and t^4 u^3 are multiples of one Bernstein polynomial each, of degrees
 * 4, 5, 6 and 7. */
static void dop853_dense_entry(ms_stepper *s, size_t at, ms_bernstein *to) {
  static const int index[4] = {2, 3, 3, 4};
  static const double share[4] = {1. / 6, 1. / 10, 1. / 20, 1. / 35};
  double *k[STAGES];
  if (s->dense_output < DENSE_STAGES_AT) {
    double **stage = s->events->stage;
    ms_stepper_init_stage(s, stage[0], NULL);
    evaluate_dense_stages(s, s->cached_stage_next, s->x, s->v, stage[0], stage[1]);
  }
  find_slopes(s, s->dense_output == DENSE_STAGES_AT, k);
  *to = ms_bernstein_cubic(s->x[at], s->h * s->v[at], s->x_next[at], s->h * s->v_next[at]);
  for (int n = 0; n < 4; n++) {
    double sum = 0;
    for (int j = 0; j < STAGES; j++)
      if (DD[n][j] != 0) sum += DD[n][j] * k[j][at];
    ms_bernstein_elevate(to);
    to->c[index[n]] += share[n] * s->h * s->h * sum;
  }
}

/* On the imaginary axis and on the real one; the region of stability is no smaller between them. */
static double dop853_limit(const ms_bounds *b) { return fmin(5.96 / b->omega, 6.39 / b->rate); }

const ms_integrator ms_dop853 = {
    .entry =
        {.name = "dop853",
         .doc =
             "Runge-Kutta with 12 stages; controls its step size by tol unless `steps` is given; "
             "stable below h omega = 5.96 (Dormand and Prince; Hairer, Norsett and Wanner 1993)",
         .order = 8},
    .counts_work = 1,
    .nwork = STAGES,
    .carried = 1,
    .step = dop853_step,
    .estimate = dop853_estimate,
    .two_estimates = 1,
    .chooses_steps = 1,
    .interpolate = dop853_interpolate,
    .path = dop853_dense_entry,
    .limit = dop853_limit};
