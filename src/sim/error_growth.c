#include "sim/error_growth.h"

#include <float.h>
#include <math.h>

#include "base/vec3.h"
#include "contact/broad_phase.h"
#include "integrate/interpolate.h"
#include "methods/methods.h"
#include "sim/sim.h"

enum { FEW_SPRINGS = 128, MOST_STRIDES = 64 /* in a step */ };
static const double LENGTH = 1e-7; /* the length that d is scaled to */

/* Evaluations that the measurement may take: FREE, and this share of all others */
static const double FREE = 64, MOST = 0.2;

int ms_error_growth_is_measurable(const ms_model *model) {
  return model->springs.n <= FEW_SPRINGS || model->scene->nplanes;
}

static int is_requested(const msim_sim *sim) {
  const int has_tol = ms_sim_has_control(sim) || ms_sim_selects(sim);
  return sim->config.opt.watch == MSIM_WATCH_ON && has_tol;
}

msim_status ms_error_growth_create(const msim_sim *sim, const ms_model *model, ms_disturbance *d,
                                   msim_error *err) {
  if (!is_requested(sim)) return MSIM_OK;
  if (ms_scene_has_function(sim->scene)) return MSIM_OK; /* called by steps only */
  if (sim->part) return MSIM_OK;                         /* ranks would have to agree */
  if (!ms_error_growth_is_measurable(model)) return MSIM_OK;
  if (MS_NEW_VECTORS(sim->scene, &model->unknowns, &d->dx, &d->dv, &d->x, &d->v, &d->a, &d->f))
    return MSIM_OK;
  return ms_error_set_memory(err, "the growth of errors");
}

void ms_error_growth_destroy(const ms_model *model, ms_disturbance *d) {
  if (!model->scene) return;
  MS_FREE(&model->scene->alloc, d->dx, d->dv, d->x, d->v, d->a, d->f);
}

/* Scale d to LENGTH. Returns |d|/LENGTH, where |d| is the largest of any connected component;
 * INFINITY if d overflows, as only one from a corrupted checkpoint can: it is then useless. */
static double normalize(ms_island_sim *m) {
  const ms_disturbance *d = &m->disturbance;
  const ms_shape shape = m->model.shape;
  double largest = 0;
  ms_norm_square_errors(&m->norm, shape, 0, d->dx, d->dv);
  for (int32_t i = 0; i < m->norm.n; i++) {
    const double square = m->norm.body[i].square[0];
    largest = square <= DBL_MAX ? fmax(largest, square) : INFINITY; /* NaN, too */
  }
  const double length = sqrt(largest) / LENGTH, by = length > 0 ? 1 / length : 1;
  ms_vector_scale(shape, by, d->dx);
  ms_vector_scale(shape, by, d->dv);
  ms_vector_scale(shape, by, d->a);
  return ms_vector_find_invalid(shape, d->a) < 0 ? length : INFINITY;
}

/* 1: the whole run would take too many. Their number is known under fixed steps. */
static int is_run_too_expensive(const msim_sim *sim) {
  const ms_candidate *best = ms_choice_best(&sim->config.choice);
  const double span = ms_plan_span(&sim->config.plan);
  double sum = 0;
  if (!ms_sim_selects(sim) || best->control_tol > 0) return 0;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    if (m->disturbance.dx) sum += 2 * span / m->disturbance.stride;
  return sum > FREE + MOST * sim->nislands * span / sim->run.h * best->step_cost;
}

void ms_error_growth_start(msim_sim *sim) {
  sim->error_growth = (ms_error_growth){.evaluations0 = sim->stats.force_evaluations,
                                        .contacts0 = sim->stats.contacts};
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    if (m->disturbance.dx && m->model.springs.n > FEW_SPRINGS)
      sim->error_growth.state = MS_ERROR_GROWTH_TOO_EXPENSIVE;
  if (is_run_too_expensive(sim)) sim->error_growth.state = MS_ERROR_GROWTH_TOO_EXPENSIVE;
}

static void clear_disturbance(ms_shape shape, ms_disturbance *d) {
  ms_vector_clear_all(shape, d->dx);
  ms_vector_clear_all(shape, d->dv);
  ms_vector_clear_all(shape, d->a);
  d->time = d->error = 0;
}

static void copy_step_start(ms_island_sim *m) {
  ms_vector_copy(m->model.shape, m->stepper.x, m->disturbance.x);
  ms_vector_copy(m->model.shape, m->stepper.v, m->disturbance.v);
}

/* Velocities are disturbed at first: stiff springs amplify disturbed positions. */
void ms_error_growth_start_island(ms_island_sim *m) {
  const double SHARE = m->model.scene->nplanes ? 0.45 : 0.9; /* of the longest stable stride */
  const ms_unknowns *rows = &m->model.unknowns;
  ms_disturbance *d = &m->disturbance;
  const size_t stride = (size_t)rows->stride;
  if (!d->dx) return;
  const ms_bounds bounds = ms_bounds_compute_island(&m->model);
  clear_disturbance(m->model.shape, d);
  for (size_t c = 0; c < (size_t)rows->dims; c++)
    for (size_t r = 0; r < (size_t)rows->nfree; r++)
      d->dv[c * stride + r] = ms_vector_random_entry((uint32_t)(c * (size_t)rows->nfree + r));
  normalize(m);
  copy_step_start(m);
  d->stride = SHARE * ms_symplectic_euler.limit(&bounds);
}

/* Make a stride that ends at x, which is overwritten. Returns |d'|/|d|. */
static double advance_disturbance(ms_island_sim *m, double *x) {
  const ms_model *model = &m->model;
  ms_disturbance *d = &m->disturbance;
  double *f = m->stepper.scratch;
  const double H = d->stride;
  ms_vector_axpy(model->shape, H, d->dv, d->dx);
  ms_vector_axpy(model->shape, H * H / 2, d->a, d->dx);
  ms_vector_axpy(model->shape, H / 2, d->a, d->dv);
  ms_force_compute(model, x, NULL, f);
  ms_vector_axpy(model->shape, 1, d->dx, x);
  ms_force_compute(model, x, d->dv, d->f);
  ms_vector_axpy(model->shape, -1, f, d->f);
  ms_vector_scale_rows(model->shape, model->inv_mass, d->f, d->a);
  ms_vector_axpy(model->shape, H / 2, d->a, d->dv);
  return normalize(m);
}

static void report_growth(msim_sim *sim, double growth) {
  const double tol = ms_sim_selects(sim) ? sim->config.choice.tol : sim->config.opt.tol;
  sim->error_growth.state = MS_ERROR_GROWTH_REPORTED;
  ms_sim_warn(sim,
              "step %lld, t = %g s: the motion amplifies small errors: those of earlier steps have "
              "grown %.2g-fold on average, so that the error may exceed tol = %g, which bounds the "
              "error of single steps only; use a smaller tol or a shorter run",
              (long long)sim->run.step, ms_sim_time(sim), growth, tol);
}

static int is_too_expensive(const msim_sim *sim) {
  const ms_error_growth *s = &sim->error_growth;
  const int64_t others = sim->stats.force_evaluations - s->evaluations0;
  return (double)s->evaluations > FREE + MOST * (double)others;
}

/* The effect of an impact on d along the normal: dx' = x dx, dv' = v dv + mixed dx. */
typedef struct impact_effect {
  double x, v, mixed;
} impact_effect;

/* M^-1 F of the whole island at the end of the step */
static const double *accelerations(msim_sim *sim, ms_island_sim *m) {
  const ms_stepper *s = &m->stepper;
  ms_force_compute(&m->model, s->x, s->v, s->scratch);
  ms_vector_scale_rows(m->model.shape, m->model.inv_mass, s->scratch, s->scratch);
  sim->error_growth.evaluations++;
  return s->scratch;
}

typedef struct last_step {
  double h;
  const double *a; /* accelerations at its end; NULL until they are needed */
} last_step;

/* Speeds and distances at rest, over the scales of a body */
static const double REST = 1e-9;

/* 1: a particle met the plane in the last step, of h, as *met says. */
static int find_impact_effect(msim_sim *sim, ms_island_sim *m, int32_t row, const msim_plane *plane,
                              last_step *step, impact_effect *met) {
  const double SHARE = 0.3, e = plane->restitution, *n = plane->normal;
  const ms_unknowns *rows = &m->model.unknowns;
  const ms_norm_body *part = &m->norm.body[m->norm.body_of[row]];
  double at[3];
  ms_unknowns_get(rows, m->stepper.x, row, at);
  const double gap = ms_vec3_dot(n, at) - plane->offset;
  ms_unknowns_get(rows, m->disturbance.v, row, at);
  const double from = ms_vec3_dot(n, at);
  ms_unknowns_get(rows, m->stepper.v, row, at);
  const double to = ms_vec3_dot(n, at);
  *met = (impact_effect){0};
  if (gap <= REST * part->extent && fabs(to) <= REST * part->speed) return 1;
  if (!(from < 0 && to > 0 && gap <= 2 * step->h * fmax(-from, to))) return 0;
  if (!step->a) step->a = accelerations(sim, m);
  ms_unknowns_get(rows, step->a, row, at);
  const double pull = ms_vec3_dot(n, at), impulse = to - from - step->h * pull;
  if (impulse < SHARE * (1 + e) * -from) return 0;                /* forces turned it back */
  if (e < 1 && 2 * from > pull * m->disturbance.stride) return 1; /* on the way to rest */
  *met = (impact_effect){.x = -e, .v = -e, .mixed = (1 + e) * pull / from};
  return 1;
}

/* x += t v + t^2/2 a, v += t a */
static void move_disturbance(double t, const double a[3], double x[3], double v[3]) {
  ms_vec3_axpy(t, v, x);
  ms_vec3_axpy(t * t / 2, a, x);
  ms_vec3_axpy(t, a, v);
}

/* The particles that may have met a plane in the last step, of h: they are at rest there, or within
 * 2 h max(-n.v, n.v') of it, v and v' the velocities before and after the step, which is at most
 * 2 h n.(v' - v) where n.v < 0 < n.v'. planes: outlives it */
static ms_broad_phase begin_broad_phase(const msim_sim *sim, ms_island_sim *m, double h,
                                        ms_collision_planes *planes) {
  const ms_shape shape = m->model.shape;
  double extent = 0, *back = m->stepper.x_spare[0];
  for (int32_t i = 0; i < m->norm.n; i++) extent = fmax(extent, m->norm.body[i].extent);
  ms_vector_add_scaled(shape, m->stepper.x, -2 * h, m->stepper.v, back);
  ms_vector_axpy(shape, 2 * h, m->disturbance.v, back);
  *planes = (ms_collision_planes){
      .n = sim->scene->nplanes, .plane = sim->scene->planes, .contact_distance = REST * extent};
  return (ms_broad_phase){.model = &m->model, .planes = planes, .x = m->stepper.x, .x_end = back};
}

/* Apply the impacts of the last step, of h: d, of the end of the last stride, is moved to the end
 * of the step and back. */
static void apply_impacts(msim_sim *sim, ms_island_sim *m, double h) {
  const ms_unknowns *rows = &m->model.unknowns;
  ms_disturbance *d = &m->disturbance;
  ms_collision_planes planes;
  ms_broad_phase near = begin_broad_phase(sim, m, h, &planes);
  last_step step = {.h = h};
  int any = 0;
  for (int32_t row = ms_broad_phase_next(&near, 0); row < rows->nfree;
       row = ms_broad_phase_next(&near, row + 1))
    for (int32_t p = 0; p < sim->scene->nplanes; p++) {
      const double *n = sim->scene->planes[p].normal;
      double dx[3], dv[3], da[3];
      impact_effect met;
      if (!find_impact_effect(sim, m, row, &sim->scene->planes[p], &step, &met)) continue;
      any = 1;
      ms_unknowns_get(rows, d->dx, row, dx);
      ms_unknowns_get(rows, d->dv, row, dv);
      ms_unknowns_get(rows, d->a, row, da);
      move_disturbance(d->time, da, dx, dv);
      const double x = ms_vec3_dot(n, dx), v = ms_vec3_dot(n, dv);
      ms_vec3_axpy(met.x * x - x, n, dx);
      ms_vec3_axpy(met.v * v + met.mixed * x - v, n, dv);
      move_disturbance(-d->time, da, dx, dv);
      ms_unknowns_set(rows, dx, row, d->dx);
      ms_unknowns_set(rows, dv, row, d->dv);
    }
  if (any) d->error *= normalize(m);
}

static void follow_island(msim_sim *sim, ms_island_sim *m, double h) {
  const double LIMIT = 30, span = ms_plan_span(&sim->config.plan),
               run = ms_sim_time(sim) - sim->config.plan.t0;
  const ms_stepper *s = &m->stepper;
  ms_disturbance *d = &m->disturbance;
  d->time += h;
  if (d->time > MOST_STRIDES * d->stride) sim->error_growth.state = MS_ERROR_GROWTH_TOO_EXPENSIVE;
  if (sim->error_growth.state != MS_ERROR_GROWTH_MEASURED) return;
  for (; d->time >= d->stride && !is_too_expensive(sim); d->time -= d->stride) {
    const double theta = 1 - (d->time - d->stride) / h;
    const double *const ends[] = {d->x, s->x, d->v, s->v};
    ms_interpolate_hermite(s->model->shape, h, theta, ends, s->x_spare[0]);
    d->error = (d->error + d->stride / span) * advance_disturbance(m, s->x_spare[0]);
    sim->error_growth.evaluations += 2;
  }
  if (sim->error_growth.has_contact) apply_impacts(sim, m, h);
  if (!(d->error <= LIMIT * fmax(1, run / span))) { /* NaN if d overflows */
    report_growth(sim, d->error * span / run);
    clear_disturbance(m->model.shape, d);
  } else if (is_too_expensive(sim)) sim->error_growth.state = MS_ERROR_GROWTH_TOO_EXPENSIVE;
  copy_step_start(m);
}

/* From here on, with E as if earlier errors had not grown. */
static void start_anew(msim_sim *sim) {
  ms_error_growth *s = &sim->error_growth;
  s->state = MS_ERROR_GROWTH_MEASURED;
  s->evaluations0 = sim->stats.force_evaluations, s->evaluations = 0;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    ms_error_growth_start_island(m);
    m->disturbance.error =
        (ms_sim_time(sim) - sim->config.plan.t0) / ms_plan_span(&sim->config.plan);
  }
}

void ms_error_growth_change_springs(msim_sim *sim) {
  if (sim->error_growth.state == MS_ERROR_GROWTH_MEASURED) start_anew(sim);
}

void ms_error_growth_follow(msim_sim *sim, double h) {
  ms_error_growth *s = &sim->error_growth;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    if (m->disturbance.dx && m->disturbance.stride < INFINITY && !m->at_rest &&
        s->state == MS_ERROR_GROWTH_MEASURED)
      follow_island(sim, m, h);
  if (s->has_contact || sim->stats.contacts <= s->contacts0) return;
  s->has_contact = 1;
  if (s->state == MS_ERROR_GROWTH_TOO_EXPENSIVE) start_anew(sim);
}

void ms_error_growth_explain(const msim_sim *sim, ms_text *out) {
  static const char *const states[] = {
      [MS_ERROR_GROWTH_MEASURED] = "measured, and reported if it is large",
      [MS_ERROR_GROWTH_TOO_EXPENSIVE] =
          "not measured: that would cost more than a fifth of the evaluations",
      [MS_ERROR_GROWTH_REPORTED] = "large; a note has reported it"};
  const char *state = NULL;
  if (!is_requested(sim)) return;
  if (ms_scene_has_function(sim->scene)) state = "not measured with a force function";
  if (sim->part) state = "not measured on ranks";
  for (int32_t i = 0; i < sim->nislands; i++)
    if (sim->islands[i].disturbance.dx) state = states[sim->error_growth.state];
  ms_text_append(out, "              growth of errors: ");
  if (state) ms_text_append(out, "%s\n", state);
  else ms_text_append(out, "not measured in parts of more than %d springs\n", FEW_SPRINGS);
}

void ms_error_growth_archive(ms_archive *b, ms_error_growth *s) {
  int64_t *counts[] = {&s->evaluations0, &s->contacts0, &s->evaluations};
  for (int i = 0; i < 3; i++) ms_archive_transfer_count(b, counts[i]);
  MS_ARCHIVE_TRANSFER(b, s->state);
  MS_ARCHIVE_TRANSFER(b, s->has_contact);
  ms_archive_check(b, s->state >= 0 && s->state <= MS_ERROR_GROWTH_REPORTED,
                   "the growth of errors");
  ms_archive_check(b, s->has_contact == 0 || s->has_contact == 1, "the growth of errors");
}

void ms_error_growth_archive_island(ms_archive *b, ms_island_sim *m) {
  ms_disturbance *d = &m->disturbance;
  if (!d->dx) return;
  double *numbers[] = {&d->stride, &d->time, &d->error};
  double *vectors[] = {d->dx, d->dv, d->a};
  for (int i = 0; i < 3; i++) ms_archive_transfer_vector(b, m->model.shape, vectors[i]);
  for (int i = 0; i < 3; i++) {
    MS_ARCHIVE_TRANSFER(b, *numbers[i]);
    ms_archive_check(b, *numbers[i] >= 0, "the growth of errors");
  }
  if (b->direction == MS_ARCHIVE_READ) copy_step_start(m);
}
