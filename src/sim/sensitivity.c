#include "sim/sensitivity.h"

#include <math.h>
#include <string.h>

#include "integrate/interpolate.h"
#include "integrate/methods.h"
#include "sim/sim.h"

msim_status ms_sensitivity_create(const msim_sim *sim, const ms_model *model, ms_disturbance *d,
                                  msim_error *err) {
  enum { MOST_SPRINGS = 128 };
  const int has_tol = ms_sim_has_control(sim) || ms_sim_selects(sim);
  if (sim->opt.watch != MSIM_WATCH_ON || !has_tol || model->springs.n > MOST_SPRINGS)
    return MSIM_OK;
  d->dx = ms_rows_vector(sim->scene, &model->rows);
  d->dv = ms_rows_vector(sim->scene, &model->rows);
  return d->dx && d->dv ? MSIM_OK : ms_fail_memory(err, "the growth of errors");
}

void ms_sensitivity_destroy(const ms_model *model, ms_disturbance *d) {
  if (!model->scene) return;
  ms_delete(&model->scene->alloc, d->dx);
  ms_delete(&model->scene->alloc, d->dv);
}

/* |d|: the largest of any part; d is scaled to length 1. */
static double normalize(ms_motion *m) {
  const ms_disturbance *d = &m->disturbance;
  const ms_shape shape = m->model.shape;
  double largest = 0;
  ms_norm_square(&m->norm, shape, 0, d->dx, d->dv);
  for (int32_t i = 0; i < m->norm.n; i++) largest = fmax(largest, m->norm.part[i].square[0]);
  const double length = sqrt(largest), by = length > 0 ? 1 / length : 1;
  ms_scale(shape, by, d->dx);
  ms_scale(shape, by, d->dv);
  return length;
}

void ms_sensitivity_start(msim_sim *sim) {
  sim->sensitivity = (ms_sensitivity){.evaluations0 = sim->stats.force_evaluations,
                                      .contacts0 = sim->stats.contacts};
}

/* Velocities are disturbed at first, as stiff springs make much of disturbed positions. */
void ms_sensitivity_start_island(ms_motion *m) {
  const double SHARE = 0.9;
  const ms_rows *rows = &m->model.rows;
  ms_disturbance *d = &m->disturbance;
  const size_t stride = (size_t)rows->stride;
  if (!d->dx) return;
  const ms_bounds bounds = ms_bounds_of(&m->model);
  memset(d->dx, 0, (size_t)rows->dims * stride * sizeof *d->dx);
  for (size_t c = 0; c < (size_t)rows->dims; c++)
    for (size_t r = 0; r < (size_t)rows->nfree; r++)
      d->dv[c * stride + r] = ms_arbitrary((uint32_t)(c * (size_t)rows->nfree + r));
  normalize(m);
  d->stride = SHARE * ms_symplectic_euler.limit(&bounds);
  d->time = d->error = 0;
}

/* f = J(x) dx + D(x) dv: with w = dx_j - dx_i a spring adds k (w - (L/l) (w - u u.w)) + c u u.w' to
 * row i, and the opposite to row j. */
static void multiply(const ms_model *model, const double *x, const ms_disturbance *d, double *f) {
  const ms_springs *springs = &model->springs;
  const size_t stride = (size_t)model->rows.stride, dims = (size_t)model->rows.dims;
  memset(f, 0, dims * stride * sizeof *f);
  ms_axpy(model->shape, -model->drag, d->dv, f);
  for (int32_t e = 0; e < springs->n; e++) {
    const size_t i = (size_t)springs->i[e], j = (size_t)springs->j[e];
    double u[3], w[3], square = 0, along = 0, rate = 0;
    for (size_t c = 0; c < dims; c++) {
      const size_t at = c * stride;
      u[c] = x[at + j] - x[at + i], w[c] = d->dx[at + j] - d->dx[at + i];
      square += u[c] * u[c], along += u[c] * w[c];
      rate += u[c] * (d->dv[at + j] - d->dv[at + i]);
    }
    const double ratio = square > 0 ? springs->rest[e] / sqrt(square) : 0;
    const double by = square > 0 ? 1 / square : 0;
    const double k = springs->k[e], pull = (k * ratio * along + springs->damping[e] * rate) * by;
    for (size_t c = 0; c < dims; c++) {
      const double add = k * (1 - ratio) * w[c] + pull * u[c];
      f[c * stride + i] += add, f[c * stride + j] -= add;
    }
  }
}

/* A stride that ends at x; returns |d'|/|d|. */
static double advance(ms_motion *m, const double *x) {
  const ms_shape shape = m->model.shape;
  ms_disturbance *d = &m->disturbance;
  double *f = m->stepper.scratch;
  multiply(&m->model, x, d, f);
  ms_scale_rows(shape, m->model.inv_mass, f, f);
  ms_axpy(shape, d->stride, f, d->dv);
  ms_axpy(shape, d->stride, d->dv, d->dx);
  return normalize(m);
}

static void report(msim_sim *sim, double growth) {
  const double tol = ms_sim_selects(sim) ? sim->selection.tol : sim->opt.tol;
  sim->sensitivity.state = MS_SENSITIVITY_REPORTED;
  ms_sim_warn(sim,
              "step %lld, t = %g s: the motion is sensitive to small errors: those of earlier "
              "steps have grown %.2g-fold on average, so that the error may exceed tol = %g, which "
              "bounds what steps add to it",
              (long long)sim->step, ms_sim_time(sim), growth, tol);
}

static int is_too_expensive(const msim_sim *sim) {
  const double FREE = 32, MOST = 0.1;
  const ms_sensitivity *s = &sim->sensitivity;
  const int64_t evaluations = sim->stats.force_evaluations - s->evaluations0;
  return (double)s->products > FREE + MOST * (double)evaluations;
}

static void follow(msim_sim *sim, ms_motion *m, double h) {
  const double LIMIT = 30, span = ms_plan_span(&sim->plan), run = ms_sim_time(sim) - sim->plan.t0;
  const ms_stepper *s = &m->stepper;
  ms_disturbance *d = &m->disturbance;
  for (d->time += h; d->time >= d->stride && !is_too_expensive(sim); d->time -= d->stride) {
    const double theta = 1 - (d->time - d->stride) / h;
    ms_hermite(s->model->shape, h, theta, s->x_next, s->v_next, s->x, s->v, s->x_spare[0]);
    d->error = d->error * advance(m, s->x_spare[0]) + d->stride / span;
    sim->sensitivity.products++;
  }
  if (is_too_expensive(sim)) sim->sensitivity.state = MS_SENSITIVITY_TOO_EXPENSIVE;
  else if (d->error > LIMIT * fmax(1, run / span)) report(sim, d->error * span / run);
}

void ms_sensitivity_follow(msim_sim *sim, double h) {
  ms_sensitivity *s = &sim->sensitivity;
  if (sim->stats.contacts > s->contacts0 && s->state == MS_SENSITIVITY_MEASURED)
    s->state = MS_SENSITIVITY_CONTACT;
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++)
    if (m->disturbance.dx && m->disturbance.stride < INFINITY && !m->at_rest &&
        s->state == MS_SENSITIVITY_MEASURED)
      follow(sim, m, h);
}

void ms_sensitivity_explain(const msim_sim *sim, ms_text *out) {
  static const char *const states[] = {
      [MS_SENSITIVITY_MEASURED] = "measured, and reported where it is large",
      [MS_SENSITIVITY_TOO_EXPENSIVE] =
          "not measured: that would take more than a tenth of the evaluations",
      [MS_SENSITIVITY_CONTACT] = "not measured any longer, as particles have met planes",
      [MS_SENSITIVITY_REPORTED] = "large, as was reported"};
  int is_any = 0;
  for (int32_t i = 0; i < sim->nislands; i++) is_any |= sim->motion[i].disturbance.dx != NULL;
  if (is_any) ms_print(out, "              growth of errors: %s\n", states[sim->sensitivity.state]);
}

void ms_sensitivity_archive(ms_bytes *b, ms_sensitivity *s) {
  int64_t *counts[] = {&s->evaluations0, &s->contacts0, &s->products};
  for (int i = 0; i < 3; i++) ms_bytes_pass_count(b, counts[i]);
  MS_BYTES_PASS(b, s->state);
  ms_bytes_check(b, s->state >= 0 && s->state <= MS_SENSITIVITY_REPORTED, "the growth of errors");
}

void ms_sensitivity_archive_island(ms_bytes *b, ms_shape shape, ms_disturbance *d) {
  if (!d->dx) return;
  double *numbers[] = {&d->stride, &d->time, &d->error};
  ms_bytes_pass_rows(b, shape, d->dx);
  ms_bytes_pass_rows(b, shape, d->dv);
  for (int i = 0; i < 3; i++) {
    MS_BYTES_PASS(b, *numbers[i]);
    ms_bytes_check(b, *numbers[i] >= 0, "the growth of errors");
  }
}
