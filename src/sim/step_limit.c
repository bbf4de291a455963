#include "sim/step_limit.h"

#include <math.h>

#include "sim/rank_scene.h"

/* Rough bounds of the whole scene: the largest of the particles of each part, which has all springs
 * of own particles, and of ghosts some, which bound less */
static msim_status compute_bounds_of_parts(msim_sim *sim, ms_bounds *b, msim_error *err) {
  const msim_status status =
      ms_ranks_agree(sim->ranks, ms_bounds_compute(sim->scene, 0, b, err), err);
  if (status) return status;
  double most[] = {b->omega, b->rate, b->ratio, -b->least_rate};
  ms_ranks_maximum(sim->ranks, 4, most);
  *b = (ms_bounds){.omega = most[0], .rate = most[1], .ratio = most[2], .least_rate = -most[3]};
  return ms_ranks_agree(sim->ranks, MSIM_OK, err);
}

static msim_status compute_tight_bounds(const ms_scene *scene, void *bounds, msim_error *err) {
  return ms_bounds_compute(scene, 1, bounds, err);
}

/* Computed once, rough and tight each, until the springs change. Collective, if ranks have parts */
static msim_status compute_bounds(msim_sim *sim, int tight, msim_error *err) {
  ms_step_limit *a = &sim->config.step_limit;
  msim_status status;
  if (a->tightness > tight) return MSIM_OK;
  if (!sim->kept) status = ms_bounds_compute(sim->scene, tight, &a->bounds, err);
  else if (!tight) status = compute_bounds_of_parts(sim, &a->bounds, err);
  else status = ms_rank_scene_compute(sim, compute_tight_bounds, sizeof a->bounds, &a->bounds, err);
  if (status) return status;
  a->limit = sim->config.integrator->limit ? sim->config.integrator->limit(&a->bounds) : INFINITY;
  a->tightness = 1 + tight;
  return MSIM_OK;
}

msim_status ms_step_limit_compute(msim_sim *sim, msim_error *err) {
  return compute_bounds(sim, 1, err);
}

static msim_status resolve_auto_h(msim_sim *sim, double *h, msim_error *err) {
  const char *name = sim->config.integrator->entry.name;
  if (!sim->config.integrator->limit)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "h is 'auto', but %s has no stability limit that h could follow from; set "
                        "h, as short as accuracy requires",
                        name);
  msim_status status = compute_bounds(sim, 1, err);
  if (status) return status;
  const double limit = sim->config.step_limit.limit;
  if (ms_step_limit_is_beyond_range(&sim->config.step_limit))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "h is 'auto', but springs vibrate faster than double precision can say; "
                        "use smaller k, or larger masses");
  if (limit == 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "h is 'auto', but undamped vibrations grow with %s at any h; use "
                        "velocity-verlet or an implicit integrator",
                        name);
  if (isinf(limit))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "h is 'auto', but nothing vibrates in this scene, so that no stability "
                        "limit exists; set h");
  *h = MS_STABLE_FRACTION * limit;
  return MSIM_OK;
}

msim_status ms_step_limit_resolve_auto(msim_sim *sim, double *h, msim_error *err) {
  const int chosen = *h == MSIM_H_AUTO;
  msim_status status = chosen ? resolve_auto_h(sim, h, err) : MSIM_OK;
  if (!status) sim->config.step_limit.from_auto = chosen;
  return status;
}

static void warn_long_step(const msim_sim *sim) {
  const char *name = sim->config.integrator->entry.name;
  const double h = sim->run.h, limit = sim->config.step_limit.limit;
  if (ms_step_limit_is_beyond_range(&sim->config.step_limit))
    ms_sim_warn(sim,
                "springs vibrate faster than double precision can say: no step of %s is short "
                "enough; use smaller k, or larger masses",
                name);
  else if (limit > 0)
    ms_sim_warn(sim,
                "h = %.6g s exceeds the stability limit of %s in this scene, %.6g s: the run may "
                "become unstable; use h = %.3g or an implicit integrator",
                h, name, limit, MS_STABLE_FRACTION * limit);
  else
    ms_sim_warn(sim,
                "h = %.6g s: with %s undamped vibrations grow at any h; use velocity-verlet or an "
                "implicit integrator",
                h, name);
}

/* 1: there is a warning, on any of the ranks that have parts. */
static int is_wanted(const msim_sim *sim) {
  double wanted = sim->config.opt.warn != NULL;
  if (sim->kept) ms_ranks_maximum(sim->ranks, 1, &wanted);
  return wanted > 0;
}

/* Rough bounds are mostly sufficient. Error control shortens steps that are too long by itself. */
void ms_step_limit_warn(msim_sim *sim) {
  ms_step_limit *a = &sim->config.step_limit;
  if (ms_sim_has_control(sim) || !sim->config.integrator->limit) return;
  if (!is_wanted(sim) || compute_bounds(sim, 0, NULL)) return;
  if (a->limit > 0 && sim->run.h > a->limit && compute_bounds(sim, 1, NULL)) return;
  const int too_long = sim->run.h > a->limit;
  if (too_long && !a->warned) warn_long_step(sim);
  a->warned = too_long;
}
