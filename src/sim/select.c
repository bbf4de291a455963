#include "sim/select.h"

#include <math.h>
#include <string.h>

#include "integrate/methods.h"
#include "linear/kept.h"
#include "linear/predict.h"
#include "sim/drive.h"

/* What can take part: velocity Verlet stands for all explicit methods of order 2, dop853 for rk4,
 * whose steps control makes three times. tr-bdf2 damps what long steps cannot follow; the implicit
 * methods that do not are held up by it, and go no farther than explicit ones. */
static const struct {
  const ms_integrator *method;
  int evaluations, when_damped; /* in a step; 0: Newton's method decides */
  int fixes; /* symplectic: worth having in fixed steps, which keep energy within bounds */
} list[MS_CANDIDATES] = {
    {.method = &ms_velocity_verlet, .evaluations = 1, .when_damped = 2, .fixes = 1},
    {.method = &ms_force_gradient, .evaluations = 5, .fixes = 1},
    {.method = &ms_rkn6, .evaluations = 11, .fixes = 1},
    {.method = &ms_dop853, .evaluations = 12, .when_damped = 12},
    {.method = &ms_tr_bdf2}};

/* Why a candidate was passed over */
enum { NOT_PASSED_OVER, ACCURACY, TOO_DEAR, NOT_THROUGH, DAMPED, REASONS };
static const char *const reasons[REASONS] = {
    [ACCURACY] = "accuracy, not stability, sets the steps of the best so far",
    [TOO_DEAR] = "ten of its steps would cost more than a fifth of the run",
    [NOT_THROUGH] = "it is not through with the run at a fifth of the cost",
    [DAMPED] = "forces depend on velocities"};

enum { STATES = 3 };

/* What all candidates are tried in. */
typedef struct probe {
  const msim_sim *sim;
  double tol, span;
  ms_scales scales;
  ms_bounds bounds;
  int damped;
  const double *x0, *v0; /* flat 3n: the start */
  double *x[STATES], *v[STATES];
  double flown, price;
  int at; /* the state that the trial at hand is in; -1: none of them, or the start */
} probe;

static double limit_of(const probe *p, const ms_integrator *method) {
  return method->limit ? method->limit(&p->bounds) : INFINITY;
}

static int is_damped(const ms_scene *scene) {
  for (int32_t e = 0; e < scene->nsprings; e++)
    if (scene->damping[e] > 0) return 1;
  return scene->drag > 0;
}

/* A sim of the same scene. tol 0: with fixed steps of h */
static msim_status make_sim(probe *p, const ms_integrator *method, double tol, double h,
                            msim_sim **sim, msim_error *err) {
  msim_scene scene = {p->sim->scene};
  p->at = -1;
  msim_options opt = p->sim->opt;
  opt.size = sizeof opt;
  opt.integrator = method->entry.name;
  opt.tol = tol, opt.h = h, opt.t_end = -1, opt.warn = NULL;
  return msim_sim_create(&scene, &opt, sim, err);
}

static msim_status set_state(msim_sim *sim, const double *x, const double *v, msim_error *err) {
  const msim_state state = {.size = sizeof state, .n = sim->scene->nparticles, .x = x, .v = v};
  return msim_sim_set_state(sim, &state, err);
}

/* Evaluations that an iteration of pcg is worth; a coarse space doubles it. */
#define ITERATION 1.5

/* What it has done so far, in evaluations of all islands: each counts its own, taken as one of
 * many like the largest. An assembly is worth one; the flops of factors compare as in kept.h. */
static double work_of(const msim_sim *sim) {
  const ms_motion *m = ms_sim_largest(sim);
  const msim_stats *s = &sim->stats;
  const double flops = 2 * MS_FLOPS_PER_HALF / ITERATION * fmax(1, m->model.springs.n);
  double work = (double)s->force_evaluations + (double)s->assemblies;
  if (m->stepper.solver) {
    const ms_linear *linear = m->stepper.solver->linear;
    work += (double)s->iterations * ITERATION * (linear->aggregates ? 2 : 1);
    work += (double)s->factorizations * linear->flops / flops;
    work += (double)s->solves * MS_FLOPS_PER_FILL * linear->fill / flops;
  }
  return work / sim->nislands;
}

/*------------------------------------- states ---------------------------------------------------*/

/* A quarter of the run, in 600 steps at most */
static msim_status fly(probe *p, msim_sim *pilot, msim_error *err) {
  const double SHARE = 0.25;
  enum { MOST = 600 / STATES };
  const double h = pilot->plan.h, part = SHARE * p->span / STATES;
  const int64_t steps = (int64_t)fmin(fmax(1, round(part / h)), MOST);
  const size_t bytes = 3 * (size_t)p->sim->scene->nparticles * sizeof(double);
  msim_status status = set_state(pilot, p->x0, p->v0, err);
  for (int i = 0; i < STATES && !status; i++) {
    msim_state now = {.size = sizeof now};
    status = msim_sim_step(pilot, steps, err);
    msim_sim_state(pilot, &now);
    memcpy(p->x[i], now.x, bytes);
    memcpy(p->v[i], now.v, bytes);
  }
  p->flown = STATES * (double)steps * h;
  p->price += work_of(pilot);
  return status > 0 ? MSIM_OK : status; /* the state before the event is as good */
}

static msim_status find_states(probe *p, msim_error *err) {
  const double FINEST = 500; /* steps in the run at least, where nothing is stiff */
  const double h = fmin(MS_REACH * limit_of(p, &ms_velocity_verlet), p->span / FINEST);
  msim_sim *pilot = NULL;
  msim_status status = make_sim(p, &ms_velocity_verlet, 0, h, &pilot, err);
  if (!status) status = fly(p, pilot, err);
  msim_sim_destroy(pilot);
  return status;
}

/*------------------------------------- trials ---------------------------------------------------*/

/* To that state, in the run to come. */
static msim_status go_to(const probe *p, msim_sim *trial, const double *x, const double *v,
                         msim_error *err) {
  const double h = trial->opt.h;
  msim_status status = set_state(trial, x, v, err);
  if (status) return status;
  trial->plan.scales = p->scales;
  trial->control = ms_control_of(trial->integrator, p->tol, p->span);
  ms_drive_use_step(trial, h);
  return MSIM_OK;
}

/* E of a step of h from state i, over what is allowed. */
static msim_status try_step(probe *p, msim_sim *trial, int i, double h, double *ratio,
                            msim_error *err) {
  msim_status status = p->at == i ? MSIM_OK : go_to(p, trial, p->x[i], p->v[i], err);
  if (status) return status;
  p->at = i;
  *ratio = ms_drive_try(trial, h) / ms_control_limit(&trial->control, &p->scales, h);
  if (!(*ratio < INFINITY)) *ratio = INFINITY;
  return MSIM_OK;
}

/* The step of which control would make the next ones: E/h goes like h^k. Ends where that gets too
 * dear. */
static msim_status find_step(probe *p, msim_sim *trial, int i, double cap, double most,
                             ms_candidate *c, double *h, msim_error *err) {
  const double FARTHEST = 20, CLOSE = 1.25;
  const double k = ms_control_of(trial->integrator, p->tol, p->span).order;
  double ratio, change = FARTHEST;
  for (int tries = 0; tries < 4 && fmax(change, 1 / change) > CLOSE; tries++) {
    msim_status status = try_step(p, trial, i, *h, &ratio, err);
    if (status) return status;
    change = fmax(1 / FARTHEST, fmin(FARTHEST, pow(ratio, -1 / k)));
    if (*h * change > cap) change = cap / *h;
    *h *= change;
    if (change < FARTHEST && c->price / *h > most) break;
  }
  return MSIM_OK;
}

/* That of the dearest state, as motion from rest grows wilder. Above `most` no other is tried. */
static msim_status find_cost(probe *p, msim_sim *trial, double most, ms_candidate *c,
                             msim_error *err) {
  const double SAFETY = 0.85; /* which the controller keeps */
  const double stable = (c->method->estimate ? 1 : 2) * MS_REACH * limit_of(p, c->method);
  const double cap = fmin(stable, p->span / 10);
  double h = fmin(c->h, cap);
  c->h = INFINITY;
  c->held = 1;
  for (int i = 0; i < STATES && (i == 0 || c->cost <= most); i++) {
    msim_status status = find_step(p, trial, i, cap, most, c, &h, err);
    if (status) return status;
    const double made = h < cap ? SAFETY * h : h;
    c->held &= h == stable;
    c->h = fmin(c->h, made);
    c->cost = fmax(i ? c->cost : 0, c->price / made);
  }
  return MSIM_OK;
}

/* Would fixed steps of h do? The estimate is that of two halves: a whole step has 2^p times it. */
static msim_status try_fixed(probe *p, msim_sim *trial, double h, int *fixed, msim_error *err) {
  const double whole = ldexp(1, trial->integrator->entry.order);
  *fixed = 1;
  for (int i = 0; i < STATES && *fixed; i++) {
    double ratio;
    msim_status status = try_step(p, trial, i, h, &ratio, err);
    if (status) return status;
    *fixed = MS_MARGIN * whole * ratio <= 1;
  }
  return MSIM_OK;
}

/*------------------------------------- candidates -----------------------------------------------*/

/* Far from the best there is no need to know how far. */
#define FAR 3.0

static msim_status consider_explicit(probe *p, int i, double best, ms_candidate *c,
                                     msim_error *err) {
  const double stable = MS_REACH * limit_of(p, c->method);
  const int evaluations = p->damped ? list[i].when_damped : list[i].evaluations;
  msim_sim *trial;
  c->h = fmin(stable, p->span / 10);
  msim_status status = make_sim(p, c->method, p->tol, c->h, &trial, err);
  if (status) return status;
  if (list[i].fixes && !p->sim->scene->nplanes && stable <= p->span / 10)
    status = try_fixed(p, trial, stable, &c->fixed, err);
  c->price = (c->fixed || c->method->estimate ? 1 : 3) * evaluations;
  if (c->fixed) c->h = stable, c->cost = c->price / stable, c->held = 1;
  else if (!status) status = find_cost(p, trial, FAR * best, c, err);
  p->price += work_of(trial);
  msim_sim_destroy(trial);
  return status;
}

/* Of a step of two halves and a whole one, two stages each, by linear/predict.h, where Newton's
 * method is quick. Conjugate gradients need no more iterations than there are unknowns. */
static double predict_price(const msim_sim *trial, double h) {
  const double CORRECTIONS = 2, RTOL = 0.01;
  const ms_model *model = &ms_sim_largest(trial)->model;
  const ms_prediction p = ms_predict(model, h, RTOL);
  const double unknowns = (double)model->rows.dims * model->rows.nfree;
  const double iterations = fmin(unknowns, fmin(p.one_level, 2 * p.two_level));
  return 3 * 2 * CORRECTIONS * (2 + ITERATION * iterations);
}

/* The whole run, or as much of it as may be had for `most` evaluations */
static msim_status run_through(const probe *p, msim_sim *trial, double most, ms_candidate *c,
                               msim_error *err) {
  msim_status status = go_to(p, trial, p->x0, p->v0, err);
  while (!status && trial->t < p->span && work_of(trial) < most)
    status = msim_sim_step(trial, 1, err);
  if (status < 0 || trial->step == 0) return status < 0 ? status : MSIM_OK;
  c->h = trial->t / (double)trial->step;
  c->price = work_of(trial) / (double)trial->step;
  if (trial->t >= p->span) c->cost = c->price / c->h;
  return MSIM_OK;
}

/* How far an implicit method comes no single step tells: what makes its steps short comes once the
 * motion has grown wild, and costs up to 20 times what the first states promise. So it has to make
 * the whole run for a fifth of the best cost. That is asked only where stability holds explicit
 * methods back, and where ten such steps may be had for that. */
static msim_status consider_implicit(probe *p, const ms_candidate *best, ms_candidate *c,
                                     msim_error *err) {
  const double most = best->cost * p->span / 5;
  msim_sim *trial;
  if (!best->held) {
    c->why = ACCURACY;
    return MSIM_OK;
  }
  msim_status status = make_sim(p, c->method, p->tol, p->span / 100, &trial, err);
  if (status) return status;
  c->why = TOO_DEAR;
  if (10 * predict_price(trial, p->span / 10) < most) {
    status = run_through(p, trial, most, c, err);
    c->why = c->cost < INFINITY ? NOT_PASSED_OVER : NOT_THROUGH;
  }
  p->price += work_of(trial);
  msim_sim_destroy(trial);
  return status;
}

static msim_status consider(probe *p, int i, ms_selection *s, msim_error *err) {
  ms_candidate *c = &s->candidates[i];
  const ms_candidate *best = i ? &s->candidates[s->best] : c;
  msim_status status = MSIM_OK;
  *c = (ms_candidate){.method = list[i].method, .cost = INFINITY};
  if (c->method->separable && p->damped) c->why = DAMPED;
  else if (c->method->entry.implicit) status = consider_implicit(p, best, c, err);
  else status = consider_explicit(p, i, best->cost, c, err);
  if (c->cost < best->cost) s->best = i;
  return status;
}

static msim_status consider_all(probe *p, ms_selection *s, msim_error *err) {
  msim_status status = find_states(p, err);
  for (int i = 0; i < MS_CANDIDATES && !status; i++) status = consider(p, i, s, err);
  s->flown = p->flown, s->price = p->price;
  return status;
}

/*------------------------------------- the choice -----------------------------------------------*/

/* As if all that had been asked for. The first step is one that is stable. */
static void use(msim_sim *sim, const probe *p, const ms_selection *s) {
  const ms_candidate *c = &s->candidates[s->best];
  sim->selection = *s;
  sim->selection.out_of_date = 1;
  sim->integrator = c->method;
  sim->opt.integrator = c->method->entry.name;
  sim->opt.tol = c->fixed ? 0 : s->tol;
  sim->opt.h = fmin(c->h, MS_REACH * limit_of(p, c->method));
  sim->advice = (ms_advice){.chosen = c->fixed, .warned = sim->advice.warned};
}

static msim_status prepare(probe *p, double t0, const double *x, const double *v, msim_error *err) {
  const ms_scene *scene = p->sim->scene;
  msim_options opt = p->sim->opt;
  ms_plan plan;
  opt.tol = p->tol;
  msim_status status = ms_plan_create(&opt, t0, &plan, err);
  if (status) return status;
  p->span = ms_plan_span(&plan);
  p->damped = is_damped(scene);
  status = ms_scales_compute(scene, x, v, p->span, &p->scales, err);
  return status ? status : ms_bounds_compute(scene, 1, &p->bounds, err);
}

msim_status ms_sim_select(msim_sim *sim, double t0, const double *x, const double *v,
                          msim_error *err) {
  ms_selection s = {.tol = sim->selection.tol};
  probe p = {.sim = sim, .tol = s.tol, .x0 = x, .v0 = v};
  const size_t n = 3 * (size_t)sim->scene->nparticles;
  msim_status status = prepare(&p, t0, x, v, err);
  if (status) return status;
  double *states = ms_new(&sim->alloc, 2 * STATES * n, sizeof *states);
  if (!states) return ms_fail_memory(err, "the choice of a method");
  for (size_t i = 0; i < STATES; i++)
    p.x[i] = states + 2 * i * n, p.v[i] = states + (2 * i + 1) * n;
  status = consider_all(&p, &s, err);
  if (!status) use(sim, &p, &s);
  ms_delete(&sim->alloc, states);
  return status;
}

static void pass_candidate(ms_bytes *b, int i, ms_candidate *c) {
  c->method = list[i].method;
  double *numbers[] = {&c->price, &c->cost, &c->h};
  int *flags[] = {&c->held, &c->fixed, &c->why};
  for (int k = 0; k < 3; k++) MS_BYTES_PASS(b, *numbers[k]);
  for (int k = 0; k < 3; k++) MS_BYTES_PASS(b, *flags[k]);
  ms_bytes_check(b, c->why >= 0 && c->why < REASONS, "the choice of a method");
}

void ms_selection_history(ms_bytes *b, ms_selection *s) {
  double *numbers[] = {&s->tol, &s->flown, &s->price};
  for (int k = 0; k < 3; k++) MS_BYTES_PASS(b, *numbers[k]);
  MS_BYTES_PASS(b, s->best);
  for (int i = 0; i < MS_CANDIDATES; i++) pass_candidate(b, i, &s->candidates[i]);
  ms_bytes_check(b, s->best >= 0 && s->best < MS_CANDIDATES && s->tol > 0,
                 "the choice of a method");
}

static void explain_candidate(const ms_candidate *c, int is_best, ms_text *out) {
  ms_print(out, "              %-17s ", c->method->entry.name);
  if (c->why) {
    ms_print(out, "passed over: %s\n", reasons[c->why]);
    return;
  }
  ms_print(out, "h = %-8.3g %5.4g evaluations a step, %8.4g a second%s%s\n", c->h, c->price,
           c->cost, c->held ? ", held by stability" : "",
           !is_best   ? ""
           : c->fixed ? ": chosen, in fixed steps"
                      : ": chosen, under error control");
}

void ms_selection_explain(const ms_selection *s, ms_text *out) {
  ms_print(out,
           "auto          chosen for tol = %g by steps tried in %d states up to %.3g s from the "
           "start,\n              for the price of %.0f evaluations\n",
           s->tol, STATES, s->flown, s->price);
  for (int i = 0; i < MS_CANDIDATES; i++) explain_candidate(&s->candidates[i], i == s->best, out);
}
