#include "sim/probe.h"

#include <math.h>
#include <string.h>

#include "integrate/methods.h"
#include "linear/kept.h"
#include "sim/drive.h"
#include "sim/verify.h"

/* Work in evaluations, per island
 *   W = evaluations + assemblies + 1.5 c iterations + (flops factorizations + 16 fill solves)/f,
 * c = 2 with a coarse space, else 1; f = 2 32/1.5 flops for each spring, as in kept.h. */
double ms_probe_work(const msim_sim *sim) {
  const ms_motion *m = ms_sim_largest(sim);
  const msim_stats *s = &sim->stats;
  const double springs = sim->scene->nsprings, flops = 2 * MS_FLOPS_PER_HALF / MS_ITERATION;
  double work = (double)s->force_evaluations / sim->nislands;
  if (springs > 0) work = (double)s->spring_evaluations / springs;
  if (!m->stepper.solver) return work;
  const ms_linear *linear = m->stepper.solver->linear;
  const double solver = (double)s->assemblies +
                        (double)s->iterations * MS_ITERATION * (linear->aggregates ? 2 : 1) +
                        ((double)s->factorizations * linear->flops +
                         (double)s->solves * MS_FLOPS_PER_FILL * linear->fill) /
                            (flops * fmax(1, m->model.springs.n));
  return work + solver / sim->nislands;
}

double ms_probe_reach(const ms_probe *p, const ms_integrator *method) {
  return MS_REACH * (method->limit ? method->limit(&p->bounds) : INFINITY);
}

/*------------------------------------- states ---------------------------------------------------*/

static size_t count(const ms_probe *p) { return 3 * (size_t)p->sim->scene->nparticles; }

static msim_status set_state(const ms_probe *p, msim_sim *sim, const double *x, const double *v,
                             msim_error *err) {
  const msim_state state = {.size = sizeof state, .n = p->sim->scene->nparticles, .x = x, .v = v};
  return msim_sim_set_state(sim, &state, err);
}

msim_status ms_probe_start(const ms_probe *p, msim_sim *sim, msim_error *err) {
  return set_state(p, sim, p->x0, p->v0, err);
}

msim_status ms_probe_start_half(const ms_probe *p, msim_sim *sim, msim_error *err) {
  return set_state(p, sim, p->x_half, p->v_half, err);
}

static void keep(const ms_probe *p, msim_sim *sim, double *x, double *v) {
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  memcpy(x, now.x, count(p) * sizeof *x);
  memcpy(v, now.v, count(p) * sizeof *v);
}

/* E^2 = 1/(2 m) sum_i m_i (|dx_i|^2/L^2 + |dv_i|^2/U^2), as in integrate/control.h, but weighted by
 * masses. With planes only dx counts, as a small delay of an impact changes v much. */
static double distance(const ms_probe *p, msim_sim *sim, const double *x, const double *v) {
  const ms_scales *s = &p->scales;
  const double weight = p->near ? 0 : 1 / s->speed;
  msim_state now = {.size = sizeof now};
  double sum = 0;
  msim_sim_state(sim, &now);
  for (size_t i = 0; i < count(p); i++) {
    const double dx = (now.x[i] - x[i]) / s->extent, dv = (now.v[i] - v[i]) * weight;
    if (!p->sim->scene->pinned[i / 3]) sum += p->sim->scene->mass[i / 3] * (dx * dx + dv * dv);
  }
  return sqrt(sum / (2 * s->mass));
}

/*------------------------------------- one sim for all methods ----------------------------------*/

/* The method with the most work vectors: the sim is built for it. */
static const ms_integrator *const widest = &ms_dop853;

static msim_status find_sim(ms_probe *p, int32_t collision, msim_sim **sim, msim_error *err) {
  msim_scene scene = {p->sim->scene};
  msim_options opt = p->sim->opt;
  *sim = p->sims[collision];
  if (*sim) return MSIM_OK;
  opt.size = sizeof opt;
  opt.integrator = widest->entry.name;
  opt.collision = collision;
  opt.tol = 0, opt.t_end = -1, opt.steps = 0, opt.h = 1, opt.warn = NULL;
  opt.watch = MSIM_WATCH_OFF;
  opt.newton_retries = 2; /* for memory of half steps */
  msim_status status = msim_sim_create(&scene, &opt, sim, err);
  if (!status) p->sims[collision] = *sim;
  return status;
}

/* Set the sim to that state, and let it continue by another method. */
static msim_status go_to(ms_probe *p, const ms_trial *of, double h, const double *x,
                         const double *v, msim_sim **sim, msim_error *err) {
  msim_status status = find_sim(p, of->collision, sim, err);
  if (status) return status;
  (*sim)->integrator = widest;
  status = set_state(p, *sim, x, v, err);
  if (status) return status;
  (*sim)->integrator = of->method;
  (*sim)->plan.h = h;
  for (int32_t i = 0; i < (*sim)->nislands; i++) {
    ms_stepper *s = &(*sim)->motion[i].stepper;
    s->h = h;
    ms_bound_stages(of->method, s);
    if (of->method->start) of->method->start(s);
  }
  return MSIM_OK;
}

const ms_model *ms_probe_model(const ms_probe *p) {
  return &ms_sim_largest(p->sims[MSIM_COLLISION_REFLECT])->model;
}

/*------------------------------------- errors ---------------------------------------------------*/

/* Estimate the error of m steps of h from x, v by 2 m steps of h/2: 2^p/(2^p - 1) times the
 * distance of their ends, p the order. INFINITY if the steps fail. */
static msim_status compare(ms_probe *p, const ms_trial *of, double h, int64_t m, const double *x,
                           const double *v, double *error, msim_error *err) {
  const double halving = ldexp(1, of->order);
  double *x_end = p->states, *v_end = x_end + count(p);
  msim_sim *sim;
  *error = INFINITY;
  for (int halved = 0; halved < 2; halved++) {
    msim_status status = go_to(p, of, halved ? h / 2 : h, x, v, &sim, err);
    if (status) return status;
    const double before = ms_probe_work(sim);
    status = msim_sim_step(sim, halved ? 2 * m : m, err);
    p->price += ms_probe_work(sim) - before;
    if (status) return status == MSIM_ERR_MEMORY ? status : MSIM_OK;
    if (!halved) keep(p, sim, x_end, v_end);
  }
  *error = halving / (halving - 1) * distance(p, sim, x_end, v_end);
  return MSIM_OK;
}

/* 1/60 of the run: a trial costs three times that. With planes 1/14, to pass the first impact. */
double ms_probe_steps(const ms_probe *p, double h) {
  const double SHARE = p->near ? 1. / 14 : 1. / 60;
  return fmax(1, round(SHARE * p->span / h));
}

msim_status ms_probe_error(ms_probe *p, const ms_trial *of, double h, double *error, double *price,
                           msim_error *err) {
  const double before = p->price;
  const int64_t m = (int64_t)ms_probe_steps(p, h);
  msim_status status = compare(p, of, h, m, p->x, p->v, error, err);
  *error *= p->growth * p->wild / ((double)m * h);
  if (!(*error < INFINITY)) *error = INFINITY;
  *price = (p->price - before) / (3 * (double)m);
  return status;
}

msim_status ms_probe_measure_steps(ms_probe *p, const ms_trial *of, double h, int n,
                                   ms_measured *steps, msim_error *err) {
  const double *const x[MS_MEASURED] = {p->x, p->x_half, p->x0};
  const double *const v[MS_MEASURED] = {p->v, p->v_half, p->v0};
  for (int i = 0; i < n; i++) {
    msim_sim *sim;
    msim_status status = go_to(p, of, h, x[i], v[i], &sim, err);
    if (status) return status;
    const double before = ms_probe_work(sim);
    status = ms_verify_measure(sim, &p->scales, &steps[i], err);
    p->price += ms_probe_work(sim) - before;
    if (status == MSIM_ERR_MEMORY) return status;
    if (status) steps[i].error = INFINITY;
  }
  return MSIM_OK;
}

static msim_status fly_halves(ms_probe *p, msim_sim *other, int64_t n, double *half, double *whole,
                              msim_error *err) {
  *half = *whole = INFINITY;
  msim_status status = ms_probe_start(p, other, err);
  if (!status) status = msim_sim_step(other, n, err);
  if (status) return status;
  *half = distance(p, other, p->x_half, p->v_half);
  status = msim_sim_step(other, n, err);
  if (!status) *whole = distance(p, other, p->x, p->v);
  return status;
}

/* E(T) = E(t) (T/t)^p, p = log2(E(t)/E(t/2)) >= 1; t: length of the pilot run, T: of the run */
msim_status ms_probe_fly_beside(ms_probe *p, msim_sim *other, int64_t n, double *error,
                                msim_error *err) {
  double half, whole;
  const msim_status status = fly_halves(p, other, n, &half, &whole, err);
  p->price += ms_probe_work(other);
  const double power = fmax(1, log2(whole / fmax(half, p->scales.rounding)));
  *error = status ? INFINITY : whole * pow(p->span / p->flown, power);
  return status == MSIM_ERR_MEMORY ? status : MSIM_OK;
}

/*------------------------------------- the pilot run --------------------------------------------*/

static const ms_trial pilot = {&ms_velocity_verlet, MSIM_COLLISION_REFLECT, 2};

/* Make `steps` steps of the pilot run; x, v: the state where they end, or before the one that
 * failed */
static msim_status fly(ms_probe *p, msim_sim *sim, int64_t steps, double *x, double *v,
                       msim_error *err) {
  const int64_t before = sim->stats.contacts;
  const msim_status status = msim_sim_step(sim, steps, err);
  p->flown = ms_sim_time(sim);
  p->met = sim->stats.contacts > before;
  keep(p, sim, x, v);
  return status == MSIM_ERR_MEMORY ? status : MSIM_OK;
}

/* Make the pilot run in parts of 1/64 of the run until an impact, for 3/4 of the run at most.
 * Trials start where the last part began: free flight before that is not typical. */
static msim_status fly_to_impact(ms_probe *p, msim_sim *sim, double h, msim_error *err) {
  const int64_t part = (int64_t)fmax(1, round(p->span / h / 64));
  msim_status status = MSIM_OK;
  while (!status && !p->met && p->flown < 0.75 * p->span) {
    keep(p, sim, p->x, p->v);
    p->wild = p->span - p->flown;
    status = fly(p, sim, part, p->x_half, p->v_half, err);
  }
  return status;
}

/* Continue to 1/3 of the run, as long as a plane could be met there. To choose anew at a late
 * impact costs less than fixed steps for impacts until then, but one choice costs less than two. */
static msim_status look_ahead(ms_probe *p, msim_sim *sim, int64_t part, msim_error *err) {
  const double flown = p->flown, end = p->span / 3;
  msim_status status = MSIM_OK;
  while (!status && !p->met && p->flown < end &&
         ms_verify_is_plane_close(sim, (end - p->flown) / 2))
    status = fly(p, sim, part, p->states, p->states + count(p), err);
  p->flown = flown;
  return status;
}

/* The pilot run; if it meets a plane, a second one as far as an impact */
static msim_status fly_all(ms_probe *p, double h, msim_error *err) {
  const int64_t part = (int64_t)fmax(1, round(p->span / h / 16));
  msim_sim *sim;
  msim_status status = go_to(p, &pilot, h, p->x0, p->v0, &sim, err);
  if (status) return status;
  p->wild = p->span;
  p->near |= ms_verify_is_plane_close(sim, h);
  if (!p->near) status = fly(p, sim, part, p->x_half, p->v_half, err);
  if (!p->near && !status) status = fly(p, sim, part, p->x, p->v, err);
  if (!p->near && !status) status = look_ahead(p, sim, part, err);
  p->near |= p->met;
  if (!p->near || status) {
    p->price += ms_probe_work(sim);
    return status;
  }
  p->flown = 0, p->met = 0;
  status = go_to(p, &pilot, h, p->x0, p->v0, &sim, err);
  if (!status) status = fly_to_impact(p, sim, h, err);
  p->price += ms_probe_work(sim);
  return status;
}

/* Set p->growth: with planes 4, as later impacts may have larger errors; else g = (error of a step
 * at the end)/(that in the middle of the pilot run), 1 <= g <= 4, or g^2 if nothing is damped. */
static msim_status find_growth(ms_probe *p, double h, msim_error *err) {
  double now, before;
  p->growth = p->near ? 4 : 1;
  if (p->near) return MSIM_OK;
  msim_status status = compare(p, &pilot, h, 1, p->x_half, p->v_half, &before, err);
  if (!status) status = compare(p, &pilot, h, 1, p->x, p->v, &now, err);
  if (status) return status;
  const double ratio = now / fmax(before, p->scales.rounding);
  if (ratio > 1) p->growth = pow(fmin(ratio, 4), p->damped ? 1 : 2);
  return MSIM_OK;
}

/*------------------------------------- life -----------------------------------------------------*/

static int is_damped(const ms_scene *scene) {
  for (int32_t e = 0; e < scene->nsprings; e++)
    if (scene->damping[e] > 0) return 1;
  return scene->drag > 0;
}

static int32_t count_free(const ms_scene *scene) {
  int32_t count = 0;
  for (int32_t i = 0; i < scene->nparticles; i++) count += !scene->pinned[i];
  return count;
}

/* *n: the number of free particles in the largest connected component */
static msim_status find_largest_part(const msim_sim *sim, int32_t *n, msim_error *err) {
  msim_status status = MSIM_OK;
  *n = 0;
  for (const ms_motion *m = sim->motion; m < sim->motion + sim->nislands && !status; m++) {
    ms_norm norm;
    status = ms_norm_create(&m->model, &norm, err);
    for (int32_t i = 0; i < norm.n && !status; i++)
      if (norm.part[i].n > *n) *n = norm.part[i].n;
    ms_norm_destroy(&m->model, &norm);
  }
  return status;
}

/* With planes the particles of a connected component count, as each has its own impacts. Many
 * particles have too many impacts for steps that end at each one. */
static msim_status count_few(ms_probe *p, msim_error *err) {
  enum { FEW = 12, MANY = 64 };
  const int32_t free = count_free(p->sim->scene);
  int32_t part = free;
  p->many = free >= MANY;
  msim_status status = MSIM_OK;
  if (p->near && !p->many) status = find_largest_part(p->sims[MSIM_COLLISION_REFLECT], &part, err);
  p->few = part < FEW;
  return status;
}

static msim_status prepare(ms_probe *p, double t0, msim_error *err) {
  const ms_scene *scene = p->sim->scene;
  msim_options opt = p->sim->opt;
  ms_plan plan;
  opt.tol = p->tol;
  msim_status status = ms_plan_create(&opt, t0, &plan, err);
  if (status) return status;
  p->span = ms_plan_span(&plan);
  p->damped = is_damped(scene);
  status = ms_scales_compute(scene, p->x0, p->v0, p->span, &p->scales, err);
  if (!status) status = ms_bounds_compute(scene, 1, &p->bounds, err);
  if (status) return status;
  p->states = ms_new(&p->sim->alloc, 6 * count(p), sizeof *p->states);
  return p->states ? MSIM_OK : ms_fail_memory(err, "the choice of a method");
}

msim_status ms_probe_begin(const msim_sim *sim, double tol, int late, double t0, const double *x,
                           const double *v, ms_probe *p, msim_error *err) {
  const double FEWEST = 100; /* steps in the run, at least */
  *p = (ms_probe){.sim = sim, .tol = tol, .late = late, .near = late, .x0 = x, .v0 = v};
  msim_status status = prepare(p, t0, err);
  if (status) return status;
  const double h = fmin(ms_probe_reach(p, pilot.method), p->span / FEWEST);
  const size_t n = count(p);
  p->x = p->states + 2 * n, p->v = p->x + n;
  p->x_half = p->v + n, p->v_half = p->x_half + n;
  status = fly_all(p, h, err);
  if (!status) status = count_few(p, err);
  return status ? status : find_growth(p, h, err);
}

void ms_probe_end(ms_probe *p) {
  for (int i = 0; i < 2; i++) msim_sim_destroy(p->sims[i]);
  ms_delete(&p->sim->alloc, p->states);
}
