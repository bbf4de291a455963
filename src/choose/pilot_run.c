#include "choose/pilot_run.h"

#include <math.h>
#include <string.h>

#include "contact/impact_location.h"
#include "methods/methods.h"
#include "linear/lagged_factor.h"
#include "sim/step_driver.h"
#include "sim/step_verification.h"
#include "physics/external_force.h"

/* Work in evaluations, per island
 *   W = evaluations + assemblies + 1.5 c iterations + (flops factorizations + 16 fill solves)/f,
 * c = 2 with a coarse space, else 1; f = 2 32/1.5 flops for each spring, as in lagged_factor.h. The
 * path of a particle in contact takes as many instructions as PATH springs. */
static double count_paths(const msim_sim *sim) {
  double sum = 0;
  for (int32_t i = 0; i < sim->nislands; i++) sum += (double)sim->islands[i].stepper.paths;
  return sum;
}

double ms_pilot_run_count_work(const msim_sim *sim) {
  const ms_island_sim *m = ms_sim_largest_island(sim);
  const msim_stats *s = &sim->stats;
  const double PATH = 80, springs = sim->scene->nsprings,
               flops = 2 * MS_PCG_FLOPS_PER_HALF_EDGE / MS_EVALUATIONS_PER_ITERATION;
  double work = (double)s->force_evaluations / sim->nislands;
  if (springs > 0) work = ((double)s->spring_evaluations + PATH * count_paths(sim)) / springs;
  if (!m->stepper.solver) return work;
  const ms_linear *linear = m->stepper.solver->linear;
  const double solver =
      (double)s->assemblies +
      (double)s->iterations * MS_EVALUATIONS_PER_ITERATION * (linear->aggregates ? 2 : 1) +
      ((double)s->factorizations * linear->flops +
       (double)s->solves * MS_SOLVE_FLOPS_PER_NONZERO * linear->fill) /
          (flops * fmax(1, m->model.springs.n));
  return work + solver / sim->nislands;
}

double ms_pilot_run_stable_step(const ms_pilot_run *p, const ms_integrator *method) {
  return MS_STABLE_FRACTION * (method->limit ? method->limit(&p->bounds) : INFINITY);
}

int ms_pilot_run_is_limited_by_damping(const ms_pilot_run *p) {
  return p->damped && p->bounds.rate >= p->bounds.omega;
}

/*------------------------------------- states ---------------------------------------------------*/

static size_t component_count(const ms_pilot_run *p) {
  return 3 * (size_t)p->sim->scene->nparticles;
}

msim_status ms_pilot_run_set_start(const ms_pilot_run *p, msim_sim *sim, msim_error *err) {
  return ms_sim_set_state(sim, &p->start, err);
}

static msim_state state_of(const ms_pilot_run *p, const ms_pilot_state *s) {
  return (msim_state){
      .size = sizeof(msim_state), .n = p->sim->scene->nparticles, .x = s->x, .v = s->v};
}

void ms_pilot_run_copy_state(const ms_pilot_run *p, msim_sim *sim, const ms_pilot_state *to) {
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  memcpy(to->x, now.x, component_count(p) * sizeof *to->x);
  memcpy(to->v, now.v, component_count(p) * sizeof *to->v);
}

/* E^2 = 1/(2 m) sum_i m_i (|dx_i|^2/L^2 + |dv_i|^2/U^2), as in integrate/control.h, but weighted by
 * masses. With planes only dx counts, as a small delay of an impact changes v much. */
double ms_pilot_run_find_distance(const ms_pilot_run *p, msim_sim *sim,
                                  const ms_pilot_state *from) {
  const ms_scales *s = &p->scales;
  const double weight = p->planes_count ? 0 : 1 / s->speed;
  msim_state now = {.size = sizeof now};
  double sum = 0;
  msim_sim_state(sim, &now);
  for (size_t i = 0; i < component_count(p); i++) {
    const double dx = (now.x[i] - from->x[i]) / s->extent, dv = (now.v[i] - from->v[i]) * weight;
    if (!p->sim->scene->pinned[i / 3]) sum += p->sim->scene->mass[i / 3] * (dx * dx + dv * dv);
  }
  return sqrt(sum / (2 * s->mass));
}

/*------------------------------------- one sim for all methods ----------------------------------*/

/* The method with the most work vectors: the sims are built for it. */
static const ms_integrator *const widest = &ms_dop853;

/* tol: of error control, over the whole run; 0: fixed steps */
static msim_options options_of(const ms_pilot_run *p, const ms_integrator *method, double tol,
                               double h) {
  msim_options opt = p->sim->config.opt;
  opt.size = sizeof opt;
  opt.integrator = method->entry.name;
  opt.collision = MSIM_COLLISION_REFLECT;
  opt.precision = MSIM_PRECISION_DOUBLE;
  opt.tol = tol, opt.h = h, opt.t_end = tol > 0 ? p->span : -1, opt.warn = NULL;
  opt.watch = MSIM_WATCH_OFF;
  return opt;
}

/* All sims share the layout of the first one, or of the islands of a run that has begun. */
static msim_status create_sim(const ms_pilot_run *p, const msim_options *opt, msim_sim **sim,
                              msim_error *err) {
  msim_scene scene = {.data = p->sim->scene};
  const msim_sim *first =
      p->sims[MSIM_COLLISION_REFLECT] ? p->sims[MSIM_COLLISION_REFLECT] : p->sim;
  const ms_island_sims like = {.n = first->nislands, .islands = first->islands};
  return ms_sim_create(&scene, opt, NULL, &like, sim, err);
}

static msim_status get_sim(ms_pilot_run *p, const ms_trial *of, msim_sim **sim, msim_error *err) {
  const int which = of->tol > 0 ? MS_CONTROLLED_SIM : of->collision;
  msim_options opt = options_of(p, widest, of->tol, of->h);
  *sim = p->sims[which];
  if (*sim) return MSIM_OK;
  opt.collision = of->collision;
  if (of->tol == 0) opt.steps = 0;
  opt.newton_retries = 2; /* for memory of half steps */
  msim_status status = create_sim(p, &opt, sim, err);
  if (!status) p->sims[which] = *sim;
  return status;
}

msim_status ms_pilot_run_create_sim(const ms_pilot_run *p, const ms_integrator *method, double tol,
                                    double h, msim_sim **sim, msim_error *err) {
  const msim_options opt = options_of(p, method, tol, h);
  return create_sim(p, &opt, sim, err);
}

/* Set the sim to that state, and let it continue by another method. */
static msim_status start_method(ms_pilot_run *p, const ms_trial *of, const msim_state *state,
                                msim_sim **sim, msim_error *err) {
  msim_status status = get_sim(p, of, sim, err);
  if (status) return status;
  (*sim)->config.opt.tol = of->tol;
  ms_sim_switch_method(*sim, widest, of->h);
  status = ms_sim_set_state(*sim, state, err);
  if (status) return status;
  ms_sim_switch_method(*sim, of->method, of->h);
  if (of->tol > 0) ms_step_driver_start_control(*sim);
  return MSIM_OK;
}

msim_status ms_pilot_run_start_late(ms_pilot_run *p, const ms_trial *of, msim_sim **sim,
                                    msim_error *err) {
  const msim_state late = state_of(p, p->planes_count && !p->mid_run ? &p->middle : &p->end);
  return start_method(p, of, &late, sim, err);
}

const ms_model *ms_pilot_run_model(const ms_pilot_run *p) {
  return &ms_sim_largest_island(p->sims[MSIM_COLLISION_REFLECT])->model;
}

double ms_pilot_run_longest_to_locate(const ms_pilot_run *p, const ms_integrator *method) {
  const msim_sim *sim = p->sims[MSIM_COLLISION_REFLECT];
  double omega = 0;
  for (int32_t i = 0; i < sim->nislands; i++)
    omega = fmax(omega, ms_bounds_compute_island(&sim->islands[i].model).omega);
  const double limit = ms_impact_location_longest_step(method, omega);
  return limit > 0 ? limit : INFINITY;
}

/*------------------------------------- errors ---------------------------------------------------*/

/* *done: they have not taken more evaluations than allowed. */
static msim_status make_trial_steps(ms_pilot_run *p, msim_sim *sim, int64_t n, double most,
                                    int *done, msim_error *err) {
  const double before = ms_pilot_run_count_work(sim);
  double work = 0;
  msim_status status = MSIM_OK;
  for (int64_t i = 0; i < n && !status && work <= most; i++) {
    status = ms_sim_make_steps(sim, 1, err);
    work = ms_pilot_run_count_work(sim) - before;
  }
  p->cost += work;
  *done = !status && work <= most;
  return status == MSIM_ERR_MEMORY ? status : MSIM_OK;
}

/* Estimate the error of m steps of h by 2 m steps of h/2: 2^p/(2^p - 1) times the distance of their
 * ends, p the order. INFINITY if the steps fail or take too many evaluations. */
static msim_status compare_half_steps(ms_pilot_run *p, const ms_trial *of, int64_t m,
                                      const ms_pilot_state *from, double *error, msim_error *err) {
  const double halving = ldexp(1, of->order);
  const msim_state state = state_of(p, from);
  msim_sim *sim;
  *error = INFINITY;
  for (int halved = 0; halved < 2; halved++) {
    ms_trial steps = *of;
    if (halved) steps.h /= 2;
    msim_status status = start_method(p, &steps, &state, &sim, err);
    if (status) return status;
    const double most = halved || of->most == 0 ? INFINITY : of->most;
    int done;
    status = make_trial_steps(p, sim, halved ? 2 * m : m, most, &done, err);
    if (status || !done) return status;
    if (!halved) ms_pilot_run_copy_state(p, sim, &p->scratch);
  }
  *error = halving / (halving - 1) * ms_pilot_run_find_distance(p, sim, &p->scratch);
  return MSIM_OK;
}

/* 1/120 of the run, at most 1024 steps: a trial costs three times that. With planes 1/14, to pass
 * the first impact. */
double ms_pilot_run_trial_steps(const ms_pilot_run *p, double h) {
  const double MOST = 1024;
  const double steps =
      p->planes_count ? p->span / MS_TRIALS_AT_PLANES / h : fmin(MOST, p->span / 120 / h);
  return fmax(1, round(steps));
}

double ms_pilot_run_growth(const ms_pilot_run *p, int order) {
  if (p->has_just_begun && order > 2) return p->step_growth;
  return p->error_growth * (order <= 2 && !p->planes_count ? 2 : 1);
}

/* The error at the end of the run if it is that after a trial of t seconds */
static double extrapolate(const ms_pilot_run *p, int order, double t, double error) {
  error *= ms_pilot_run_growth(p, order) * p->remaining / t;
  return error < INFINITY ? error : INFINITY;
}

msim_status ms_pilot_run_try_method(ms_pilot_run *p, const ms_trial *of, double *error,
                                    double *step_cost, msim_error *err) {
  const double before = p->cost;
  const int64_t m = (int64_t)ms_pilot_run_trial_steps(p, of->h);
  msim_status status = compare_half_steps(p, of, m, &p->end, error, err);
  *error = extrapolate(p, of->order, (double)m * of->h, *error);
  *step_cost = (p->cost - before) / (3 * (double)m);
  return status;
}

msim_status ms_pilot_run_compare_end(ms_pilot_run *p, const ms_integrator *method,
                                     const msim_state *end, int64_t n, double *error,
                                     msim_error *err) {
  const int order = method->entry.order;
  const double halving = ldexp(1, order), t = end->t;
  const ms_trial of = {.method = method,
                       .collision = MSIM_COLLISION_REFLECT,
                       .order = order,
                       .h = t / (2 * (double)n)};
  const msim_state from[] = {*end, state_of(p, &p->end)};
  const int64_t steps[] = {MS_DECAY_STEPS, 2 * n + MS_DECAY_STEPS};
  msim_sim *sim;
  int done = 1;
  *error = INFINITY;
  for (int i = 0; i < 2; i++) {
    msim_status status = start_method(p, &of, &from[i], &sim, err);
    if (!status) status = make_trial_steps(p, sim, steps[i], INFINITY, &done, err);
    if (status || !done) return status;
    if (i == 0) ms_pilot_run_copy_state(p, sim, &p->scratch);
  }
  *error = extrapolate(p, order, t,
                       halving / (halving - 1) * ms_pilot_run_find_distance(p, sim, &p->scratch));
  return MSIM_OK;
}

msim_status ms_pilot_run_measure_steps(ms_pilot_run *p, const ms_trial *of, int n,
                                       ms_step_measurement *steps, msim_error *err) {
  const msim_state from[MS_MEASURED_STEPS] = {state_of(p, &p->end), state_of(p, &p->middle),
                                              p->start};
  for (int i = 0; i < n; i++) {
    msim_sim *sim;
    msim_status status = start_method(p, of, &from[i], &sim, err);
    if (status) return status;
    const double before = ms_pilot_run_count_work(sim);
    status = ms_step_verification_measure(sim, &p->scales, &steps[i], err);
    p->cost += ms_pilot_run_count_work(sim) - before;
    if (status == MSIM_ERR_MEMORY) return status;
    if (status) steps[i].error = INFINITY;
  }
  return MSIM_OK;
}

/*------------------------------------- the pilot run --------------------------------------------*/

/* A step that fails leaves the state before it. */
static msim_status make_pilot_steps(ms_pilot_run *p, msim_sim *sim, int64_t steps,
                                    msim_error *err) {
  const int64_t before = sim->stats.contacts;
  const msim_status status = ms_sim_make_steps(sim, steps, err);
  p->duration = ms_sim_time(sim);
  p->met_plane |= sim->stats.contacts > before;
  return status == MSIM_ERR_MEMORY ? status : MSIM_OK;
}

/* 1: the pilot run of so many steps continues to an impact: up to 3/4 of the run if a plane is
 * close at its start, else up to 1/3 while a plane could be met there. To choose anew at a late
 * impact costs less than fixed steps for impacts until then, but one choice costs less than two. */
static int continues_to_impact(const ms_pilot_run *p, const msim_sim *sim, double h,
                               int64_t steps) {
  const double t = (double)steps * h, end = p->span / 3;
  if (p->planes_count) return t < 0.75 * p->span;
  return t < end && ms_step_verification_is_plane_close(sim, (end - t) / 2);
}

/* With planes, trials start where the part with the first impact began: free flight before that
 * is not typical. */
static void start_trials_at_impact(ms_pilot_run *p, msim_sim *sim, double began) {
  const ms_pilot_state before = p->scratch;
  p->scratch = p->end, p->end = before;
  ms_pilot_run_copy_state(p, sim, &p->middle);
  p->remaining = p->span - began;
}

/* The pilot run in parts of 1/64 of the run; it also stops in its middle and at its end. */
static msim_status make_pilot_run(ms_pilot_run *p, const ms_trial *pilot, msim_error *err) {
  const double MOST = 8192; /* steps in half of it: long runs are not chosen for at greater cost */
  const double h = pilot->h;
  const int64_t part = (int64_t)fmax(1, round(p->span / h / 64)),
                half = (int64_t)fmax(1, fmin(MOST, round(p->span / h / 16)));
  double began = 0, flown = 0;
  msim_sim *sim;
  msim_status status = start_method(p, pilot, &p->start, &sim, err);
  if (status) return status;
  p->remaining = p->span;
  p->planes_count |= ms_step_verification_is_plane_close(sim, h);
  for (int64_t n = 0; !status && !(p->met_plane && n % part == 0) &&
                      (n < 2 * half || continues_to_impact(p, sim, h, n));) {
    const int64_t of_part = part - n % part, of_half = half - n % half,
                  steps = of_part < of_half ? of_part : of_half;
    if (n % part == 0) began = p->duration;
    if (n % part == 0) ms_pilot_run_copy_state(p, sim, &p->scratch);
    status = make_pilot_steps(p, sim, steps, err);
    n += steps;
    if (n == half) ms_pilot_run_copy_state(p, sim, &p->middle);
    if (n == 2 * half) ms_pilot_run_copy_state(p, sim, &p->end), flown = p->duration;
  }
  p->cost += ms_pilot_run_count_work(sim);
  p->planes_count |= p->met_plane;
  if (p->planes_count) start_trials_at_impact(p, sim, began);
  else p->duration = flown;
  return status;
}

/* Set p->step_growth: g = (error of a step at the end)/(that in the middle of the pilot run),
 * 1 <= g <= 4; with planes 1. And p->error_growth: g, or g^2 unless damping is strong; with planes
 * 10, as later impacts may have larger errors. And p->has_just_begun: the errors go like t^2.2 or a
 * higher power of the time since the start. */
static msim_status find_growth(ms_pilot_run *p, const ms_trial *step, msim_error *err) {
  const double MOST = 4, BEGINNING = 4.5;
  double now, before;
  p->step_growth = 1;
  p->error_growth = p->planes_count ? 10 : 1;
  if (p->planes_count) return MSIM_OK;
  msim_status status = compare_half_steps(p, step, 1, &p->middle, &before, err);
  if (!status) status = compare_half_steps(p, step, 1, &p->end, &now, err);
  if (status) return status;
  const double ratio = now / fmax(before, p->scales.rounding);
  p->has_just_begun = ratio > BEGINNING;
  p->step_growth = fmax(1, fmin(ratio, MOST));
  p->error_growth = pow(p->step_growth, ms_pilot_run_is_limited_by_damping(p) ? 1 : 2);
  return MSIM_OK;
}

/*------------------------------------- creation and destruction ---------------------------------*/

static int is_damped(const ms_scene *scene) {
  for (int32_t e = 0; e < scene->nsprings; e++)
    if (scene->damping[e] > 0) return 1;
  for (int32_t e = 0; e < scene->angles.n; e++)
    if (scene->angles.damping[e] > 0) return 1;
  return ms_external_has_velocity(&scene->external);
}

static int32_t count_free_in_scene(const ms_scene *scene) {
  int32_t count = 0;
  for (int32_t i = 0; i < scene->nparticles; i++) count += !scene->pinned[i];
  return count;
}

/* *n: the number of free particles in the largest connected component */
static msim_status find_largest_component(const msim_sim *sim, int32_t *n, msim_error *err) {
  msim_status status = MSIM_OK;
  *n = 0;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands && !status; m++) {
    ms_norm norm;
    status = ms_norm_create(&m->model, &norm, err);
    for (int32_t i = 0; i < norm.n && !status; i++)
      if (norm.body[i].n > *n) *n = norm.body[i].n;
    ms_norm_destroy(&m->model, &norm);
  }
  return status;
}

/* With planes the particles of a connected component count, as each has its own impacts. Many
 * particles have too many impacts for steps that end at each one. */
static msim_status classify_count(ms_pilot_run *p, msim_error *err) {
  enum { FEW = 12, MANY = 64 };
  const int32_t free = count_free_in_scene(p->sim->scene);
  int32_t part = free;
  p->many = free >= MANY;
  msim_status status = MSIM_OK;
  if (p->planes_count && !p->many)
    status = find_largest_component(p->sims[MSIM_COLLISION_REFLECT], &part, err);
  p->few = part < FEW;
  return status;
}

static msim_status prepare_pilot_run(ms_pilot_run *p, double t0, msim_error *err) {
  const ms_scene *scene = p->sim->scene;
  msim_options opt = p->sim->config.opt;
  ms_plan plan;
  opt.tol = p->tol;
  msim_status status = ms_plan_create(&opt, t0, &plan, err);
  if (status) return status;
  p->span = ms_plan_span(&plan);
  p->damped = is_damped(scene);
  status = ms_scales_compute(scene, p->start.x, p->start.v, p->span, &p->scales, err);
  if (!status) status = ms_bounds_compute(scene, 1, &p->bounds, err);
  if (status) return status;
  const size_t n = component_count(p);
  ms_pilot_state *of[] = {&p->scratch, &p->end, &p->middle, &p->coarse_middle, &p->coarse_end};
  enum { STATES = sizeof of / sizeof *of };
  p->states = ms_memory_allocate(&p->sim->alloc, 2 * STATES * n, sizeof *p->states);
  if (!p->states) return ms_error_set_memory(err, "the choice of a method");
  for (size_t i = 0; i < STATES; i++)
    *of[i] = (ms_pilot_state){p->states + 2 * i * n, p->states + (2 * i + 1) * n};
  return MSIM_OK;
}

/* At least 100 steps in the run */
static ms_trial make_pilot(const ms_pilot_run *p, const ms_integrator *method) {
  const double FEWEST = 100;
  return (ms_trial){.method = method,
                    .collision = MSIM_COLLISION_REFLECT,
                    .order = 2,
                    .h = fmin(ms_pilot_run_stable_step(p, method), p->span / FEWEST)};
}

/* A pilot run need not be accurate, only lead to a state that is typical of the run. With weak
 * damping verlet does, for half the evaluations of velocity Verlet. Where damping limits the steps,
 * rkc may; those of ssprk104 under error control need fewer still, but fast vibrations persist at
 * their limit of stability, which determine the errors of trials from such a state. */
static ms_trial choose_pilot(const ms_pilot_run *p, const ms_trial *with_velocities) {
  const ms_trial stabilized = make_pilot(p, &ms_rkc);
  if (!p->damped || ms_scene_has_obstacles(p->sim->scene)) return *with_velocities;
  if (!ms_pilot_run_is_limited_by_damping(p)) return make_pilot(p, &ms_verlet);
  if (stabilized.h == 0) return *with_velocities;
  const double cost = ms_rkc.stages(stabilized.h, p->bounds) / stabilized.h;
  return cost < 0.75 * 2 / with_velocities->h ? stabilized : *with_velocities;
}

msim_status ms_pilot_run_begin(const msim_sim *sim, double tol, int late, const msim_state *start,
                               ms_pilot_run *p, msim_error *err) {
  *p = (ms_pilot_run){
      .sim = sim,
      .tol = tol,
      .mid_run = late,
      .planes_count = late,
      .start = {.size = sizeof p->start, .n = start->n, .x = start->x, .v = start->v}};
  msim_sim *largest;
  msim_status status = prepare_pilot_run(p, start->t, err);
  const ms_trial fixed = make_pilot(p, &ms_velocity_verlet);
  if (!status) status = get_sim(p, &fixed, &largest, err);
  return status ? status : classify_count(p, err);
}

msim_status ms_pilot_run_make(ms_pilot_run *p, msim_error *err) {
  const ms_trial step = make_pilot(p, &ms_velocity_verlet), pilot = choose_pilot(p, &step);
  msim_status status = make_pilot_run(p, &pilot, err);
  if (!status) status = classify_count(p, err);
  return status ? status : find_growth(p, &step, err);
}

void ms_pilot_run_end(ms_pilot_run *p) {
  for (int i = 0; i < MS_PILOT_SIMS; i++) msim_sim_destroy(p->sims[i]);
  ms_memory_free(&p->sim->alloc, p->states);
}
