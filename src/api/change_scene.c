#include "api/change_scene.h"

#include <string.h>

#include "contact/contact_set.h"
#include "physics/energy.h"
#include "physics/law_springs.h"
#include "physics/moving_pins.h"
#include "sim/rank_sim.h"

/* What an island has of the motions of a scene */
typedef struct island_motions {
  ms_moving_pins *pins;
  ms_obstacles near; /* where impacts are located */
} island_motions;

/* of: for each island those of `scene`; what was made before a failure stays in them. */
static msim_status create_motions(const msim_sim *sim, const ms_scene *scene, island_motions *of,
                                  msim_error *err) {
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < sim->nislands && !status; i++) {
    ms_model model = sim->islands[i].model;
    model.scene = scene;
    status = ms_moving_pins_create(&model, &of[i].pins, err);
    if (!status && sim->islands[i].stepper.events && !ms_obstacles_create(scene, &of[i].near))
      status = ms_error_set_memory(err, "the contact set");
  }
  return status;
}

/* Exchange the motions of all islands, and let them refer to this scene. */
static void exchange_motions(msim_sim *sim, const ms_scene *scene, island_motions *of) {
  for (int32_t i = 0; i < sim->nislands; i++) {
    ms_model *model = &sim->islands[i].model;
    ms_contact_set *events = sim->islands[i].stepper.events;
    const island_motions old = {model->pins, events ? events->near : (ms_obstacles){0}};
    model->pins = of[i].pins;
    if (events) events->near = of[i].near;
    of[i] = old;
    model->scene = scene;
    if (model->laws) ms_law_springs_update(model);
  }
}

/* Start a run in a state with motions of the same pins: no unknown changes, and so the islands
 * stay, with their analyses. */
static msim_status start_with_motions(msim_sim *sim, const ms_scene *before, const msim_state *to,
                                      msim_error *err) {
  const int32_t n = sim->nislands;
  island_motions *of;
  msim_status status = MS_NEW(&sim->alloc, of, n) ? create_motions(sim, sim->scene, of, err)
                                                  : ms_error_set_memory(err, "the motions");
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status) {
    exchange_motions(sim, sim->scene, of);
    status = msim_sim_set_state(sim, to, err);
    if (status) exchange_motions(sim, before, of);
  }
  for (int32_t i = 0; i < n && of; i++) {
    ms_moving_pins_destroy(before, of[i].pins);
    ms_obstacles_destroy(before, &of[i].near);
  }
  ms_memory_free(&sim->alloc, of);
  return status;
}

/* Start a run in a state with other pins: other unknowns, which ranks divide anew. */
static msim_status start_with_pins(msim_sim *sim, const msim_state *to, msim_error *err) {
  ms_rank_part *old = sim->part;
  msim_status status = MSIM_OK;
  sim->config.choice.out_of_date = 1;
  if (old) {
    status = ms_rank_part_create(sim->scene, sim->ranks, &sim->part, err);
    if (!status) status = ms_rank_sim_check(sim, err);
    status = ms_ranks_agree(sim->ranks, status, err);
  }
  if (!status) status = msim_sim_set_state(sim, to, err);
  if (old) ms_rank_part_destroy(&sim->alloc, status ? sim->part : old);
  if (status) sim->part = old;
  return status;
}

/* Start a run with this scene in the state of x and v, which get the velocities of motions, and
 * release the scene or the one before. The change of energy is work. moves: only motions differ. */
static msim_status restart(msim_sim *sim, ms_scene *scene, int moves, double *x, double *v,
                           msim_error *err) {
  msim_state to = {.size = sizeof to};
  msim_sim_state(sim, &to);
  const double energy = ms_energy_total(sim->scene, to.x, to.v);
  ms_moving_pins_set_arrays(scene, (ms_instant){.t = to.t}, x, v);
  to.x = x, to.v = v, to.v_half = NULL;
  const ms_config config = sim->config;
  const ms_run_state run = sim->run;
  ms_scene *before = sim->scene;
  ms_sim_free_matrix(sim); /* its model refers to the old scene */
  sim->scene = scene;
  to.work += ms_energy_total(scene, to.x, to.v) - energy;
  msim_status status = ms_rank_sim_compare(sim, err);
  if (!status) status = ms_sim_check_motions(sim, err);
  if (!status) {
    ms_sim_subtract_steps_made(sim);
    status = moves ? start_with_motions(sim, before, &to, err) : start_with_pins(sim, &to, err);
  }
  if (status) {
    sim->scene = before, sim->config = config, sim->run = run;
    ms_scene_release(scene);
    return status;
  }
  ms_sim_set_created_scene(sim, before);
  ms_scene_release(before);
  return ms_error_clear(err);
}

/* Change a copy of the sim's scene and its state. x: room for both its arrays; NULL: no memory.
 * After an error the copy may be there, and must be released. */
static msim_status change_copy(msim_sim *sim, ms_scene_change *change, const void *data,
                               msim_scene *copy, double *x, msim_error *err) {
  msim_state now = {.size = sizeof now};
  const msim_status status = msim_sim_state(sim, &now);
  if (status) return status;
  if (!x) return ms_error_set_memory(err, "the state");
  const size_t count = 3 * (size_t)now.n;
  memcpy(x, now.x, count * sizeof *x);
  memcpy(x + count, now.v, count * sizeof *x);
  copy->data = ms_scene_retain(sim->scene);
  if (!ms_scene_make_writable(copy, err)) return MSIM_ERR_MEMORY;
  return change(copy, data, x, x + count, err);
}

msim_status ms_change_scene(msim_sim *sim, ms_scene_change *change, const void *data, int moves,
                            msim_error *err) {
  msim_status status = ms_sim_provide_arrays(sim, err);
  if (status) return status;
  const size_t count = 3 * (size_t)sim->scene->nparticles;
  double *x = ms_memory_allocate(&sim->alloc, 2 * count, sizeof *x);
  msim_scene copy = {.data = NULL};
  status = change_copy(sim, change, data, &copy, x, err);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status) status = restart(sim, copy.data, moves, x, x + count, err);
  else if (copy.data) ms_scene_release(copy.data);
  ms_memory_free(&sim->alloc, x);
  return status;
}
