/* clone - a second sim in the state of a sim (msim.h) */
#include "checkpoint/restore.h"
#include "checkpoint/saved_scene.h"
#include "sim/rank_sim.h"

static msim_status clone_sim(msim_sim *sim, msim_sim **copy, msim_error *err) {
  ms_saved_run_prepare_islands(sim);
  const ms_saved_run r = ms_saved_run_collect(sim);
  ms_archive islands;
  ms_scene *chosen_for = NULL;
  msim_status status = ms_saved_run_pack_islands(sim, &r, &islands, err);
  if (status) return status;
  status = ms_sim_create_empty_copy(sim, copy, err);
  if (!status && sim->chosen_for)
    status = ms_saved_scene_copy_springs(sim->chosen_for, sim, &chosen_for, err);
  if (!status) status = ms_restore_copy(*copy, chosen_for, &islands, &r, err);
  ms_scene_release(chosen_for);
  ms_memory_free(&sim->alloc, islands.data);
  return status;
}

msim_status msim_sim_clone(msim_sim *sim, msim_sim **copy, msim_error *err) {
  if (!sim || !copy) return ms_error_set(err, MSIM_ERR_ARG, "sim or copy is NULL");
  const msim_status refused = ms_rank_sim_refuse(sim, "msim_sim_clone", err);
  if (refused) return refused;
  *copy = NULL;
  const msim_status status = clone_sim(sim, copy, err);
  if (!status) return ms_error_clear(err);
  msim_sim_destroy(*copy);
  *copy = NULL;
  return status;
}
