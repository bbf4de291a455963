#include "choose/multirate_trial.h"

#include <math.h>

#include "choose/rejection_reasons.h"
#include "integrate/stiffness_partition.h"
#include "methods/methods.h"

/* respa costs more than its evaluations, and may resonate: it has to save three quarters, and to be
 * four times as accurate as predicted, as resonances grow. */
static const double WORTH = 0.25, CARE = 4;

static double trial_time(const ms_pilot_run *p) { return p->span / 16; }

static double step_of(const ms_pilot_run *p, int64_t n) { return trial_time(p) / (2 * (double)n); }

/* *n: steps for half of the trial, with the fewest evaluations among 1/4, 1/8, ... of the number
 * that velocity Verlet needs; *cost: evaluations per simulated second, INFINITY: there are none. */
static msim_status find_cheapest_step(const ms_pilot_run *p, int64_t *n, double *cost,
                                      msim_error *err) {
  const ms_model *model = ms_pilot_run_model(p);
  const double springs = model->springs.n,
               longest = ms_pilot_run_stable_step(p, &ms_velocity_verlet);
  int *class_of = ms_memory_allocate(&p->sim->alloc, (size_t)model->springs.n, sizeof *class_of);
  msim_status status = class_of ? MSIM_OK : ms_error_set_memory(err, "the choice of a method");
  *cost = INFINITY;
  for (int64_t m = (int64_t)(trial_time(p) / longest) / 8; m > 0 && !status; m /= 2) {
    const double h = step_of(p, m);
    ms_stiffness_partition partition;
    status = ms_stiffness_partition_choose(model, h, class_of, &partition, err);
    const double step_cost = (springs + partition.inner * partition.nstiff) / springs;
    if (status || partition.nstiff == 0) break;
    if (step_cost / h < *cost) *n = m, *cost = step_cost / h;
  }
  ms_memory_free(&p->sim->alloc, class_of);
  return status;
}

/* Make 2 n steps from the start; copy the states in their middle and at their end, or find their
 * distances from those copied. */
static msim_status run_from_start(ms_pilot_run *p, msim_sim *sim, int64_t n, double *distances,
                                  msim_error *err) {
  const ms_pilot_state *states[] = {&p->coarse_middle, &p->coarse_end};
  msim_status status = ms_pilot_run_set_start(p, sim, err);
  for (int i = 0; i < 2 && !status; i++) {
    status = ms_sim_make_steps(sim, n, err);
    if (distances) distances[i] = ms_pilot_run_find_distance(p, sim, states[i]);
    else ms_pilot_run_copy_state(p, sim, states[i]);
  }
  p->cost += ms_pilot_run_count_work(sim);
  return status;
}

/* The error at the end of the run of these fixed steps, by 2 n of them from its start and by twice
 * as many of half the length; INFINITY: such steps fail.
 *   E(T) = E(t) (T/t)^k,  k = log2(E(t)/E(t/2)) >= 1,  t = 2 n h: length of the trial */
static msim_status try_from_start(ms_pilot_run *p, const ms_trial *of, int64_t n, double *error,
                                  double *step_cost, msim_error *err) {
  const double halving = ldexp(1, of->order), t = 2 * (double)n * of->h;
  double distance[2] = {INFINITY, INFINITY};
  msim_status status = MSIM_OK;
  for (int halved = 0; halved < 2 && !status; halved++) {
    const int64_t steps = halved ? 2 * n : n;
    const double before = p->cost;
    msim_sim *sim;
    status = ms_pilot_run_create_sim(p, of->method, 0, halved ? of->h / 2 : of->h, &sim, err);
    if (status) return status;
    status = run_from_start(p, sim, steps, halved ? distance : NULL, err);
    if (!halved) *step_cost = (p->cost - before) / (2 * (double)n);
    msim_sim_destroy(sim);
  }
  const double power = fmax(1, log2(distance[1] / fmax(distance[0], p->scales.rounding)));
  *error = halving / (halving - 1) * distance[1] * pow(p->span / t, power);
  if (status || !(*error < INFINITY)) *error = INFINITY;
  return status == MSIM_ERR_MEMORY ? status : MSIM_OK;
}

/* Halve steps until their error is tol, as predicted by order 2. */
msim_status ms_multirate_trial_make(ms_pilot_run *p, double least, ms_candidate *c,
                                    msim_error *err) {
  double cost;
  int64_t n = 0;
  c->rejection = p->sim->scene->angles.n ? MS_REASON_ANGLES : MS_REASON_STIFF_SPRINGS_NOT_FEW;
  if (c->rejection == MS_REASON_ANGLES || p->planes_count || !p->many) return MSIM_OK;
  msim_status status = find_cheapest_step(p, &n, &cost, err);
  for (int tries = 0; tries < 3 && !status && !c->tried && cost < WORTH * least; tries++) {
    c->h = step_of(p, n);
    const ms_trial steps = {.method = c->method,
                            .collision = MSIM_COLLISION_REFLECT,
                            .order = c->method->entry.order,
                            .h = c->h};
    status = try_from_start(p, &steps, n, &c->error, &c->step_cost, err);
    c->error *= CARE;
    c->tried = c->error <= p->tol;
    c->rejection = c->tried ? MS_REASON_NONE : MS_REASON_ERROR_TOO_LARGE;
    if (c->tried) c->cost_rate = c->step_cost / c->h;
    const double halvings = fmax(1, ceil(log2(c->error / p->tol) / steps.order));
    const int64_t factor = (int64_t)1 << (int)fmin(halvings, 30);
    n *= factor, cost *= (double)factor;
  }
  return status;
}
