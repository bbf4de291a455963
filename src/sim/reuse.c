#include "sim/reuse.h"

#include "physics/force_function.h"
#include "physics/law_springs.h"
#include "scene/laws.h"

enum { NONE = -1 };

/*------------------------------------- creation -------------------------------------------------*/

/* Solvers chosen for other springs, or before springs broke, splits of springs, the surface of
 * self-contact and the islands of `auto`, which chooses its method anew, are made anew. */
static int may_reuse(const msim_sim *sim) {
  const ms_scene *s = sim->scene;
  for (int32_t e = 0; e < s->nsprings && s->broken; e++)
    if (s->broken[e] == MS_BROKEN) return 0;
  return !sim->chosen_for && !sim->config.integrator->is_multirate && !ms_sim_selects(sim) &&
         sim->stats.fallbacks == 0 && !ms_scene_has_self_contact(s);
}

msim_status ms_reuse_create(const msim_sim *sim, const ms_edit_map *map, const ms_scene *edited,
                            ms_island_reuse *reuse, msim_error *err) {
  *reuse = (ms_island_reuse){.map = map};
  if (!MS_NEW(&sim->alloc, reuse->island, edited->nparticles) ||
      (edited->nmotions && !MS_NEW(&sim->alloc, reuse->mover, edited->nparticles)))
    return ms_error_set_memory(err, "the islands of the scene");
  for (int32_t m = 0; m < edited->nmotions; m++)
    for (int32_t i = 0; i < edited->motions[m].n; i++)
      reuse->mover[edited->motions[m].particles[i]] = (ms_moving_row){.motion = m, .i = i};
  for (int32_t p = 0; p < edited->nparticles; p++) reuse->island[p] = NONE;
  for (int32_t i = 0; i < sim->nislands && may_reuse(sim); i++) {
    const ms_unknowns *rows = &sim->islands[i].model.unknowns;
    for (int32_t r = 0; r < rows->nfree; r++) {
      const int32_t now = map->particle[rows->particle[r]];
      if (now >= 0) reuse->island[now] = i;
    }
  }
  return MSIM_OK;
}

void ms_reuse_destroy(const msim_sim *sim, ms_island_reuse *reuse) {
  MS_FREE(&sim->alloc, reuse->island, reuse->mover);
}

/*------------------------------------- comparison -----------------------------------------------*/

/* The old island that has exactly these particles and springs; NONE */
static int32_t find_old_island(const ms_island_reuse *reuse, const ms_island *island) {
  const int32_t old = island->nfree > 0 ? reuse->island[island->free[0]] : NONE;
  if (old == NONE) return NONE;
  const ms_model *model = &reuse->old->islands[old].model;
  if (model->unknowns.nfree != island->nfree || model->springs.n != island->nsprings ||
      model->angles.n != island->nangles)
    return NONE;
  for (int32_t i = 0; i < island->nfree; i++)
    if (reuse->island[island->free[i]] != old) return NONE;
  for (int32_t e = 0; e < island->nsprings; e++)
    if (island->spring[e] >= reuse->map->kept_springs) return NONE;
  for (int32_t e = 0; e < island->nangles; e++)
    if (island->angle[e] >= reuse->map->kept_angles) return NONE;
  return old;
}

int ms_reuse_island(const msim_sim *sim, const ms_island *island, int32_t left_out,
                    ms_island_sim *m) {
  const int32_t old = sim->reuse ? find_old_island(sim->reuse, island) : NONE;
  if (old == NONE) return 0;
  const ms_island_sim *from = &sim->reuse->old->islands[old];
  const ms_solver *solver = from->stepper.solver;
  const ms_model *model = &from->model;
  if (from->stepper.events && ms_collider_motion_is_there(sim->scene)) return 0;
  if (model->unknowns.dropped_axis != left_out) return 0;
  if (solver && solver->creation_h != sim->run.h) return 0;
  *m = *from;
  m->is_reused = 1 + old;
  return 1;
}

/*------------------------------------- move -----------------------------------------------------*/

void ms_reuse_renumber(ms_model *model, const ms_scene *scene, const ms_edit_map *map) {
  int32_t *particle = model->unknowns.particle, *spring = model->springs.number;
  for (int32_t r = 0; r < model->unknowns.stride; r++)
    if (particle[r] >= 0) particle[r] = map->particle[particle[r]];
  for (int32_t e = 0; e < model->springs.n && spring; e++) spring[e] = map->spring[spring[e]];
  for (int32_t e = 0; e < model->angles.n; e++)
    model->angles.angle[e] = map->angle[model->angles.angle[e]];
  for (int32_t i = 0; model->function && i < model->function->n; i++)
    model->function->particle[i] = map->particle[model->function->particle[i]];
  model->scene = scene;
  if (model->laws) ms_law_springs_update(model);
}

void ms_reuse_finish(msim_sim *sim) {
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    if (!m->is_reused) continue;
    sim->reuse->old->islands[m->is_reused - 1] = (ms_island_sim){0};
    m->is_reused = 0;
    ms_reuse_renumber(&m->model, sim->scene, sim->reuse->map);
    if (m->model.pins) ms_moving_pins_renumber(&m->model, sim->reuse->mover);
    m->stepper.model = &m->model;
    m->stepper.stats = m->single_thread ? &m->stats : &sim->stats;
    if (m->stepper.solver) ms_solver_set_model(m->stepper.solver, &m->model);
  }
}
