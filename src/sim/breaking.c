#include "sim/breaking.h"

#include <math.h>

#include "contact/contact_set.h"
#include "methods/methods.h"
#include "physics/law_breaking.h"
#include "physics/rank_model.h"
#include "physics/reference.h"
#include "sim/step_driver.h"

/*------------------------------------- creation -------------------------------------------------*/

/* Pilot runs, splits of springs and transformed variables belong to the springs of the start. */
static msim_status check_method(const msim_sim *sim, msim_error *err) {
  const ms_integrator *method = sim->config.integrator;
  if (!ms_sim_selects(sim) && !method->is_multirate && !method->convert_state) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "integrator '%s' does not support springs that break; use dop853, "
                      "velocity-verlet or implicit-midpoint, or laws without break_strain and "
                      "break_force",
                      ms_sim_selects(sim) ? MS_AUTO : method->entry.name);
}

msim_status ms_breaking_prepare(msim_sim *sim, msim_error *err) {
  msim_scene own = {.data = sim->scene};
  if (!ms_scene_breaks(sim->scene)) return MSIM_OK;
  msim_status status = check_method(sim, err);
  if (status) return status;
  if (!ms_scene_make_writable(&own, err)) return MSIM_ERR_MEMORY;
  sim->scene = own.data;
  return ms_scene_prepare_breaking(sim->scene, err);
}

void ms_breaking_set_before(ms_scene *s) {
  for (int32_t e = 0; e < s->nsprings && s->broken; e++)
    if (s->broken[e]) s->broken[e] = MS_BROKEN_BEFORE;
}

/*------------------------------------- a new start ----------------------------------------------*/

/* v: the velocities at t, in particle order, for methods that carry those of another time */
static void restart_island(msim_sim *sim, ms_island_sim *m, const double *v) {
  const ms_integrator *method = sim->config.integrator;
  ms_stepper *s = &m->stepper;
  if (method->sync) ms_unknowns_gather(&m->model.unknowns, v, s->v);
  ms_model_update_springs(&m->model, sim->config.opt.skip_off);
  ms_rank_model_share_features(&m->model);
  ms_stepper_set_bounds(method, s);
  if (s->solver) ms_solver_update_springs(s->solver);
  s->cached_stage = 0;
  ms_contact_set_forget(s->events);
  m->at_rest = 0;
  if (method->start) method->start(s);
  if (ms_sim_has_control(sim))
    ms_norm_measure_scales(&m->model, s->x, s->v, ms_plan_span(&sim->config.plan), &m->norm);
}

/* To be called before springs are marked: what depends on those of the last step */
static msim_state finish_last_step(msim_sim *sim) {
  msim_state now = {.size = sizeof now};
  ms_step_driver_prepare_dense_output(sim);
  msim_sim_state(sim, &now);
  return now;
}

static void restart(msim_sim *sim, const msim_state *now) {
  ms_sim_free_matrix(sim); /* it has values of the springs */
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    restart_island(sim, m, now->v);
  if (ms_sim_has_control(sim)) ms_control_reset(&sim->run.control);
  sim->state_is_current = 0;
  ms_energy_monitor_start(sim);
}

static double measure_energy_below_rest(const ms_scene *s, int32_t spring, const double *x) {
  const ms_section all = ms_section_whole(s);
  return fmax(0, -ms_reference_compute_spring_energy(s, &all, spring, x));
}

void ms_breaking_break(msim_sim *sim, int32_t n, const int32_t *springs) {
  const msim_state now = finish_last_step(sim);
  for (int32_t i = 0; i < n; i++) {
    if (sim->scene->broken[springs[i]]) continue;
    sim->run.work += measure_energy_below_rest(sim->scene, springs[i], now.x);
    sim->scene->broken[springs[i]] = MS_BROKEN;
    sim->stats.broken++;
  }
  restart(sim, &now);
}

/*------------------------------------- after a step ---------------------------------------------*/

static int may_break(const ms_island_sim *m) { return m->model.laws && !m->at_rest; }

/* 1: springs break, on any rank. */
static int finds_breaking_springs(const msim_sim *sim) {
  double n = 0;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    ms_rank_model_refresh(&m->model, m->stepper.x, NULL);
    if (may_break(m)) n += ms_law_breaking_count(&m->model, m->stepper.x);
  }
  ms_ranks_maximum(sim->ranks, 1, &n);
  return n > 0;
}

/* Break the springs that some rank has marked; returns their number. Up to two ranks mark a spring:
 * how many do is a digit in base 4, and 24 of these share a double. */
static int64_t break_marked_springs(ms_scene *s, ms_ranks *ranks) {
  enum { DIGITS = 24, NUMBERS = 64 };
  int64_t broken = 0;
  for (int64_t first = 0; first < s->nsprings; first += DIGITS * NUMBERS) {
    double counts[NUMBERS] = {0};
    const int64_t left = s->nsprings - first, n = left < DIGITS * NUMBERS ? left : DIGITS * NUMBERS;
    uint8_t *at = s->broken + first;
    for (int64_t e = 0; e < n; e++)
      if (at[e] == MS_BREAKING) counts[e / DIGITS] += (double)(UINT64_C(1) << 2 * (e % DIGITS));
    ms_ranks_sum(ranks, NUMBERS, counts);
    for (int64_t e = 0; e < n && !(ranks && ranks->failed); e++)
      if ((uint64_t)counts[e / DIGITS] >> 2 * (e % DIGITS) & 3) at[e] = MS_BROKEN, broken++;
  }
  return broken;
}

/* An energy that is lost is dissipated; one below that at rest, which the scene gains, is work. */
msim_status ms_breaking_follow(msim_sim *sim, msim_error *err) {
  if (!sim->scene->broken || !finds_breaking_springs(sim)) return MSIM_OK;
  const msim_status status = ms_energy_monitor_check(sim, err);
  if (status) return status;
  const msim_state now = finish_last_step(sim);
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    double work =
        may_break(m) ? ms_law_breaking_mark(&m->model, m->stepper.x, sim->scene->broken) : 0;
    ms_ranks_sum(sim->ranks, 1, &work);
    sim->run.work += work;
  }
  sim->stats.broken += break_marked_springs(sim->scene, sim->ranks);
  restart(sim, &now);
  return MSIM_OK;
}
