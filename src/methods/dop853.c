/* dop853 - the explicit Runge-Kutta method of order 8 of Dormand and Prince, with dense output */
#include "methods/dop853_table.h"

#include <math.h>

#include "contact/contact_set.h"
#include "integrate/interpolate.h"
#include "methods/methods.h"
#include "methods/nystrom.h"

/* The method in Nystroem form (nystrom.h), with three more stages for dense output.
 *
 * Work vectors: also the k of those stages. */
enum { DENSE_STAGES_AT = 2 };

static const ms_nystrom table = {RESULT, STAGES, C, A, AA};

static msim_status dop853_step(ms_stepper *s, msim_error *err) {
  (void)err;
  ms_nystrom_step(&table, s);
  return MSIM_OK;
}

/* The difference of the result from those of order 5 (which = 0) and 3 (1) */
static void dop853_estimate(ms_stepper *s, int which, double *dx, double *dv) {
  ms_nystrom_estimate(&table, s, EE[which], E[which], dx, dv);
}

/* Computes the stages of the dense output of the step from x, v. tag: that of the cached stages at
 * its end. dense_output: DENSE_STAGES_AT + the index of the work vector that holds k of its end */
static void evaluate_dense_stages(ms_stepper *s, int tag, const double *x, const double *v,
                                  double *X, double *V) {
  ms_nystrom_stages of = {.x = x, .v = v, .X = X, .V = V};
  s->dense_output = DENSE_STAGES_AT + (tag == 2);
  ms_nystrom_find_slopes(&table, s, tag != 2, of.k);
  ms_nystrom_evaluate(&table, s, &of, RESULT + 1, STAGES);
}

/* v: the cubic interpolant + h sum_j d_j k_j,  x: the cubic interpolant + h^2 sum_j dd_j k_j,
 *   d_j = t^2 u^2 D_0j + t^3 u^2 D_1j + t^3 u^3 D_2j + t^4 u^3 D_3j,  t = theta,  u = 1 - theta
 * with three more stages; dd_j: with DD. If the end was reflected: the cubic one alone. */
static void interpolate_step(ms_stepper *s, double theta, double *x, double *v) {
  const double t = theta, u = 1 - theta;
  const double w[4] = {t * t * u * u, t * t * t * u * u, t * t * t * u * u * u,
                       t * t * t * t * u * u * u};
  const ms_shape shape = s->model->shape;
  double *k[STAGES];
  ms_nystrom_row row = {0}, row2 = {0};
  ms_nystrom_find_slopes(&table, s, s->dense_output == DENSE_STAGES_AT, k);
  for (int j = 0; j < STAGES; j++)
    for (int n = 0; n < 4; n++) row[j] += w[n] * D[n][j], row2[j] += w[n] * DD[n][j];
  const double *const x_ends[] = {s->x_next, s->x, s->v_next, s->v};
  const double *const v_ends[] = {s->v_next, s->v, k[0], k[RESULT]};
  ms_interpolate_hermite(shape, s->h, theta, x_ends, x);
  ms_interpolate_hermite(shape, s->h, theta, v_ends, v);
  const ms_nystrom_sums sums = {.slopes = STAGES, .x = x, .v = v, .to_x = x, .to_v = v};
  ms_nystrom_add_slopes(s, sums, row2, row, k);
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
  ms_nystrom_find_slopes(&table, s, s->dense_output == DENSE_STAGES_AT, k);
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
