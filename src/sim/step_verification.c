#include "sim/step_verification.h"

#include <float.h>
#include <math.h>

#include "base/simd.h"
#include "base/vec3.h"
#include "physics/signed_distance.h"
#include "physics/single.h"
#include "contact/contact_set.h"
#include "contact/shortened_step.h"
#include "methods/methods.h"
#include "sim/conservation.h"
#include "sim/island_step.h"
#include "sim/step_driver.h"
#include "physics/external_force.h"

/* Indicators */
enum { DEFECT, TURN };

/* An indicator asks for verification if it is MORE times as large as in steps verified before; TURN
 * only if it exceeds LITTLE, too. */
static const double MORE = 3, LITTLE = 0.005;

/* The method of substeps. rkc locates no impacts. */
static const ms_integrator *substep_method(const msim_sim *sim) {
  const ms_integrator *method = sim->config.integrator;
  return method == &ms_rkc && !ms_scene_has_obstacles(sim->scene) ? method : &ms_dop853;
}

static int is_needed(const msim_sim *sim) {
  return ms_sim_selects(sim) && !ms_sim_has_control(sim);
}

int32_t ms_step_verification_work(const msim_sim *sim) {
  return is_needed(sim) && sim->config.choice.verification.allowed > 0 ? substep_method(sim)->nwork
                                                                       : 0;
}

msim_status ms_step_verification_create(const msim_sim *sim, const ms_model *model,
                                        ms_island_verification *check, msim_error *err) {
  if (!is_needed(sim)) return MSIM_OK;
  if (MS_NEW_VECTORS(sim->scene, &model->unknowns, &check->x, &check->v)) return MSIM_OK;
  return ms_error_set_memory(err, "the start of a step");
}

void ms_step_verification_destroy(const ms_model *model, ms_island_verification *check) {
  if (!model->scene) return;
  MS_FREE(&model->scene->alloc, check->x, check->v);
}

/*------------------------------------- indicators -----------------------------------------------*/

/* sqrt(d.M d/(2 m))/scale, m the mass of the scene's free particles; d has doubles. */
static double mass_norm(ms_stepper *s, const double *d, double scale, const ms_scales *scales) {
  const ms_shape shape = s->model->shape;
  ms_vector_scale_rows(shape, s->model->mass, d, s->scratch);
  return sqrt(ms_vector_dot(shape, d, s->scratch) / (2 * scales->mass)) / scale;
}

/* The method's own estimate of the error of that step, in both precisions, without masses. It grows
 * with what makes a step unstable. */
static double find_estimate_norm(const ms_integrator *method, ms_stepper *s,
                                 const ms_scales *scales) {
  const ms_shape shape = s->model->state_shape;
  double *dx = s->x_spare[0], *dv = s->v_spare[0];
  method->estimate(s, 0, dx, dv);
  const double x2 = ms_vector_dot(shape, dx, dx), v2 = ms_vector_dot(shape, dv, dv);
  return hypot(sqrt(x2) / scales->extent, sqrt(v2) / scales->speed) / sqrt(2. * shape.n);
}

/* |D| of the step from x to x_next, not yet accepted, or of rkc its estimate; 0 if the method has
 * neither. In single precision rounding of a is larger than D. */
static double find_defect_norm(const ms_integrator *method, ms_stepper *s,
                               const ms_scales *scales) {
  const ms_shape shape = s->model->state_shape;
  const double h = s->h, w[] = {-1, -h / 2, -h / 2, -h * h / 12, h * h / 12};
  if (method == &ms_rkc) return find_estimate_norm(method, s, scales);
  if (!ms_control_is_supported(method) || method->carried != 1 || shape.single) return 0;
  const double *a = s->work[s->cached_stage == 2], *a_next = s->work[s->cached_stage != 2];
  const double *const x[] = {s->x, s->v, s->v_next, a, a_next};
  ms_vector_linear_combination(shape, s->x_next, 5, w, x, s->x_spare[0]);
  return mass_norm(s, s->x_spare[0], scales->extent, scales);
}

/* A number of a vector of floats or doubles */
MS_INLINE double number_at(int single, const double *vec, size_t at) {
  return single ? (double)((const float *)(const void *)vec)[at] : vec[at];
}

/* cos |cos| of the largest angle by which a spring turned, among those whose direction matters: to
 * find the least one takes no root, and no division unless it is less than those before, or than
 * the least that counts. */
MS_INLINE double find_least_cosine(size_t dims, int single, const ms_stepper *s) {
  const ms_springs *springs = &s->model->springs;
  const size_t stride = (size_t)s->model->unknowns.stride;
  const double *x = s->x, *x_next = s->x_next;
  double least = (1 - LITTLE / MORE) * (1 - LITTLE / MORE);
  for (int32_t e = 0; e < springs->n; e++) {
    size_t i = (size_t)springs->i[e], j = (size_t)springs->j[e];
    double before = 0, after = 0, both = 0;
    for (size_t k = 0; k < dims; k++, i += stride, j += stride) {
      const double from = number_at(single, x, j) - number_at(single, x, i);
      const double to = number_at(single, x_next, j) - number_at(single, x_next, i);
      before += from * from, after += to * to, both += from * to;
    }
    const double size = before * after, product = both * fabs(both);
    if (!(product < least * size)) continue;
    if (!ms_scene_is_linear(s->model->scene, ms_springs_number(springs, e))) least = product / size;
  }
  return least;
}

/* 1 - cos of that angle; LITTLE/MORE if that is less, as smaller ones decide nothing */
static double find_turn(const ms_stepper *s) {
  const int single = s->model->state_shape.single, dims = s->model->unknowns.dims;
  const double least = single      ? find_least_cosine((size_t)dims, 1, s)
                       : dims == 3 ? find_least_cosine(3, 0, s)
                                   : find_least_cosine(2, 0, s);
  return 1 - copysign(sqrt(fabs(least)), least);
}

/*------------------------------------- errors ---------------------------------------------------*/

/* Make the step again in two half steps, which replace it; the step goes to the second spare pair.
 * Their impacts replace the step's, too: `contacts` is the count before the step. *error: the
 * squared norm of the difference. */
static msim_status repeat_in_half_steps(const msim_sim *sim, ms_stepper *s, const ms_scales *scales,
                                        int64_t contacts, double *error, msim_error *err) {
  s->stats->contacts = contacts;
  ms_stepper_swap(&s->x_next, &s->x_spare[1]);
  ms_stepper_swap(&s->v_next, &s->v_spare[1]);
  msim_status status = ms_island_step_make_substeps(sim, sim->config.integrator, s, 2, err);
  if (status) return status;
  const double *dx = ms_single_subtract_x(s->model, s->x_next, s->x_spare[1], s->x_spare[0]);
  const double *dv = ms_single_subtract_v(s->model, s->v_next, s->v_spare[1], s->v_spare[0]);
  const double x = mass_norm(s, dx, scales->extent, scales);
  const double v = mass_norm(s, dv, scales->speed, scales);
  *error = x * x + v * v;
  return MSIM_OK;
}

msim_status ms_step_verification_measure(msim_sim *sim, const ms_scales *scales,
                                         ms_step_measurement *step, msim_error *err) {
  double sum = 0;
  *step = (ms_step_measurement){0};
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    double error;
    const int64_t contacts = m->stepper.stats->contacts;
    msim_status status =
        ms_island_step_make_substeps(sim, sim->config.integrator, &m->stepper, 1, err);
    if (status) return status;
    step->indicator[DEFECT] = fmax(step->indicator[DEFECT],
                                   find_defect_norm(sim->config.integrator, &m->stepper, scales));
    step->indicator[TURN] = fmax(step->indicator[TURN], find_turn(&m->stepper));
    status = repeat_in_half_steps(sim, &m->stepper, scales, contacts, &error, err);
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
static int has_events(const ms_island_sim *m, int64_t contacts) {
  const ms_stepper *s = &m->stepper;
  if (!s->events) return 0;
  return (s->stats->contacts - contacts) * LARGE >= m->model.shape.n ||
         ms_island_step_find_path_error(m) > 1;
}

/* 1: the step just made has to be verified, because it is its turn or by its indicators, sign[]. In
 * a large island D costs a quarter of an evaluation, the angles three: they are found only if it is
 * the step's turn. In a small one both cost about one, and are found once in some 8 evaluations.
 * The estimate of rkc costs one, and is found once in some 16. */
static int needs_verification(const msim_sim *sim, ms_island_sim *m, double sign[2]) {
  enum { WORTH = 8 }; /* evaluations */
  const double TURNED = 0.3, ROUNDING = m->model.single
                                            ? 16 * FLT_EPSILON
                                            : 100 * sim->config.choice.verification.scales.rounding;
  const int64_t step = sim->run.step + 1 - sim->run.step0;
  const int is_large = m->model.shape.n >= LARGE;
  const int is_scheduled = m->verification.verify_next || step % MS_VERIFICATION_INTERVAL == 0;
  const double *seen = m->verification.indicator;
  const double cost = fmax(1, ms_choice_best(&sim->config.choice)->step_cost);
  const int64_t every = sim->config.integrator == &ms_rkc ? (int64_t)ceil(2 * WORTH / cost)
                        : is_large                        ? WORTH
                                                          : (int64_t)ceil(WORTH / cost);
  const int computes_indicators = is_scheduled || step % every == 0;
  sign[DEFECT] = sign[TURN] = 0;
  if (computes_indicators)
    sign[DEFECT] = find_defect_norm(sim->config.integrator, &m->stepper,
                                    &sim->config.choice.verification.scales);
  if (computes_indicators && (!is_large || is_scheduled)) sign[TURN] = find_turn(&m->stepper);
  return is_scheduled || sign[DEFECT] > fmax(ROUNDING, MORE * seen[DEFECT]) ||
         sign[TURN] > fmin(TURNED, fmax(LITTLE, MORE * seen[TURN]));
}

static void swap_to_next(ms_stepper *s) {
  ms_stepper_swap(&s->x, &s->x_next);
  ms_stepper_swap(&s->v, &s->v_next);
  ms_contact_set_accept_step(s);
}

static msim_status make_controlled_substep(const msim_sim *sim, ms_island_sim *m, ms_control *c,
                                           double *left, msim_error *err) {
  ms_stepper *s = &m->stepper;
  const int64_t contacts = s->stats->contacts;
  ms_attempt a = ms_control_begin_attempt(c, ms_sim_time(sim), *left);
  for (;;) {
    s->h = a.h;
    const msim_status status = ms_island_step_make_controlled(sim, substep_method(sim), m, c, err);
    if (status && !ms_island_step_may_retry(status)) return status;
    const ms_verdict verdict = ms_control_judge_attempt(
        c, &a,
        &(ms_attempt_result){.status = status,
                             .error = m->error,
                             .impact = s->impact,
                             .amplification = ms_island_step_find_amplification(m),
                             .change = s->change});
    const double h = a.h;
    if (verdict == MS_SHORTENED) ms_shortened_step_end(substep_method(sim), s, s->impact);
    if (verdict == MS_ACCEPTED || verdict == MS_SHORTENED) {
      if (h < a.planned) c->h = fmax(c->h, a.planned); /* the end of the step, or an impact */
      *left = h == *left ? 0 : *left - h;
      swap_to_next(s);
      return MSIM_OK;
    }
    s->stats->contacts = contacts;
    s->stats->rejected_steps++;
    if (verdict == MS_TOO_SHORT)
      return ms_error_set(err, MSIM_NOT_CONVERGED,
                          "the error is too large even with h = %.3g s; use a larger tol", s->h);
  }
}

/* Copy the state at the start of the step, as substeps move s->x. *moved: 1, once that is done */
static void save_step_start(ms_island_sim *m, int *moved) {
  if (*moved) return;
  ms_vector_copy(m->model.state_shape, m->stepper.x, m->verification.x);
  ms_vector_copy(m->model.state_shape, m->stepper.v, m->verification.v);
  *moved = 1;
}

static void restore_saved_start(ms_island_sim *m) {
  ms_stepper *s = &m->stepper;
  ms_vector_copy(m->model.state_shape, m->verification.x, s->x);
  ms_vector_copy(m->model.state_shape, m->verification.v, s->v);
  if (s->events) s->events->moved = 0;
  s->cached_stage = 0;
}

/* The controller of substeps. Substeps use all of the error that they may add, while steps mostly
 * add far less than allowed: so substeps may add 1/16 of that, but no less than under tol. */
static ms_control substep_control(const msim_sim *sim, double step, double h) {
  const double LESS = 1. / 16, tol = sim->config.choice.tol, span = ms_plan_span(&sim->config.plan);
  const double most = LESS * sim->config.choice.verification.allowed * span / step;
  ms_control c = ms_control_make(substep_method(sim), fmax(tol, most), span);
  c.h = h;
  return c;
}

/* Make the step in substeps under error control, m->verification.substep at first, or 0: the whole
 * step; the next step continues with them if they are still shorter, or all are made so. */
static msim_status make_step_in_substeps(const msim_sim *sim, ms_island_sim *m, int *moved,
                                         msim_error *err) {
  ms_stepper *s = &m->stepper;
  const double h = s->h;
  double left = h;
  ms_control c = substep_control(sim, h, m->verification.substep > 0 ? m->verification.substep : h);
  msim_status status = MSIM_OK;
  save_step_start(m, moved);
  s->cached_stage = 0;
  while (!status && left > 0) status = make_controlled_substep(sim, m, &c, &left, err);
  ms_stepper_swap(&s->x, &s->x_next);
  ms_stepper_swap(&s->v, &s->v_next);
  s->cached_stage_next =
      0; /* error control treats contacts differently from methods that replay impacts */
  m->verification.substep =
      c.h < h || ms_choice_best(&sim->config.choice)->control_tol > 0 ? c.h : 0;
  return status;
}

/* Parts of a step, more if the errors of the island add up to more than tol */
static int64_t count_parts(const msim_sim *sim, const ms_island_verification *check) {
  const double MOST = 2, tolerated = sim->config.choice.verification.error_sum;
  const int64_t n = sim->config.choice.substeps;
  if (tolerated == 0 || check->error_sum <= tolerated) return n;
  return n << (int)fmin(MOST, ceil(log2(check->error_sum / tolerated)));
}

/* Each step since the last one verified, or each of its parts, had this error. */
static void add_up_error(const msim_sim *sim, ms_island_sim *m, double error) {
  ms_island_verification *check = &m->verification;
  const int64_t step = sim->run.step + 1;
  check->error_sum += error * (double)(step - check->verified) * sim->run.h / m->stepper.h;
  check->verified = step;
}

/* Make one step, verified. *moved: the start of the whole step is saved, and s->x has moved */
static msim_status make_verified_step(const msim_sim *sim, ms_island_sim *m, int *moved,
                                      msim_error *err) {
  ms_stepper *s = &m->stepper;
  ms_island_verification *check = &m->verification;
  const int64_t contacts = s->stats->contacts;
  const double usual = sim->config.choice.verification.allowed;
  double error = INFINITY, sign[2] = {0};
  if (check->substep > 0 || ms_choice_best(&sim->config.choice)->control_tol > 0)
    return make_step_in_substeps(sim, m, moved, err);
  msim_status status = ms_island_step_make_substeps(sim, sim->config.integrator, s, 1, err);
  if (status && !ms_island_step_may_retry(status)) return status;
  const int has_event = !status && has_events(m, contacts);
  const int only_events = sim->config.choice.verification.only_events;
  if (!status && !has_event && (only_events || !needs_verification(sim, m, sign))) return MSIM_OK;
  if (!status)
    status = repeat_in_half_steps(sim, s, &sim->config.choice.verification.scales, contacts, &error,
                                  err);
  error = status ? INFINITY : sqrt(error);
  const double allowed =
      has_event ? fmax(usual, sim->config.choice.tol / MS_EVENTS_PER_RUN) : usual;
  const double better = has_event ? 1 : ldexp(1, sim->config.integrator->entry.order) - 1;
  const double enough = fmax(allowed, fmin(better * allowed, sim->config.choice.tol / 4));
  check->verify_next = !(error <= allowed);
  if (!(error <= enough) && m->model.single) {
    check->needs_doubles = 1; /* for the next steps; this one stays in half steps */
    return status;
  }
  if (!(error <= enough)) {
    s->stats->contacts = contacts;
    s->stats->rejected_steps++;
    return make_step_in_substeps(sim, m, moved, err);
  }
  if (error <= allowed && !s->events) { /* the step itself, whose last evaluation is lost */
    ms_stepper_swap(&s->x_next, &s->x_spare[1]), ms_stepper_swap(&s->v_next, &s->v_spare[1]);
    s->cached_stage_next = 0;
  }
  add_up_error(sim, m, error);
  for (int i = 0; i < 2; i++) check->indicator[i] = fmax(check->indicator[i], sign[i]);
  return MSIM_OK;
}

msim_status ms_step_verification_make_step(const msim_sim *sim, ms_island_sim *m, msim_error *err) {
  const int64_t n = count_parts(sim, &m->verification);
  ms_stepper *s = &m->stepper;
  const double h = s->h;
  int moved = 0;
  msim_status status = MSIM_OK;
  for (int64_t i = 0; i < n && !status; i++) {
    if (i > 0) save_step_start(m, &moved);
    if (i > 0) swap_to_next(s);
    s->h = h / (double)n;
    status = make_verified_step(sim, m, &moved, err);
  }
  s->h = h, s->parts = n;
  if (moved) restore_saved_start(m);
  return status;
}

/*------------------------------------- planes ---------------------------------------------------*/

/* The distance of the particle nearest to a plane or collider, m; *speed: that of the fastest one,
 * m/s; *acceleration: the largest one by external forces, m/s^2 */
static double find_plane_distance(const msim_sim *sim, double *speed, double *acceleration) {
  const ms_scene *scene = sim->scene;
  const double g = ms_external_acceleration(&scene->external);
  double gap = INFINITY, fastest = 0;
  *acceleration = g;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    const double *all_x = ms_single_get_x(&m->model, m->stepper.x),
                 *all_v = ms_single_get_v(&m->model, m->stepper.v);
    for (int32_t r = 0; r < m->model.unknowns.nfree; r++) {
      double x[3], v[3], unused[3];
      ms_unknowns_get(&m->model.unknowns, all_x, r, x);
      ms_unknowns_get(&m->model.unknowns, all_v, r, v);
      fastest = fmax(fastest, ms_vec3_dot(v, v));
      *acceleration = fmax(*acceleration, g + ms_model_force_acceleration(&m->model, r));
      for (int32_t p = 0; p < scene->nplanes; p++)
        gap = fmin(gap, ms_vec3_dot(scene->planes[p].normal, x) - scene->planes[p].offset);
      for (int32_t i = 0; i < scene->ncolliders; i++)
        gap = fmin(gap, ms_signed_distance(&scene->solids[i], x, unused));
    }
  }
  *speed = sqrt(fastest);
  return gap;
}

/* The number of steps of h before a plane can be met: gap/(2 h (v + a h)), with the acceleration a
 * by external forces; speeds may double */
static double count_steps_to_plane(const msim_sim *sim, double h) {
  double speed, a;
  const double gap = find_plane_distance(sim, &speed, &a);
  return gap / (2 * h * (fmax(speed, sim->config.choice.verification.scales.speed) + a * h));
}

int ms_step_verification_is_plane_close(const msim_sim *sim, double h) {
  return ms_scene_has_obstacles(sim->scene) && !(count_steps_to_plane(sim, h) >= 1);
}

int ms_step_verification_planes_due(msim_sim *sim) {
  enum { FARTHEST = 16 };
  ms_step_verification *v = &sim->config.choice.verification;
  if (!v->planes_far || sim->run.step < v->next_plane_check) return 0;
  const double steps = count_steps_to_plane(sim, sim->run.h);
  const int at_once = ms_sim_has_control(sim) || !(steps >= 4);
  v->next_plane_check = sim->run.step + (at_once ? 1 : (int64_t)fmin(FARTHEST, steps / 2));
  return !(steps >= 1);
}

/*------------------------------------- the run --------------------------------------------------*/

void ms_step_verification_start(msim_sim *sim) {
  if (!ms_sim_selects(sim)) return;
  sim->config.choice.verification.next_plane_check = sim->run.step;
  ms_conservation_start(sim);
  ms_step_verification_start_islands(sim);
}

void ms_step_verification_start_islands(msim_sim *sim) {
  const ms_step_verification *v = &sim->config.choice.verification;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    m->verification.verify_next = 0, m->verification.substep = 0;
    m->verification.error_sum = 0, m->verification.verified = sim->run.step;
    for (int i = 0; i < 2; i++) m->verification.indicator[i] = v->indicator[i];
  }
}

int ms_step_verification_needs_doubles(const msim_sim *sim) {
  for (int32_t i = 0; i < sim->nislands; i++)
    if (sim->islands[i].verification.needs_doubles) return 1;
  return 0;
}

/*------------------------------------- checkpoints ----------------------------------------------*/

void ms_step_verification_archive(ms_archive *b, ms_step_verification *v) {
  ms_scales *s = &v->scales;
  double *numbers[] = {&v->allowed, &v->indicator[0], &v->indicator[1], &v->error_sum, &v->energy,
                       &s->extent,  &s->speed,        &s->mass,         &s->rounding,  &s->time};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    MS_ARCHIVE_TRANSFER(b, *numbers[i]);
    ms_archive_check(b, isfinite(*numbers[i]), "the verification of steps");
  }
  MS_ARCHIVE_TRANSFER(b, v->warned);
  MS_ARCHIVE_TRANSFER(b, v->only_events);
  MS_ARCHIVE_TRANSFER(b, v->planes_far);
  ms_archive_transfer_count(b, &v->next_plane_check);
  ms_archive_check(b,
                   v->allowed >= 0 && v->error_sum >= 0 && (v->planes_far | 1) == 1 &&
                       (v->warned | 1) == 1 && (v->only_events | 1) == 1,
                   "the verification of steps");
}

void ms_step_verification_archive_island(ms_archive *b, ms_island_verification *check) {
  MS_ARCHIVE_TRANSFER(b, check->indicator[0]);
  MS_ARCHIVE_TRANSFER(b, check->indicator[1]);
  MS_ARCHIVE_TRANSFER(b, check->verify_next);
  MS_ARCHIVE_TRANSFER(b, check->needs_doubles);
  MS_ARCHIVE_TRANSFER(b, check->substep);
  MS_ARCHIVE_TRANSFER(b, check->error_sum);
  ms_archive_transfer_count(b, &check->verified);
  ms_archive_check(b,
                   isfinite(check->indicator[0]) && isfinite(check->indicator[1]) &&
                       (check->verify_next | 1) == 1 && (check->needs_doubles | 1) == 1 &&
                       isfinite(check->substep) && check->substep >= 0 &&
                       isfinite(check->error_sum) && check->error_sum >= 0,
                   "the verification of steps");
}
