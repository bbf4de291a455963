/* change - change the step or the springs of a running sim: matrices get new values in old
 * patterns */
#include <math.h>
#include <string.h>

#include "linear/solver_choice.h"
#include "physics/single.h"
#include "sim/breaking.h"
#include "sim/step_driver.h"
#include "sim/rank_sim.h"

msim_status msim_sim_set_step(msim_sim *sim, double h, msim_error *err) {
  if (!sim) return ms_error_set(err, MSIM_ERR_ARG, "sim is NULL");
  if (!(h == MSIM_H_AUTO || (isfinite(h) && h > 0)))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "h is %g; it must be a finite number > 0, or MSIM_H_AUTO", h);
  if (ms_sim_selects(sim) && h != MSIM_H_AUTO)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "integrator 'auto' chooses h itself; name an integrator to set h");
  if (ms_sim_has_control(sim) || ms_sim_selects(sim)) {
    if (h == MSIM_H_AUTO) return ms_error_clear(err); /* h is automatic already */
    sim->config.opt.h = h;
    ms_step_driver_set_step(sim, h);
    return ms_error_clear(err);
  }
  const ms_config config = sim->config;
  const ms_run_state run = sim->run;
  msim_state now = {.size = sizeof now};
  msim_status status = ms_sim_provide_arrays(sim, err);
  if (!status) status = ms_step_limit_resolve_auto(sim, &h, err);
  if (!status) status = ms_ranks_agree(sim->ranks, msim_sim_state(sim, &now), err);
  if (status) return status;
  now.v_half = NULL; /* v(t - h/2) with the old h */
  sim->config.opt.h = h;
  ms_sim_subtract_steps_made(sim);
  status = msim_sim_set_state(sim, &now, err);
  if (status) sim->config = config, sim->run = run;
  return status;
}

static msim_status check_values(const char *what, int32_t n, const double *values,
                                msim_error *err) {
  for (int32_t e = 0; values && e < n; e++)
    if (!(isfinite(values[e]) && values[e] >= 0))
      return ms_error_set(err, MSIM_ERR_ARG, "%s[%d] is %g; it must be a finite number >= 0", what,
                          e, values[e]);
  return MSIM_OK;
}

/* 1: these springs turn the island's matrix into a scalar one (identical for each component) or
 * back. */
static int changes_matrix_kind(const msim_sim *sim, const ms_island_sim *m, const double *rest,
                               const double *damping) {
  const ms_springs *s = &m->model.springs;
  const ms_solver *solver = m->stepper.solver;
  int is_scalar = !(sim->config.opt.skip_off & MSIM_SKIP_ZERO_REST_LENGTH) && !m->model.angles.n &&
                  !ms_scene_has_function(sim->scene);
  for (int32_t i = 0; i < s->n; i++) {
    const int32_t e = ms_springs_number(s, i);
    is_scalar &= ms_spring_is_linear(sim->scene, e, (rest ? rest : sim->scene->rest)[e],
                                     (damping ? damping : sim->scene->damping)[e]);
  }
  return solver && is_scalar != (solver->system.a.block == 1);
}

/* Write the springs to a copy of the scene that belongs to this sim alone. */
static msim_status replace_spring_values(msim_sim *sim, const double *k, const double *rest,
                                         const double *damping, msim_error *err) {
  msim_scene handle = {.data = sim->scene};
  const msim_status status = ms_sim_reserve_springs(sim, err);
  ms_scene *scene = status ? NULL : ms_scene_make_writable(&handle, err);
  if (!scene) return MSIM_ERR_MEMORY;
  const size_t bytes = (size_t)scene->nsprings * sizeof(double);
  if (k) memcpy(scene->k, k, bytes);
  if (rest) memcpy(scene->rest, rest, bytes);
  if (damping) memcpy(scene->damping, damping, bytes);
  ms_sim_replace_scene(sim, scene);
  ms_sim_set_bounds(sim);
  return MSIM_OK;
}

/* Replace the solvers of all islands; on failure all old ones stay. */
static msim_status replace_solvers(msim_sim *sim, msim_error *err) {
  ms_solver **fresh = ms_memory_allocate(&sim->alloc, (size_t)sim->nislands, sizeof *fresh);
  if (!fresh) return ms_error_set_memory(err, "the linear solvers");
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < sim->nislands && !status; i++) {
    const ms_island_sim *m = &sim->islands[i];
    const double h = m->stepper.solver->creation_h;
    status = ms_sim_create_solver(sim, m, h, &fresh[i], err);
  }
  for (int32_t i = 0; i < sim->nislands; i++) {
    ms_solver **used = &sim->islands[i].stepper.solver;
    ms_solver_destroy(status ? fresh[i] : *used);
    if (!status) *used = fresh[i];
  }
  ms_memory_free(&sim->alloc, fresh);
  if (status) return status;
  ms_sim_set_solver_scene(sim, NULL);
  ms_breaking_set_before(sim->scene);
  return MSIM_OK;
}

static void restore_scene(msim_sim *sim, ms_scene *before) {
  ms_scene_release(sim->scene);
  ms_sim_replace_scene(sim, before);
  ms_sim_set_bounds(sim);
}

/* Invalidate what depends on the springs: accelerations, matrices, rest, the history of errors. */
static void invalidate_spring_data(msim_sim *sim) {
  for (int32_t i = 0; i < sim->nislands; i++) {
    ms_island_sim *m = &sim->islands[i];
    if (m->stepper.solver) ms_solver_update_springs(m->stepper.solver);
    m->stepper.cached_stage = 0;
    m->at_rest = 0;
  }
  if (ms_sim_has_control(sim)) ms_control_reset(&sim->run.control);
  sim->state_is_current = 0;
}

/* Start a new run with these springs in the present state: auto chooses its method anew, and
 * methods that carry other variables than x and v compute these anew. */
static msim_status restart_with_springs(msim_sim *sim, const double *k, const double *rest,
                                        const double *damping, msim_error *err) {
  ms_scene *before = ms_scene_retain(sim->scene);
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  ms_sim_free_matrix(sim); /* its model refers to the old scene */
  msim_status status = replace_spring_values(sim, k, rest, damping, err);
  if (!status) status = msim_sim_set_state(sim, &now, err);
  if (status) restore_scene(sim, before);
  else ms_scene_release(before);
  return status;
}

/* 1: solvers stay that were chosen for springs which only the present scene has. */
static int must_keep_scene(const msim_sim *sim) {
  const ms_solver *solver = sim->islands->stepper.solver;
  return !sim->chosen_for && solver && ms_solver_choice_depends_on_springs(&sim->config.opt);
}

/* Continue the present run with these springs. */
static msim_status continue_with_springs(msim_sim *sim, const double *k, const double *rest,
                                         const double *damping, msim_error *err) {
  int other = sim->config.integrator
                  ->is_multirate; /* 1: the split into stiff and soft springs may change */
  for (int32_t i = 0; i < sim->nislands && !other; i++)
    other = changes_matrix_kind(sim, &sim->islands[i], rest, damping);
  ms_step_driver_prepare_dense_output(sim); /* with the old springs */
  const int remembers = !other && must_keep_scene(sim);
  ms_scene *before = other || remembers ? ms_scene_retain(sim->scene) : NULL;
  ms_sim_free_matrix(sim); /* its model refers to the old scene */
  msim_status status = replace_spring_values(sim, k, rest, damping, err);
  if (!status && other)
    status = sim->config.integrator->is_multirate ? ms_sim_rebuild_islands(sim, err)
                                                  : replace_solvers(sim, err);
  if (status && other) restore_scene(sim, before);
  else if (!status && remembers) ms_sim_set_solver_scene(sim, before);
  else ms_scene_release(before);
  if (status) return status;
  invalidate_spring_data(sim);
  return MSIM_OK;
}

msim_status msim_sim_set_springs(msim_sim *sim, const double *k, const double *rest,
                                 const double *damping, msim_error *err) {
  if (!sim) return ms_error_set(err, MSIM_ERR_ARG, "sim is NULL");
  const msim_status refused = ms_rank_sim_refuse(sim, "msim_sim_set_springs", err);
  if (refused) return refused;
  const int32_t n = sim->scene->nsprings;
  msim_status status = check_values("k", n, k, err);
  if (!status) status = check_values("rest", n, rest, err);
  if (!status) status = check_values("damping", n, damping, err);
  if (!status && ms_sim_selects(sim)) return restart_with_springs(sim, k, rest, damping, err);
  if (!status && sim->config.opt.precision == MSIM_PRECISION_SINGLE)
    status = ms_single_check_springs(n, k, rest, damping, err);
  if (!status && damping) status = ms_sim_check_method_forces(sim, damping, err);
  if (!status)
    status = sim->config.integrator->convert_state
                 ? restart_with_springs(sim, k, rest, damping, err)
                 : continue_with_springs(sim, k, rest, damping, err);
  if (status) return status;
  sim->config.step_limit.tightness = sim->config.step_limit.from_auto = 0;
  ms_energy_monitor_start(sim);
  ms_error_growth_change_springs(sim);
  ms_step_limit_warn(sim);
  return ms_error_clear(err);
}
