#include "sim/verify.h"

#include <math.h>

#include "base/vec3.h"
#include "integrate/contacts.h"
#include "sim/drive.h"

/* Steps between two checks of energy */
enum { ENERGY_INTERVAL = 512 };

/* Indicators */
enum { DEFECT, TURN };

msim_status ms_verify_create(const msim_sim *sim, const ms_model *model, ms_check *check,
                             msim_error *err) {
  if (!ms_sim_selects(sim) || ms_sim_has_control(sim)) return MSIM_OK;
  check->x = ms_rows_vector(sim->scene, &model->rows);
  check->v = ms_rows_vector(sim->scene, &model->rows);
  return check->x && check->v ? MSIM_OK : ms_fail_memory(err, "the start of a step");
}

void ms_verify_destroy(const ms_model *model, ms_check *check) {
  if (!model->scene) return;
  ms_delete(&model->scene->alloc, check->x);
  ms_delete(&model->scene->alloc, check->v);
}

/*------------------------------------- indicators -----------------------------------------------*/

/* sqrt(d.M d/(2 m))/scale, m the mass of the scene's free particles */
static double norm(ms_stepper *s, const double *d, double scale, const ms_scales *scales) {
  const ms_shape shape = s->model->shape;
  ms_scale_rows(shape, s->model->mass, d, s->scratch);
  return sqrt(ms_dot(shape, d, s->scratch) / (2 * scales->mass)) / scale;
}

/* |D| of the step from x to x_next, not yet accepted; 0 if the method does not carry a */
static double find_defect(const ms_integrator *method, ms_stepper *s, const ms_scales *scales) {
  const ms_shape shape = s->model->shape;
  const double h = s->h, w[] = {-1, -h / 2, -h / 2, -h * h / 12, h * h / 12};
  if (!ms_has_control(method) || method->carried != 1) return 0;
  const double *a = s->work[s->warm == 2], *a_next = s->work[s->warm != 2];
  const double *const x[] = {s->x, s->v, s->v_next, a, a_next};
  ms_add_all(shape, s->x_next, 5, w, x, s->x_spare[0]);
  return norm(s, s->x_spare[0], scales->extent, scales);
}

/* 1 - cos of the largest angle by which a spring turned, among those whose direction matters. The
 * least cos |cos| is found first, as that needs a single root. */
static double find_turn(const ms_stepper *s) {
  const ms_springs *springs = &s->model->springs;
  const size_t stride = (size_t)s->model->rows.stride, dims = (size_t)s->model->rows.dims;
  double least = 1;
  for (int32_t e = 0; e < springs->n; e++) {
    const size_t i = (size_t)springs->i[e], j = (size_t)springs->j[e];
    double before = 0, after = 0, both = 0;
    if (springs->rest[e] == 0 && springs->damping[e] == 0) continue;
    for (size_t at = 0; at < dims * stride; at += stride) {
      const double from = s->x[at + j] - s->x[at + i], to = s->x_next[at + j] - s->x_next[at + i];
      before += from * from, after += to * to, both += from * to;
    }
    const double size = before * after, product = both * fabs(both);
    if (product < least * size) least = product / size;
  }
  return 1 - copysign(sqrt(fabs(least)), least);
}

/*------------------------------------- errors ---------------------------------------------------*/

/* Make the step again in two half steps, which replace it. Their impacts replace the step's, too:
 * `contacts` is the count before the step. *error: the squared norm of the difference. */
static msim_status halve(const msim_sim *sim, ms_stepper *s, const ms_scales *scales,
                         int64_t contacts, double *error, msim_error *err) {
  const ms_shape shape = s->model->shape;
  s->stats->contacts = contacts;
  ms_swap(&s->x_next, &s->x_spare[1]);
  ms_swap(&s->v_next, &s->v_spare[1]);
  msim_status status = ms_drive_parts(sim, s, 2, err);
  if (status) return status;
  ms_combine(shape, s->x_next, -1, s->x_spare[1], s->x_spare[0]);
  ms_combine(shape, s->v_next, -1, s->v_spare[1], s->v_spare[0]);
  const double x = norm(s, s->x_spare[0], scales->extent, scales);
  const double v = norm(s, s->v_spare[0], scales->speed, scales);
  *error = x * x + v * v;
  return MSIM_OK;
}

msim_status ms_verify_measure(msim_sim *sim, const ms_scales *scales, ms_measured *step,
                              msim_error *err) {
  double sum = 0;
  *step = (ms_measured){0};
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++) {
    double error;
    const int64_t contacts = m->stepper.stats->contacts;
    msim_status status = ms_drive_parts(sim, &m->stepper, 1, err);
    if (status) return status;
    step->sign[DEFECT] =
        fmax(step->sign[DEFECT], find_defect(sim->integrator, &m->stepper, scales));
    step->sign[TURN] = fmax(step->sign[TURN], find_turn(&m->stepper));
    status = halve(sim, &m->stepper, scales, contacts, &error, err);
    if (status) return status;
    sum += error;
  }
  step->error = sqrt(sum);
  return MSIM_OK;
}

/*------------------------------------- steps ----------------------------------------------------*/

enum { LARGE = 64 }; /* particles: in a larger island a single event adds little to the error */

/* 1: the events of the step just made require verification: many particles bounced, or the error of
 * individual paths may be too large. */
static int has_events(const ms_motion *m, int64_t contacts) {
  const ms_stepper *s = &m->stepper;
  if (!s->events) return 0;
  return (s->stats->contacts - contacts) * LARGE >= m->model.shape.n || ms_drive_path_error(m) > 1;
}

/* 1: the step just made has to be verified, because it is its turn or by its indicators, sign[]. In
 * a large island D costs a quarter of an evaluation, the angles three: they are found only if it is
 * the step's turn. In a small one both cost about one, and are found once in some 8 evaluations. */
static int is_due(const msim_sim *sim, ms_motion *m, double sign[2]) {
  enum { WORTH = 8 }; /* evaluations */
  const double MORE = 3, TURNED = 0.3, LITTLE = 0.005,
               NOISE = 100 * sim->selection.verification.scales.rounding;
  const int64_t step = sim->step + 1 - sim->step0;
  const int is_large = m->model.shape.n >= LARGE;
  const int is_turn = m->check.all || step % MS_VERIFY_INTERVAL == 0;
  const double *seen = m->check.sign;
  const double price = sim->selection.candidates[sim->selection.best].price;
  const int64_t every = is_large ? WORTH : (int64_t)ceil(WORTH / fmax(1, price));
  const int looks = is_turn || step % every == 0;
  sign[DEFECT] = sign[TURN] = 0;
  if (looks)
    sign[DEFECT] = find_defect(sim->integrator, &m->stepper, &sim->selection.verification.scales);
  if (looks && (!is_large || is_turn)) sign[TURN] = find_turn(&m->stepper);
  return is_turn || sign[DEFECT] > fmax(NOISE, MORE * seen[DEFECT]) ||
         sign[TURN] > fmin(TURNED, fmax(LITTLE, MORE * seen[TURN]));
}

static void go_on(ms_stepper *s) {
  ms_swap(&s->x, &s->x_next);
  ms_swap(&s->v, &s->v_next);
  ms_contacts_advance(s);
}

static msim_status make_part(const msim_sim *sim, ms_motion *m, ms_control *c, double *left,
                             msim_error *err) {
  ms_stepper *s = &m->stepper;
  const int64_t contacts = s->stats->contacts;
  ms_attempt a = ms_control_begin(c, ms_sim_time(sim), *left);
  for (;;) {
    const double h = s->h = a.h;
    const msim_status status = ms_drive_controlled(sim, m, c, err);
    if (status && !ms_drive_may_help(status)) return status;
    const ms_verdict verdict = ms_control_judge(c, &a, status, m->error, s->impact);
    if (verdict == MS_ACCEPTED) {
      if (h < a.planned) c->h = fmax(c->h, a.planned); /* the end of the step, or an impact */
      *left = h == *left ? 0 : *left - h;
      go_on(s);
      return MSIM_OK;
    }
    s->stats->contacts = contacts;
    s->stats->rejected_steps++;
    if (verdict == MS_TOO_SHORT)
      return ms_fail(err, MSIM_NOT_CONVERGED, "even a step of %.3g s has too large an error", h);
  }
}

/* Copy the state at the start of the step, as substeps move s->x. *moved: 1, once that is done */
static void keep_start(ms_motion *m, int *moved) {
  if (*moved) return;
  ms_copy(m->model.shape, m->stepper.x, m->check.x);
  ms_copy(m->model.shape, m->stepper.v, m->check.v);
  *moved = 1;
}

static void go_back(ms_motion *m) {
  ms_stepper *s = &m->stepper;
  ms_copy(m->model.shape, m->check.x, s->x);
  ms_copy(m->model.shape, m->check.v, s->v);
  if (s->events) s->events->moved = 0;
  s->warm = 0;
}

/* The controller of substeps. Substeps use all of the error that they may add, while steps mostly
 * add far less than allowed: so substeps may add 1/16 of that, but no less than under tol. */
static ms_control control_of(const msim_sim *sim, double step, double h) {
  const double LESS = 1. / 16, tol = sim->selection.tol, span = ms_plan_span(&sim->plan);
  const double most = LESS * sim->selection.verification.allowed * span / step;
  ms_control c = ms_control_of(sim->integrator, fmax(tol, most), span);
  c.h = h;
  return c;
}

/* Make the step in substeps under error control, check->h at first; the next step continues with
 * them if they are still shorter. A method of order 2 does not continue: its errors mostly cancel,
 * and it would need very many substeps to keep each of them small. */
static msim_status make_in_parts(const msim_sim *sim, ms_motion *m, int *moved, msim_error *err) {
  ms_stepper *s = &m->stepper;
  const double h = s->h;
  double left = h;
  ms_control c = control_of(sim, h, m->check.h);
  msim_status status = MSIM_OK;
  keep_start(m, moved);
  s->warm = 0;
  while (!status && left > 0) status = make_part(sim, m, &c, &left, err);
  ms_swap(&s->x, &s->x_next);
  ms_swap(&s->v, &s->v_next);
  s->warm_next = 0; /* error control treats contacts differently from methods that replay impacts */
  m->check.h = c.h < h && sim->integrator->entry.order > 2 ? c.h : 0;
  return status;
}

/* The length of substeps that are accurate enough in place of a step with this error */
static double length_of_parts(const msim_sim *sim, double h, double error) {
  ms_control c = control_of(sim, h, h);
  ms_control_accepts(&c, h, error / ms_control_allowed(&c, h));
  return c.h;
}

/* Make one step, verified. *moved: the start of the whole step is saved, and s->x has moved */
static msim_status verify(const msim_sim *sim, ms_motion *m, int *moved, msim_error *err) {
  ms_stepper *s = &m->stepper;
  ms_check *check = &m->check;
  const int64_t contacts = s->stats->contacts;
  const double usual = sim->selection.verification.allowed;
  double error = INFINITY, sign[2] = {0};
  if (check->h > 0) return make_in_parts(sim, m, moved, err);
  msim_status status = ms_drive_parts(sim, s, 1, err);
  if (status && !ms_drive_may_help(status)) return status;
  const int has_event = !status && has_events(m, contacts);
  const double allowed = has_event ? fmax(usual, sim->selection.tol / MS_EVENTS) : usual;
  const double better = has_event ? 1 : ldexp(1, sim->integrator->entry.order) - 1;
  const int only_events = sim->selection.verification.only_events;
  if (!status && !has_event && (only_events || !is_due(sim, m, sign))) return MSIM_OK;
  if (!status) status = halve(sim, s, &sim->selection.verification.scales, contacts, &error, err);
  error = status ? INFINITY : sqrt(error);
  const double enough = fmax(allowed, fmin(better * allowed, sim->selection.tol / 4));
  check->all = !(error <= allowed);
  if (!(error <= enough)) {
    s->stats->contacts = contacts;
    s->stats->rejected_steps++;
    check->h = length_of_parts(sim, s->h, error);
    return make_in_parts(sim, m, moved, err);
  }
  for (int i = 0; i < 2; i++) check->sign[i] = fmax(check->sign[i], sign[i]);
  return MSIM_OK;
}

msim_status ms_verify_step(const msim_sim *sim, ms_motion *m, msim_error *err) {
  const int64_t n = sim->selection.parts;
  ms_stepper *s = &m->stepper;
  const double h = s->h;
  int moved = 0;
  msim_status status = MSIM_OK;
  for (int64_t i = 0; i < n && !status; i++) {
    if (i > 0) keep_start(m, &moved);
    if (i > 0) go_on(s);
    s->h = h / (double)n;
    status = verify(sim, m, &moved, err);
  }
  s->h = h, s->parts = n;
  if (moved) go_back(m);
  return status;
}

/*------------------------------------- planes ---------------------------------------------------*/

/* The distance of the particle nearest to a plane, m; *speed: that of the fastest one, m/s */
static double find_gap(const msim_sim *sim, double *speed) {
  const ms_scene *scene = sim->scene;
  double gap = INFINITY, fastest = 0;
  for (const ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++)
    for (int32_t r = 0; r < m->model.rows.nfree; r++) {
      double x[3], v[3];
      ms_row_get(&m->model.rows, m->stepper.x, r, x);
      ms_row_get(&m->model.rows, m->stepper.v, r, v);
      fastest = fmax(fastest, ms_dot3(v, v));
      for (int32_t p = 0; p < scene->nplanes; p++)
        gap = fmin(gap, ms_dot3(scene->planes[p].normal, x) - scene->planes[p].offset);
    }
  *speed = sqrt(fastest);
  return gap;
}

/* The number of steps of h before a plane can be met: gap/(2 h (v + g h)); speeds may double */
static double count_steps(const msim_sim *sim, double h) {
  double speed;
  const double gap = find_gap(sim, &speed), g = ms_norm3(sim->scene->gravity);
  return gap / (2 * h * (fmax(speed, sim->selection.verification.scales.speed) + g * h));
}

int ms_verify_is_plane_close(const msim_sim *sim, double h) {
  return sim->scene->nplanes > 0 && !(count_steps(sim, h) >= 1);
}

int ms_verify_meets_planes(msim_sim *sim) {
  enum { FARTHEST = 16 };
  ms_verification *v = &sim->selection.verification;
  if (!v->away || sim->step < v->due) return 0;
  const double steps = count_steps(sim, sim->plan.h);
  const int at_once = ms_sim_has_control(sim) || !(steps >= 4);
  v->due = sim->step + (at_once ? 1 : (int64_t)fmin(FARTHEST, steps / 2));
  return !(steps >= 1);
}

/*------------------------------------- energy ---------------------------------------------------*/

/* 1: energy is conserved. Planes that do not count yet (verification.away) are left aside. */
static int is_conserved(const msim_sim *sim) {
  if (sim->scene->nplanes && !sim->selection.verification.away) return 0;
  return !sim->selection.damped;
}

static double energy_of(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  msim_sim_energy(sim, &e);
  return e.total;
}

void ms_verify_start(msim_sim *sim) {
  ms_verification *v = &sim->selection.verification;
  if (!ms_sim_selects(sim)) return;
  v->due = sim->step;
  v->energy = is_conserved(sim) ? energy_of(sim) : 0;
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++) {
    m->check.all = 0, m->check.h = 0;
    for (int i = 0; i < 2; i++) m->check.sign[i] = v->sign[i];
  }
}

static int is_last(const msim_sim *sim) {
  return ms_sim_has_control(sim) ? sim->t == sim->plan.t_end
                                 : sim->step - sim->step0 == sim->plan.steps;
}

void ms_verify_energy(msim_sim *sim) {
  const double TOO_MUCH = 10;
  const ms_scales *s = &sim->selection.verification.scales;
  ms_verification *v = &sim->selection.verification;
  if (!ms_sim_selects(sim) || v->warned || !is_conserved(sim)) return;
  if (sim->step % ENERGY_INTERVAL != 0 && !is_last(sim)) return;
  const double off = fabs(energy_of(sim) - v->energy) / (s->mass * s->speed * s->speed);
  if (!(off > TOO_MUCH * fmax(sim->selection.tol, s->rounding))) return;
  v->warned = 1;
  ms_sim_warn(
      sim,
      "step %lld, t = %g s: energy is off by %.2g of its scale, so that the error is larger "
      "than tol = %g, by which %s was chosen",
      (long long)sim->step, ms_sim_time(sim), off, sim->selection.tol, sim->integrator->entry.name);
}

/*------------------------------------- checkpoints ----------------------------------------------*/

void ms_verification_history(ms_bytes *b, ms_verification *v) {
  ms_scales *s = &v->scales;
  double *numbers[] = {&v->allowed, &v->sign[0], &v->sign[1],  &v->energy, &s->extent,
                       &s->speed,   &s->mass,    &s->rounding, &s->time};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    MS_BYTES_PASS(b, *numbers[i]);
    ms_bytes_check(b, isfinite(*numbers[i]), "the verification of steps");
  }
  MS_BYTES_PASS(b, v->warned);
  MS_BYTES_PASS(b, v->only_events);
  MS_BYTES_PASS(b, v->away);
  ms_bytes_pass_count(b, &v->due);
  ms_bytes_check(
      b, v->allowed >= 0 && (v->away | 1) == 1 && (v->warned | 1) == 1 && (v->only_events | 1) == 1,
      "the verification of steps");
}

void ms_check_history(ms_bytes *b, ms_check *check) {
  MS_BYTES_PASS(b, check->sign[0]);
  MS_BYTES_PASS(b, check->sign[1]);
  MS_BYTES_PASS(b, check->all);
  MS_BYTES_PASS(b, check->h);
  ms_bytes_check(b,
                 isfinite(check->sign[0]) && isfinite(check->sign[1]) && (check->all | 1) == 1 &&
                     isfinite(check->h) && check->h >= 0,
                 "the verification of steps");
}
