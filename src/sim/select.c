#include "sim/select.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

#include "integrate/cut.h"
#include "integrate/locate.h"
#include "integrate/methods.h"
#include "linear/predict.h"
#include "sim/drive.h"
#include "sim/probe.h"
#include "sim/reasons.h"

/* The impacts of so many particles are few enough to be located one by one. */
enum { FEW = 4 };

enum {
  LEAPFROG,
  LOCATED,
  CORRECTED,
  FOURTH,
  STABILISED,
  SIXTH,
  EIGHTH,
  CONTROLLED,
  SPLIT,
  IMPLICIT
};

/* The candidates: methods and their evaluations per step, [0] if no force depends on velocities,
 * else [1]; 0: measured. first: evaluations at the first state, if there are many. The leapfrog
 * stands for all explicit methods of order 2. Evaluations of dop853 count 19/12-fold, as it forms
 * so many sums; those of rkc follow from h. tr-bdf2 damps what long steps cannot resolve; implicit
 * methods that do not damp it have to resolve it, and take no longer steps than explicit ones. */
static const struct {
  const ms_integrator *method[2];
  double evaluations[2];
  double first;
} list[MS_CANDIDATES] = {[LEAPFROG] = {{&ms_verlet, &ms_velocity_verlet}, {1, 2}},
                         [LOCATED] = {{&ms_velocity_verlet, &ms_velocity_verlet}, {1, 2}},
                         [CORRECTED] = {{&ms_takahashi_imada, &ms_takahashi_imada}, {2, 2}, 51},
                         [FOURTH] = {{&ms_force_gradient, &ms_rk4}, {5, 4}},
                         [STABILISED] = {{&ms_rkc, &ms_rkc}, {2, 2}},
                         [SIXTH] = {{&ms_rkn6, &ms_rkn6}, {11, 11}},
                         [EIGHTH] = {{&ms_dop853, &ms_dop853}, {19, 19}},
                         [CONTROLLED] = {{&ms_dop853, &ms_dop853}, {19, 19}},
                         [SPLIT] = {{&ms_respa, &ms_respa}, {0}},
                         [IMPLICIT] = {{&ms_tr_bdf2, &ms_tr_bdf2}, {0}}};

/*------------------------------------- explicit ones --------------------------------------------*/

/* verlet carries v(t - h/2), so that no step can be halved: velocity-verlet takes its place where
 * steps are verified or divided. */
static const ms_integrator *method_of(const ms_probe *p, int i) {
  return list[i].method[p->damped || (i == LEAPFROG && (p->late || !p->many))];
}

static int why_not(const ms_probe *p, int i) {
  const int planes = p->near, few = p->sim->scene->nparticles <= FEW;
  if (i == LEAPFROG && planes && few) return MS_REASON_FEW_IMPACTS;
  if (i == LEAPFROG && planes && p->sim->selection.collision == MSIM_COLLISION_EVENT)
    return MS_REASON_TO_BE_LOCATED;
  if (i == LEAPFROG && planes && !p->met) return MS_REASON_NO_IMPACTS_YET;
  if (i == LOCATED && !planes) return MS_REASON_NO_IMPACTS;
  if (i == CORRECTED && planes) return MS_REASON_NO_PLANES;
  if ((i == CORRECTED || i == SIXTH) && p->damped) return MS_REASON_DAMPED;
  if (i == STABILISED && !p->damped) return MS_REASON_UNDAMPED;
  if (i == STABILISED && ms_probe_reach(p, &ms_rkc) == 0) return MS_REASON_NEVER_STABLE;
  if (!p->many && !planes && !ms_has_control(method_of(p, i))) return MS_REASON_UNVERIFIED;
  if (i == CONTROLLED && p->late) return MS_REASON_ON_GRID;
  if (i != CONTROLLED && p->few) return MS_REASON_FEW_PARTICLES;
  return MS_REASON_NONE;
}

static double longest(const ms_probe *p, const ms_integrator *method) {
  return fmin(ms_probe_reach(p, method), p->span / 10);
}

/* Located impacts are of order 2 in longer steps, which trials of shorter steps do not show. */
static double longest_to_locate(const ms_probe *p, const ms_integrator *method) {
  const double limit = ms_locate_longest(method, p->bounds.omega);
  return limit > 0 ? fmin(longest(p, method), limit) : longest(p, method);
}

/* Set the evaluations of steps of c->h, and their cost. */
static void settle(const ms_probe *p, int i, ms_candidate *c) {
  if (c->method->stages) c->price = c->method->stages(c->h, ms_bounds_of(ms_probe_model(p)));
  c->cost = c->price / c->h + list[i].first / p->span;
}

/* The cost, and for an untried method 4 times that of its trial, which consists of m steps, 2 m
 * half steps and two starts: most savings turn out smaller than they seem. */
static double outlook(const ms_probe *p, int i, const ms_candidate *c) {
  const double WORTH = 4;
  if (c->tried || i == CONTROLLED) return c->cost;
  const double trial = 3 * c->price * ms_probe_steps(p, c->h) + 2 * list[i].first;
  return c->cost + WORTH * trial / p->span;
}

static void enter(const ms_probe *p, int i, ms_candidate *c) {
  const int controlled = i == IMPLICIT || i == CONTROLLED;
  const int located = controlled ? p->sim->scene->nplanes > 0 : p->near && i != LEAPFROG;
  *c = (ms_candidate){.method = method_of(p, i),
                      .collision = located ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT,
                      .controlled = controlled,
                      .price = list[i].evaluations[p->damped],
                      .cost = INFINITY,
                      .why = why_not(p, i)};
  if (c->price == 0 || c->why) return;
  c->h = located && !controlled ? longest_to_locate(p, c->method) : longest(p, c->method);
  settle(p, i, c);
}

/* verlet has the positions of velocity Verlet. Reflection at the ends of steps is of order 1. */
static ms_trial trial_of(const ms_probe *p, const ms_candidate *c) {
  const int reflects = c->collision == MSIM_COLLISION_REFLECT && p->near;
  return (ms_trial){.method = c->method == &ms_verlet ? &ms_velocity_verlet : c->method,
                    .collision = c->collision,
                    .order = reflects ? 1 : c->method->entry.order};
}

/* Errors of takahashi-imada depend more on fast modes than those of other methods, and fast modes
 * come later in a run: its error counts fourfold. */
static msim_status measure(ms_probe *p, ms_candidate *c, msim_error *err) {
  const double ROUGHER = 4;
  const ms_trial trial = trial_of(p, c);
  double price;
  msim_status status = ms_probe_error(p, &trial, c->h, &c->error, &price, err);
  if (c->method == &ms_takahashi_imada) c->error *= ROUGHER;
  if (c->collision == MSIM_COLLISION_EVENT) c->price = fmax(c->price, price);
  return status;
}

/* Find the step whose error is tol: errors go like h^k once they are small (ROUGH). A step that is
 * more than twice as long or as short as the one tried has to be tried itself. The error of a trial
 * of m steps cannot be smaller than their rounding, which adds up like sqrt(m). */
static msim_status try_step(ms_probe *p, int i, ms_candidate *c, double *most, msim_error *err) {
  const double SAFETY = 0.95, FARTHEST = 20, ROUGH = 0.01;
  const double k = trial_of(p, c).order, h = c->h;
  msim_status status = measure(p, c, err);
  if (status) return status;
  const double rounding = p->scales.rounding * p->span / (h * sqrt(ms_probe_steps(p, h)));
  const double allowed = fmax(p->tol, rounding);
  const double change = fmin(FARTHEST, SAFETY * pow(allowed / c->error, 1 / k));
  if (c->error > allowed) *most = SAFETY * h;
  c->h = fmin(*most, h * (c->error > ROUGH ? fmax(1 / FARTHEST, change) : change));
  if (c->error <= allowed && c->h < h) c->h = h;
  c->tried = c->h > h / 2 && c->h < 2 * h;
  c->error *= pow(c->h / h, k);
  settle(p, i, c);
  return MSIM_OK;
}

static msim_status make_sim(const ms_probe *p, const ms_integrator *method, double tol, double h,
                            msim_sim **sim, msim_error *err) {
  msim_scene scene = {p->sim->scene};
  msim_options opt = p->sim->opt;
  opt.size = sizeof opt;
  opt.integrator = method->entry.name;
  opt.collision = MSIM_COLLISION_REFLECT;
  opt.tol = tol, opt.h = h, opt.t_end = -1, opt.warn = NULL;
  opt.watch = MSIM_WATCH_OFF;
  return msim_sim_create(&scene, &opt, sim, err);
}

/* Run `trial` under error control from its present state to t, or until it has spent `most`
 * evaluations. tol and scales are those of the whole run. */
static msim_status run_to(ms_probe *p, msim_sim *trial, double t, double most, ms_candidate *c,
                          int *arrived, msim_error *err) {
  msim_status status = MSIM_OK;
  ms_drive_measure(trial, p->span);
  trial->control = ms_control_of(trial->integrator, p->tol, p->span);
  ms_drive_use_step(trial, trial->opt.h);
  while (!status && trial->t < t && ms_probe_work(trial) < most)
    status = msim_sim_step(trial, 1, err);
  p->price += ms_probe_work(trial);
  *arrived = trial->t >= t;
  if (status < 0 || trial->step == 0) return status < 0 ? status : MSIM_OK;
  c->h = trial->t / (double)trial->step;
  c->price = ms_probe_work(trial) / (double)trial->step;
  return MSIM_OK;
}

/* dop853 under error control over the third quarter of the pilot run, or as long as it costs less
 * than the best candidate so far would there. Its evaluations count more, as in `list`. */
static msim_status try_controlled(ms_probe *p, double least, ms_candidate *c, msim_error *err) {
  const double SUMS = 19. / 12, t = fmax(p->flown, p->span / 16) / 4;
  msim_sim *trial;
  int arrived = 0;
  msim_status status = make_sim(p, c->method, p->tol, fmin(c->h, t), &trial, err);
  if (status) return status;
  status = ms_probe_start_half(p, trial, err);
  if (!status) status = run_to(p, trial, t, least * t / SUMS, c, &arrived, err);
  msim_sim_destroy(trial);
  c->price *= SUMS;
  c->cost = arrived ? c->price / c->h : INFINITY;
  if (!arrived) c->why = MS_REASON_COSTS_MORE;
  c->tried = 1;
  return status;
}

static int most_promising(const ms_probe *p, const ms_candidate *c) {
  int best = 0;
  for (int i = 1; i < MS_CANDIDATES; i++)
    if (outlook(p, i, &c[i]) < outlook(p, best, &c[best])) best = i;
  return best;
}

static double least_tried(const ms_candidate *c) {
  double least = INFINITY;
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (c[i].tried) least = fmin(least, c[i].cost);
  return least;
}

static msim_status choose_explicit(ms_probe *p, ms_selection *s, msim_error *err) {
  enum { PATIENCE = 6 };
  ms_candidate *c = s->candidates;
  double most[MS_CANDIDATES];
  int tries[MS_CANDIDATES] = {0};
  msim_status status = MSIM_OK;
  for (int i = 0; i < MS_CANDIDATES; i++) {
    enter(p, i, &c[i]);
    most[i] = c[i].h;
  }
  for (s->best = most_promising(p, c); !status && !c[s->best].tried;
       s->best = most_promising(p, c)) {
    const int i = s->best;
    status = i == CONTROLLED ? try_controlled(p, least_tried(c), &c[i], err)
                             : try_step(p, i, &c[i], &most[i], err);
    c[i].tried |= ++tries[i] == PATIENCE;
  }
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (c[i].cost < c[s->best].cost) c[i].why = MS_REASON_NOT_WORTH_IT;
  return status;
}

/*------------------------------------- where stability sets the steps ---------------------------*/

static int is_held(const ms_probe *p, const ms_candidate *c) {
  const double reach = ms_probe_reach(p, c->method);
  return c->controlled ? c->h > reach / 2 : c->h == reach;
}

/* *n: steps of respa for half of the pilot run, with the fewest evaluations among 1/4, 1/8, ... of
 * the number that velocity Verlet needs; *cost: evaluations per simulated second. */
static msim_status find_split(const ms_probe *p, int64_t *n, double *cost, msim_error *err) {
  const ms_model *model = ms_probe_model(p);
  const double springs = model->springs.n;
  int *octave = ms_new(&p->sim->alloc, (size_t)model->springs.n, sizeof *octave);
  msim_status status = octave ? MSIM_OK : ms_fail_memory(err, "the choice of a method");
  *cost = INFINITY;
  for (int64_t m = (int64_t)(p->flown / longest(p, &ms_velocity_verlet)) / 8; m > 0 && !status;
       m /= 2) {
    const double h = p->flown / (double)(2 * m);
    ms_cut cut;
    status = ms_cut_choose(model, h, octave, &cut, err);
    const double price = (springs + cut.inner * cut.nstiff) / springs;
    if (status || cut.nstiff == 0) break;
    if (price / h < *cost) *n = m, *cost = price / h;
  }
  ms_delete(&p->sim->alloc, octave);
  return status;
}

/* Repeat the pilot run in 2 n steps; that had much shorter ones, whose error is negligible. */
static msim_status try_split(ms_probe *p, int64_t n, ms_candidate *c, msim_error *err) {
  msim_sim *sim;
  c->h = p->flown / (double)(2 * n);
  msim_status status = make_sim(p, c->method, 0, c->h, &sim, err);
  if (status) return status;
  status = ms_probe_fly_beside(p, sim, n, &c->error, err);
  c->price = ms_probe_work(sim) / (double)(2 * n);
  msim_sim_destroy(sim);
  return status;
}

/* respa costs more than its evaluations, and may resonate: it has to save three quarters. */
static msim_status consider_split(ms_probe *p, const ms_candidate *best, ms_candidate *c,
                                  msim_error *err) {
  const double WORTH = 0.25;
  double cost;
  int64_t n = 0;
  c->why = MS_REASON_NO_FEW_STIFF;
  if (p->near || !p->many || !is_held(p, best)) return MSIM_OK;
  msim_status status = find_split(p, &n, &cost, err);
  for (int tries = 0; tries < 3 && !status && cost < WORTH * best->cost; tries++) {
    status = try_split(p, n, c, err);
    c->why = c->error <= p->tol ? MS_REASON_NONE : MS_REASON_ERROR_TOO_LARGE;
    cost = c->price / c->h;
    if (!c->why) c->cost = cost;
    if (!c->why) break;
    n *= 2, cost *= 2;
  }
  return status;
}

/* Evaluations of a step of tr-bdf2, which is made whole and in two halves, of two stages each,
 * while Newton's method converges quickly; iterations by linear/predict.h. Conjugate gradients need
 * no more iterations than there are unknowns. */
static double predict_price(const ms_model *model, double h) {
  const double CORRECTIONS = 2, RTOL = 0.01;
  const ms_prediction p = ms_predict(model, h, RTOL);
  const double unknowns = (double)model->rows.dims * model->rows.nfree;
  const double iterations = fmin(unknowns, fmin(p.one_level, 2 * p.two_level));
  return 3 * 2 * CORRECTIONS * (2 + MS_ITERATION * iterations);
}

/* No single step shows how long the steps of an implicit method may be: they become short once the
 * motion is rough, and cost up to 20 times what the first states predict. So tr-bdf2 has to make
 * the whole run for a fifth of the best cost. It is tried only where stability limits explicit
 * methods, and ten of its steps, as predicted, cost less than that. */
static msim_status consider_implicit(ms_probe *p, const ms_candidate *best, ms_candidate *c,
                                     msim_error *err) {
  const double most = best->cost * p->span / 5;
  msim_sim *trial;
  c->why = MS_REASON_ACCURACY_DECIDES;
  if (p->near || !is_held(p, best)) return MSIM_OK;
  c->why = MS_REASON_TOO_EXPENSIVE;
  if (10 * predict_price(ms_probe_model(p), p->span / 10) >= most) return MSIM_OK;
  msim_status status = make_sim(p, c->method, p->tol, p->span / 100, &trial, err);
  if (status) return status;
  int arrived = 0;
  status = ms_probe_start(p, trial, err);
  if (!status) status = run_to(p, trial, p->span, most, c, &arrived, err);
  if (arrived) c->cost = c->price / c->h;
  c->why = arrived ? MS_REASON_NONE : MS_REASON_UNFINISHED;
  msim_sim_destroy(trial);
  return status;
}

/*------------------------------------- the choice -----------------------------------------------*/

/* The largest error of a step without an event; if there is none, the least error */
static double usual_error(const ms_measured *s, int n, double event) {
  double largest = 0, least = INFINITY;
  for (int i = 0; i < n; i++) {
    least = fmin(least, s[i].error);
    if (s[i].error <= event) largest = fmax(largest, s[i].error);
  }
  return largest > 0 ? largest : least;
}

/* Set the difference from their halves that verified steps may have (verify.h): 50 e tol/E, at
 * least tol h/T, and at most tol/4, or 4 e tol/E if that is more where particles are many and no
 * plane is near. e: that of a step at the choice; E: the error foreseen without the growth to come.
 * A measured step may contain an event, whose error and indicators are not typical: so several are
 * measured, but only one of many particles, where all steps are alike. */
static msim_status find_allowed(ms_probe *p, const ms_candidate *c, ms_verification *v,
                                msim_error *err) {
  const double CARE = 50, SOME = 4, event = p->tol / 4;
  const int n = p->many ? 1 : MS_MEASURED;
  ms_measured s[MS_MEASURED];
  v->scales = p->scales;
  v->away = p->sim->scene->nplanes > 0 && !p->near;
  const int reflects = c->collision == MSIM_COLLISION_REFLECT; /* reflection is of order 1 */
  if (c->controlled || !ms_has_control(c->method)) return MSIM_OK;
  if (p->near && reflects) return MSIM_OK;
  v->only_events = p->near && p->many;
  if (v->only_events) v->allowed = p->tol / MS_EVENTS;
  if (v->only_events) return MSIM_OK;
  const ms_trial trial = trial_of(p, c);
  msim_status status = ms_probe_measure_steps(p, &trial, c->h, n, s, err);
  if (status) return status;
  const double share = p->tol * c->h / p->span;
  const double foreseen = fmax(c->error / p->growth, DBL_MIN);
  const double even = usual_error(s, n, event) * p->tol / foreseen;
  const double most = p->near || !p->many ? event : fmax(event, SOME * even);
  v->allowed = fmin(most, fmax(share, CARE * even));
  for (int i = 0; i < n; i++)
    for (int k = 0; k < 2 && s[i].error <= v->allowed; k++)
      v->sign[k] = fmax(v->sign[k], s[i].sign[k]);
  return MSIM_OK;
}

static msim_status choose(ms_probe *p, ms_selection *s, msim_error *err) {
  ms_candidate *c = s->candidates;
  msim_status status = choose_explicit(p, s, err);
  if (!status) status = consider_split(p, &c[s->best], &c[SPLIT], err);
  if (c[SPLIT].cost < c[s->best].cost) s->best = SPLIT;
  if (!status) status = consider_implicit(p, &c[s->best], &c[IMPLICIT], err);
  if (c[IMPLICIT].cost < c[s->best].cost) s->best = IMPLICIT;
  if (!status) status = find_allowed(p, &c[s->best], &s->verification, err);
  s->flown = p->flown, s->price = p->price, s->damped = p->damped;
  return status;
}

/* Rounding may be larger than tol, and the number of trials is limited. */
static void warn_of_error(const msim_sim *sim, const ms_candidate *c, double tol) {
  const double MUCH = 10;
  if (c->controlled || !(c->error > MUCH * tol)) return;
  ms_sim_warn(
      sim,
      "integrator 'auto': no method that was tried keeps tol = %g here; the error of the one "
      "chosen, %s, may reach %.2g",
      tol, c->method->entry.name, c->error);
}

/* Set method and options as if they had been requested. The first step is a stable one. */
static void use(msim_sim *sim, const ms_probe *p, const ms_selection *s) {
  const ms_candidate *c = &s->candidates[s->best];
  const double reach = ms_probe_reach(p, c->method);
  warn_of_error(sim, c, s->tol);
  sim->selection = *s;
  sim->selection.out_of_date = 1;
  sim->integrator = c->method;
  sim->opt.integrator = c->method->entry.name;
  sim->opt.tol = c->controlled ? s->tol : 0;
  sim->opt.h = fmin(c->h, reach);
  sim->opt.collision = c->collision;
  sim->advice = (ms_advice){.bounds = p->bounds,
                            .limit = reach / MS_REACH,
                            .known = 2,
                            .chosen = c->h == reach,
                            .warned = sim->advice.warned};
}

msim_status ms_sim_select(msim_sim *sim, int late, double t0, const double *x, const double *v,
                          msim_error *err) {
  ms_selection s = {.tol = sim->selection.tol, .collision = sim->selection.collision, .parts = 1};
  ms_probe p;
  msim_status status = ms_probe_begin(sim, s.tol, late, t0, x, v, &p, err);
  if (!status) status = choose(&p, &s, err);
  if (!status) use(sim, &p, &s);
  ms_probe_end(&p);
  return status;
}

static void pass_candidate(ms_bytes *b, int i, ms_candidate *c) {
  int32_t which = c->method == list[i].method[1];
  MS_BYTES_PASS(b, which);
  c->method = list[i].method[which != 0];
  double *numbers[] = {&c->price, &c->cost, &c->h, &c->error};
  int *flags[] = {&c->controlled, &c->tried, &c->why};
  for (int k = 0; k < 4; k++) MS_BYTES_PASS(b, *numbers[k]);
  for (int k = 0; k < 3; k++) MS_BYTES_PASS(b, *flags[k]);
  MS_BYTES_PASS(b, c->collision);
  ms_bytes_check(
      b, c->why >= 0 && c->why < MS_REASONS && c->controlled == (i == IMPLICIT || i == CONTROLLED),
      "the choice of a method");
  ms_bytes_check(b, c->collision == MSIM_COLLISION_REFLECT || c->collision == MSIM_COLLISION_EVENT,
                 "the choice of a method");
}

/* Impacts can be located by methods that have v and all forces at the same time. */
static int may_be_best(const ms_candidate *c) {
  const int locates = !c->method->sync && !c->method->splits;
  return c->why == MS_REASON_NONE && (locates || c->collision == MSIM_COLLISION_REFLECT);
}

void ms_selection_history(ms_bytes *b, ms_selection *s) {
  double *numbers[] = {&s->tol, &s->flown, &s->price};
  for (int k = 0; k < 3; k++) MS_BYTES_PASS(b, *numbers[k]);
  MS_BYTES_PASS(b, s->best);
  MS_BYTES_PASS(b, s->collision);
  MS_BYTES_PASS(b, s->damped);
  s->damped = s->damped != 0;
  ms_bytes_pass_count(b, &s->parts);
  ms_verification_history(b, &s->verification);
  ms_bytes_check(b, s->parts > 0, "the choice of a method");
  for (int i = 0; i < MS_CANDIDATES; i++) pass_candidate(b, i, &s->candidates[i]);
  ms_bytes_check(b, s->best >= 0 && s->best < MS_CANDIDATES && may_be_best(&s->candidates[s->best]),
                 "the choice of a method");
}

static void explain_candidate(const ms_candidate *c, int is_best, ms_text *out) {
  char name[32];
  snprintf(name, sizeof name, "%s%s", c->method->entry.name, c->controlled ? ", tol" : "");
  ms_print(out, "              %-17s ", name);
  if (c->why) {
    ms_print(out, "passed over: %s\n", ms_reasons_text(c->why));
    return;
  }
  ms_print(out, "h = %-8.3g %5.4g evaluations a step, %s%8.4g a second%s%s\n", c->h, c->price,
           c->tried || c->error > 0 ? "" : "at least ", c->cost,
           c->collision == MSIM_COLLISION_EVENT ? ", impacts located" : "",
           !is_best        ? ""
           : c->controlled ? ": chosen, under error control"
                           : ": chosen, in fixed steps");
}

void ms_selection_explain(const ms_selection *s, ms_text *out) {
  const ms_verification *v = &s->verification;
  ms_print(out,
           "auto          chosen for tol = %g by the first %.3g s of the run and steps tried from "
           "there,\n              for the price of %.0f evaluations\n",
           s->tol, s->flown, s->price);
  for (int i = 0; i < MS_CANDIDATES; i++) explain_candidate(&s->candidates[i], i == s->best, out);
  if (v->allowed > 0)
    ms_print(out,
             "              steps are verified: their halves may differ from them by %.2g of the "
             "scales\n",
             v->allowed);
  if (v->away) ms_print(out, "              chosen anew once a plane is close\n");
  if (s->parts > 1)
    ms_print(out, "              in %lld parts a step, as a plane was close\n",
             (long long)s->parts);
}
