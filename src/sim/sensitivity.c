#include "sim/sensitivity.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "integrate/interpolate.h"
#include "integrate/methods.h"
#include "sim/sim.h"

enum { FEW_SPRINGS = 128 };
static const double LENGTH = 1e-7; /* the length that d is scaled to */

msim_status ms_sensitivity_create(const msim_sim *sim, const ms_model *model, ms_disturbance *d,
                                  msim_error *err) {
  const int has_tol = ms_sim_has_control(sim) || ms_sim_selects(sim);
  if (sim->opt.watch != MSIM_WATCH_ON || !has_tol) return MSIM_OK;
  if (model->springs.n > FEW_SPRINGS && !sim->scene->nplanes) return MSIM_OK;
  double **vectors[] = {&d->dx, &d->dv, &d->x, &d->v, &d->a, &d->f};
  for (int i = 0; i < 6; i++)
    if (!(*vectors[i] = ms_rows_vector(sim->scene, &model->rows)))
      return ms_fail_memory(err, "the growth of errors");
  return MSIM_OK;
}

void ms_sensitivity_destroy(const ms_model *model, ms_disturbance *d) {
  if (!model->scene) return;
  double *vectors[] = {d->dx, d->dv, d->x, d->v, d->a, d->f};
  for (int i = 0; i < 6; i++) ms_delete(&model->scene->alloc, vectors[i]);
}

/* Scale d to LENGTH. Returns |d|/LENGTH, where |d| is the largest of any connected component. */
static double normalize(ms_motion *m) {
  const ms_disturbance *d = &m->disturbance;
  const ms_shape shape = m->model.shape;
  double largest = 0;
  ms_norm_square(&m->norm, shape, 0, d->dx, d->dv);
  for (int32_t i = 0; i < m->norm.n; i++) largest = fmax(largest, m->norm.part[i].square[0]);
  const double length = sqrt(largest) / LENGTH, by = length > 0 ? 1 / length : 1;
  ms_scale(shape, by, d->dx);
  ms_scale(shape, by, d->dv);
  ms_scale(shape, by, d->a);
  return length;
}

void ms_sensitivity_start(msim_sim *sim) {
  sim->sensitivity = (ms_sensitivity){.evaluations0 = sim->stats.force_evaluations,
                                      .contacts0 = sim->stats.contacts};
  for (const ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++)
    if (m->disturbance.dx && m->model.springs.n > FEW_SPRINGS)
      sim->sensitivity.state = MS_SENSITIVITY_TOO_EXPENSIVE;
}

static void clear(const ms_rows *rows, ms_disturbance *d) {
  const size_t bytes = (size_t)rows->dims * (size_t)rows->stride * sizeof *d->dx;
  memset(d->dx, 0, bytes), memset(d->dv, 0, bytes), memset(d->a, 0, bytes);
  d->time = d->error = 0;
}

static void take_start(ms_motion *m) {
  ms_copy(m->model.shape, m->stepper.x, m->disturbance.x);
  ms_copy(m->model.shape, m->stepper.v, m->disturbance.v);
}

/* Velocities are disturbed at first: stiff springs amplify disturbed positions. */
void ms_sensitivity_start_island(ms_motion *m) {
  const double SHARE = m->model.scene->nplanes ? 0.45 : 0.9; /* of the longest stable stride */
  const ms_rows *rows = &m->model.rows;
  ms_disturbance *d = &m->disturbance;
  const size_t stride = (size_t)rows->stride;
  if (!d->dx) return;
  const ms_bounds bounds = ms_bounds_of(&m->model);
  clear(rows, d);
  for (size_t c = 0; c < (size_t)rows->dims; c++)
    for (size_t r = 0; r < (size_t)rows->nfree; r++)
      d->dv[c * stride + r] = ms_arbitrary((uint32_t)(c * (size_t)rows->nfree + r));
  normalize(m);
  take_start(m);
  d->stride = SHARE * ms_symplectic_euler.limit(&bounds);
}

/* Make a stride that ends at x, which is overwritten. Returns |d'|/|d|, INFINITY if d overflows, as
 * only one from a corrupted checkpoint can. */
static double advance(ms_motion *m, double *x) {
  const ms_model *model = &m->model;
  ms_disturbance *d = &m->disturbance;
  double *f = m->stepper.scratch;
  const double H = d->stride;
  ms_axpy(model->shape, H, d->dv, d->dx);
  ms_axpy(model->shape, H * H / 2, d->a, d->dx);
  ms_axpy(model->shape, H / 2, d->a, d->dv);
  ms_force(model, x, NULL, f);
  ms_axpy(model->shape, 1, d->dx, x);
  ms_force(model, x, d->dv, d->f);
  ms_axpy(model->shape, -1, f, d->f);
  ms_scale_rows(model->shape, model->inv_mass, d->f, d->a);
  ms_axpy(model->shape, H / 2, d->a, d->dv);
  const double growth = normalize(m);
  return growth <= DBL_MAX ? growth : INFINITY;
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
  const double FREE = 64, MOST = 0.2;
  const ms_sensitivity *s = &sim->sensitivity;
  const int64_t others = sim->stats.force_evaluations - s->evaluations0;
  return (double)s->evaluations > FREE + MOST * (double)others;
}

/* The effect of an impact on d along the normal: dx' = x dx, dv' = v dv + mixed dx. */
typedef struct meeting {
  double x, v, mixed;
} meeting;

/* M^-1 F of the whole island at the end of the step */
static const double *accelerations(msim_sim *sim, ms_motion *m) {
  const ms_stepper *s = &m->stepper;
  ms_force(&m->model, s->x, s->v, s->scratch);
  ms_scale_rows(m->model.shape, m->model.inv_mass, s->scratch, s->scratch);
  sim->sensitivity.evaluations++;
  return s->scratch;
}

/* 1: a particle met the plane in the last step, of h, as *met says. *a: NULL until it is needed. */
static int has_met(msim_sim *sim, ms_motion *m, int32_t row, const msim_plane *plane, double h,
                   const double **a, meeting *met) {
  const double REST = 1e-9, SHARE = 0.3, e = plane->restitution, *n = plane->normal;
  const ms_rows *rows = &m->model.rows;
  const ms_part *part = &m->norm.part[m->norm.of[row]];
  double at[3];
  ms_row_get(rows, m->stepper.x, row, at);
  const double gap = ms_dot3(n, at) - plane->offset;
  ms_row_get(rows, m->disturbance.v, row, at);
  const double from = ms_dot3(n, at);
  ms_row_get(rows, m->stepper.v, row, at);
  const double to = ms_dot3(n, at);
  *met = (meeting){0};
  if (gap <= REST * part->extent && fabs(to) <= REST * part->speed) return 1;
  if (!(from < 0 && to > 0 && gap <= 2 * h * fmax(-from, to))) return 0;
  if (!*a) *a = accelerations(sim, m);
  ms_row_get(rows, *a, row, at);
  const double pull = ms_dot3(n, at), impulse = to - from - h * pull;
  if (impulse < SHARE * (1 + e) * -from) return 0;                /* forces turned it back */
  if (e < 1 && 2 * from > pull * m->disturbance.stride) return 1; /* on the way to rest */
  *met = (meeting){.x = -e, .v = -e, .mixed = (1 + e) * pull / from};
  return 1;
}

/* x += t v + t^2/2 a, v += t a */
static void move(double t, const double a[3], double x[3], double v[3]) {
  ms_axpy3(t, v, x);
  ms_axpy3(t * t / 2, a, x);
  ms_axpy3(t, a, v);
}

/* Apply the impacts of the last step, of h: d, of the end of the last stride, is moved to the end
 * of the step and back. */
static void meet_planes(msim_sim *sim, ms_motion *m, double h) {
  const ms_rows *rows = &m->model.rows;
  ms_disturbance *d = &m->disturbance;
  const double *a = NULL;
  for (int32_t row = 0; row < rows->nfree; row++)
    for (int32_t p = 0; p < sim->scene->nplanes; p++) {
      const double *n = sim->scene->planes[p].normal;
      double dx[3], dv[3], da[3];
      meeting met;
      if (!has_met(sim, m, row, &sim->scene->planes[p], h, &a, &met)) continue;
      ms_row_get(rows, d->dx, row, dx);
      ms_row_get(rows, d->dv, row, dv);
      ms_row_get(rows, d->a, row, da);
      move(d->time, da, dx, dv);
      const double x = ms_dot3(n, dx), v = ms_dot3(n, dv);
      ms_axpy3(met.x * x - x, n, dx);
      ms_axpy3(met.v * v + met.mixed * x - v, n, dv);
      move(-d->time, da, dx, dv);
      ms_row_put(rows, dx, row, d->dx);
      ms_row_put(rows, dv, row, d->dv);
    }
  d->error *= normalize(m);
}

static void follow(msim_sim *sim, ms_motion *m, double h) {
  const double LIMIT = 30, span = ms_plan_span(&sim->plan), run = ms_sim_time(sim) - sim->plan.t0;
  const ms_stepper *s = &m->stepper;
  ms_disturbance *d = &m->disturbance;
  for (d->time += h; d->time >= d->stride && !is_too_expensive(sim); d->time -= d->stride) {
    const double theta = 1 - (d->time - d->stride) / h;
    ms_hermite(s->model->shape, h, theta, d->x, d->v, s->x, s->v, s->x_spare[0]);
    d->error = (d->error + d->stride / span) * advance(m, s->x_spare[0]);
    sim->sensitivity.evaluations += 2;
  }
  if (sim->sensitivity.has_contact) meet_planes(sim, m, h);
  if (d->error > LIMIT * fmax(1, run / span)) {
    report(sim, d->error * span / run);
    clear(&m->model.rows, d);
  } else if (is_too_expensive(sim)) sim->sensitivity.state = MS_SENSITIVITY_TOO_EXPENSIVE;
  take_start(m);
}

/* Start measuring at the first contact, even if it was too expensive before. */
static void follow_contact(msim_sim *sim) {
  ms_sensitivity *s = &sim->sensitivity;
  s->has_contact = 1;
  if (s->state != MS_SENSITIVITY_TOO_EXPENSIVE) return;
  *s = (ms_sensitivity){.evaluations0 = sim->stats.force_evaluations, .has_contact = 1};
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++) {
    ms_sensitivity_start_island(m);
    m->disturbance.error = (ms_sim_time(sim) - sim->plan.t0) / ms_plan_span(&sim->plan);
  }
}

void ms_sensitivity_follow(msim_sim *sim, double h) {
  ms_sensitivity *s = &sim->sensitivity;
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++)
    if (m->disturbance.dx && m->disturbance.stride < INFINITY && !m->at_rest &&
        s->state == MS_SENSITIVITY_MEASURED)
      follow(sim, m, h);
  if (!s->has_contact && sim->stats.contacts > s->contacts0) follow_contact(sim);
}

void ms_sensitivity_explain(const msim_sim *sim, ms_text *out) {
  static const char *const states[] = {
      [MS_SENSITIVITY_MEASURED] = "measured, and reported where it is large",
      [MS_SENSITIVITY_TOO_EXPENSIVE] =
          "not measured: that would take more than a fifth of the evaluations",
      [MS_SENSITIVITY_REPORTED] = "large, as was reported"};
  int is_any = 0;
  for (int32_t i = 0; i < sim->nislands; i++) is_any |= sim->motion[i].disturbance.dx != NULL;
  if (is_any) ms_print(out, "              growth of errors: %s\n", states[sim->sensitivity.state]);
}

void ms_sensitivity_archive(ms_bytes *b, ms_sensitivity *s) {
  int64_t *counts[] = {&s->evaluations0, &s->contacts0, &s->evaluations};
  for (int i = 0; i < 3; i++) ms_bytes_pass_count(b, counts[i]);
  MS_BYTES_PASS(b, s->state);
  MS_BYTES_PASS(b, s->has_contact);
  ms_bytes_check(b, s->state >= 0 && s->state <= MS_SENSITIVITY_REPORTED, "the growth of errors");
  ms_bytes_check(b, s->has_contact == 0 || s->has_contact == 1, "the growth of errors");
}

void ms_sensitivity_archive_island(ms_bytes *b, ms_motion *m) {
  ms_disturbance *d = &m->disturbance;
  if (!d->dx) return;
  double *numbers[] = {&d->stride, &d->time, &d->error};
  double *vectors[] = {d->dx, d->dv, d->a};
  for (int i = 0; i < 3; i++) ms_bytes_pass_rows(b, m->model.shape, vectors[i]);
  for (int i = 0; i < 3; i++) {
    MS_BYTES_PASS(b, *numbers[i]);
    ms_bytes_check(b, *numbers[i] >= 0, "the growth of errors");
  }
  if (b->direction == MS_TAKE) take_start(m);
}
