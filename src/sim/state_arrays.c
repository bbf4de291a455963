/* state_arrays - the arrays of the state, in the order of the particles */
#include <string.h>

#include "physics/single.h"
#include "sim/rank_scene.h"

/* At least twice as many as before, so that all older arrays together are shorter. auto may choose
 * a method later that carries v_half. */
msim_status ms_sim_reserve_state(msim_sim *sim, int32_t n, msim_error *err) {
  double **arrays[] = {&sim->state_x, &sim->state_v, &sim->state_v_half};
  const int count = sim->config.integrator->sync || ms_sim_selects(sim) ? 3 : 2;
  const size_t old = 3 * (size_t)sim->state_capacity, size = 3 * (size_t)n;
  ms_retired_state *last = NULL;
  double *fresh[3] = {NULL};
  if (n <= sim->state_capacity) return MSIM_OK;
  int fits = old == 0 || MS_NEW(&sim->alloc, last, 1);
  for (int i = 0; i < count; i++)
    fits = fits && MS_NEW(&sim->alloc, fresh[i], size > 2 * old ? size : 2 * old);
  if (!fits) {
    MS_FREE(&sim->alloc, last, fresh[0], fresh[1], fresh[2]);
    return ms_error_set_memory(err, "the state");
  }
  for (int i = 0; i < count; i++) {
    if (last) memcpy(fresh[i], *arrays[i], old * sizeof *fresh[i]), last->arrays[i] = *arrays[i];
    *arrays[i] = fresh[i];
  }
  if (last) last->next = sim->retired, sim->retired = last;
  sim->state_capacity = size > 2 * old ? n : 2 * sim->state_capacity;
  return MSIM_OK;
}

void ms_sim_start_v_half(msim_sim *sim) {
  const int32_t n = sim->scene->nparticles;
  if (!sim->config.integrator->sync || !sim->state_x) return;
  memcpy(sim->state_v_half, sim->state_v, 3 * (size_t)n * sizeof *sim->state_v);
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    ms_unknowns_scatter(&m->model.unknowns, ms_single_get_v(&m->model, m->stepper.v),
                        sim->state_v_half);
  if (sim->part) ms_rank_part_gather(sim->part, n, sim->state_v_half);
}

/* What no vector has, particles without an island and the axis left out, is as in the scene, as is
 * the state at the start. */
msim_status ms_sim_provide_arrays(msim_sim *sim, msim_error *err) {
  if (!sim->part || sim->state_x) return MSIM_OK;
  msim_status status = ms_rank_scene_gather(sim, err);
  if (status) return status;
  const ms_scene *scene = sim->scene;
  status = ms_ranks_agree(sim->ranks, ms_sim_reserve_state(sim, scene->nparticles, err), err);
  if (!status) {
    memcpy(sim->state_x, scene->x, 3 * (size_t)scene->nparticles * sizeof *scene->x);
    memcpy(sim->state_v, scene->v, 3 * (size_t)scene->nparticles * sizeof *scene->v);
    ms_sim_start_v_half(sim);
  } else ms_sim_free_state(sim);
  return status;
}

void ms_sim_free_state(msim_sim *sim) {
  while (sim->retired) {
    ms_retired_state *last = sim->retired;
    sim->retired = last->next;
    MS_FREE(&sim->alloc, last->arrays[0], last->arrays[1], last->arrays[2], last);
  }
  MS_FREE(&sim->alloc, sim->state_x, sim->state_v, sim->state_v_half);
  sim->state_x = sim->state_v = sim->state_v_half = NULL, sim->state_capacity = 0;
}
