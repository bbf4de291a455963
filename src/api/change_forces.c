/* change_forces - change gravity, drag or the constant forces of a running sim: a new run starts
 * from the present state */
#include "physics/energy.h"
#include "sim/sim.h"
#include "sim/rank_sim.h"

typedef msim_status set_in_scene(msim_scene *scene, const double *values, msim_error *err);

/* The change of total energy (J) in this state from the forces of one scene to those of another:
 * only the potential energy differs. */
static double energy_difference(const ms_scene *from, const ms_scene *to, const msim_state *now) {
  msim_energy before = {.size = sizeof before}, after = before;
  ms_energy_compute(from, now->x, now->v, &before);
  ms_energy_compute(to, now->x, now->v, &after);
  return after.gravitational - before.gravitational;
}

/* What depends on forces and is not part of a state: matrices, stability bounds, and the two models
 * of respa */
static void invalidate_force_data(msim_sim *sim) {
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    if (m->stepper.solver) ms_solver_update_springs(m->stepper.solver);
  ms_sim_set_bounds(sim);
  if (sim->config.integrator->is_multirate) sim->config.choice.out_of_date = 1;
}

/* Replace the forces on all ranks, or on none. */
static msim_status replace_forces(msim_sim *sim, ms_scene *scene, msim_error *err) {
  ms_scene *before = sim->scene;
  msim_status status = ms_ranks_agree(sim->ranks, ms_sim_replace_forces(sim, scene, err), err);
  if (!status) status = ms_rank_sim_compare(sim, err);
  if (status) ms_sim_replace_forces(sim, before, NULL);
  return status;
}

/* Start a run in the state `now` with the forces of this scene. On failure the sim stays as it was,
 * with its old scene. */
static msim_status restart_with_scene(msim_sim *sim, ms_scene *scene, msim_state *now,
                                      msim_error *err) {
  const ms_config config = sim->config;
  const ms_run_state run = sim->run;
  ms_scene *before = sim->scene;
  now->work += energy_difference(before, scene, now);
  msim_status status = replace_forces(sim, scene, err);
  if (status) return status;
  if (!ms_sim_selects(sim)) status = ms_sim_check_method_forces(sim, scene->damping, err);
  if (!status) {
    ms_sim_subtract_steps_made(sim);
    invalidate_force_data(sim);
    status = msim_sim_set_state(sim, now, err);
  }
  if (!status) return MSIM_OK;
  ms_sim_replace_forces(sim, before, NULL);
  sim->config = config, sim->run = run;
  invalidate_force_data(sim);
  sim->config.choice.out_of_date = config.choice.out_of_date;
  return status;
}

static msim_status change_forces(msim_sim *sim, set_in_scene *set, const double *values,
                                 msim_error *err) {
  const msim_status gathered = ms_sim_provide_arrays(sim, err);
  if (gathered) return gathered;
  msim_scene handle = {.data = ms_scene_retain(sim->scene)}; /* shared: the setter makes a copy */
  ms_scene *before = sim->scene;
  msim_state now = {.size = sizeof now};
  msim_status status = ms_ranks_agree(sim->ranks, set(&handle, values, err), err);
  if (!status) status = ms_ranks_agree(sim->ranks, msim_sim_state(sim, &now), err);
  if (!status) {
    ms_sim_free_matrix(sim); /* its model refers to the old scene */
    status = restart_with_scene(sim, handle.data, &now, err);
  }
  if (status) {
    ms_scene_release(handle.data);
    return status;
  }
  ms_sim_set_created_scene(sim, before);
  ms_scene_release(before);
  return ms_error_clear(err);
}

static msim_status set_drag(msim_scene *scene, const double *drag, msim_error *err) {
  return msim_scene_set_drag(scene, *drag, err);
}

msim_status msim_sim_set_gravity(msim_sim *sim, const double gravity[3], msim_error *err) {
  if (!sim) return ms_error_set(err, MSIM_ERR_ARG, "sim is NULL");
  return change_forces(sim, msim_scene_set_gravity, gravity, err);
}

msim_status msim_sim_set_drag(msim_sim *sim, double drag, msim_error *err) {
  if (!sim) return ms_error_set(err, MSIM_ERR_ARG, "sim is NULL");
  return change_forces(sim, set_drag, &drag, err);
}

msim_status msim_sim_set_forces(msim_sim *sim, const double *force, msim_error *err) {
  if (!sim) return ms_error_set(err, MSIM_ERR_ARG, "sim is NULL");
  return change_forces(sim, msim_scene_set_forces, force, err);
}
