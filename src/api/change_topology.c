/* change_topology - remove and add particles and springs of a running sim: a new run starts from
 * the present state */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/energy.h"
#include "scene/angles.h"
#include "sim/reuse.h"
#include "sim/rank_sim.h"

/* A change of the present scene of a sim, and the state that it leads to */
typedef struct change {
  msim_edit edit;
  ms_edit_map map;
  ms_scene *scene;           /* the edited one */
  double *x, *v;             /* 3n, of its particles */
  double *rest, *angle_rest; /* lengths and angles of added springs; NULL: they are given */
  ms_island_reuse reuse;
} change;

static void free_change(const msim_sim *sim, change *c) {
  MS_FREE(&sim->alloc, c->x, c->v, c->rest, c->angle_rest);
  ms_edit_map_destroy(sim->scene, &c->map);
  ms_reuse_destroy(sim, &c->reuse);
  ms_scene_release(c->scene);
}

/*------------------------------------- the new state --------------------------------------------*/

static const double *position_of(const change *c, const msim_state *now, int32_t p) {
  return p < now->n ? now->x + 3 * (size_t)p : c->edit.x + 3 * (size_t)(p - now->n);
}

/* The particles that springs to add may have */
static int64_t count_particles(const change *c, const msim_state *now) {
  return c->edit.x ? (int64_t)now->n + c->edit.nparticles : now->n;
}

/* The present lengths of the springs to add: rest lengths that the caller has not given. Indices
 * out of range are refused later. */
static msim_status measure_rest(const msim_sim *sim, const msim_state *now, change *c,
                                msim_error *err) {
  const int64_t n = count_particles(c, now);
  if (c->edit.rest || !c->edit.ij || c->edit.nsprings <= 0) return MSIM_OK;
  if (!MS_NEW(&sim->alloc, c->rest, c->edit.nsprings)) return ms_error_set_memory(err, "an edit");
  for (int32_t e = 0; e < c->edit.nsprings; e++) {
    const int32_t *ij = c->edit.ij + 2 * (size_t)e;
    if (ij[0] < 0 || ij[0] >= n || ij[1] < 0 || ij[1] >= n) continue;
    const double *a = position_of(c, now, ij[0]), *b = position_of(c, now, ij[1]);
    const double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    c->rest[e] = ms_vec3_norm(d);
  }
  c->edit.rest = c->rest;
  return MSIM_OK;
}

/* The same of angular springs */
static msim_status measure_angles(const msim_sim *sim, const msim_state *now, change *c,
                                  msim_error *err) {
  const int64_t n = count_particles(c, now);
  if (c->edit.angle_rest || !c->edit.ijk || c->edit.nangles <= 0) return MSIM_OK;
  if (!MS_NEW(&sim->alloc, c->angle_rest, c->edit.nangles))
    return ms_error_set_memory(err, "an edit");
  for (int32_t e = 0; e < c->edit.nangles; e++) {
    const int32_t *ijk = c->edit.ijk + 3 * (size_t)e;
    const double *at[3];
    int valid = 1;
    for (int q = 0; q < 3; q++) valid &= ijk[q] >= 0 && ijk[q] < n;
    for (int q = 0; q < 3 && valid; q++) at[q] = position_of(c, now, ijk[q]);
    if (valid) c->angle_rest[e] = ms_scene_angles_measure((const double *const *)at);
    if (isnan(c->angle_rest[e]))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "the angle of angles.ijk[%d] is not defined, as an edge has no length; "
                          "specify angle_rest or move its particles",
                          e);
  }
  c->edit.angle_rest = c->angle_rest;
  return MSIM_OK;
}

/* Particles that stay keep their state; those that are added have that of the edited scene. */
static msim_status make_state(const msim_sim *sim, const msim_state *now, change *c,
                              msim_error *err) {
  const size_t n = 3 * (size_t)c->scene->nparticles, bytes = n * sizeof(double);
  if (!MS_NEW(&sim->alloc, c->x, n) || !MS_NEW(&sim->alloc, c->v, n))
    return ms_error_set_memory(err, "the state");
  memcpy(c->x, c->scene->x, bytes);
  memcpy(c->v, c->scene->v, bytes);
  for (size_t p = 0; p < (size_t)now->n; p++) {
    if (c->map.particle[p] < 0) continue;
    const size_t to = 3 * (size_t)c->map.particle[p];
    memcpy(c->x + to, now->x + 3 * p, 3 * sizeof *c->x);
    memcpy(c->v + to, now->v + 3 * p, 3 * sizeof *c->v);
  }
  return MSIM_OK;
}

static msim_status make_change(msim_sim *sim, const msim_edit *edit, const msim_state *now,
                               change *c, msim_error *err) {
  msim_status status = ms_edit_read(edit, &c->edit, err);
  if (!status) status = measure_rest(sim, now, c, err);
  if (!status) status = measure_angles(sim, now, c, err);
  if (!status) status = ms_edit_map_create(sim->scene, &c->edit, &c->map, err);
  if (!status) status = ms_edit_copy(sim->scene, &c->edit, &c->map, &c->scene, err);
  if (status) return status;
  if (c->scene->nparticles == 0)
    return ms_error_set(err, MSIM_ERR_ARG, "the edit removes all particles; keep or add one");
  status = make_state(sim, now, c, err);
  return status ? status : ms_reuse_create(sim, &c->map, c->scene, &c->reuse, err);
}

/*------------------------------------- restart --------------------------------------------------*/

/* Start a run of the edited scene in its state; on failure the sim keeps its scene and run. */
static msim_status restart(msim_sim *sim, const msim_state *now, change *c, msim_error *err) {
  const ms_config config = sim->config;
  const ms_run_state run = sim->run;
  ms_scene *before = sim->scene;
  msim_state to = *now;
  to.n = c->scene->nparticles, to.x = c->x, to.v = c->v, to.v_half = NULL;
  to.work += ms_energy_total(c->scene, to.x, to.v) - ms_energy_total(before, now->x, now->v);
  msim_status status = ms_sim_reserve_state(sim, to.n, err);
  if (status) return status;
  ms_sim_free_matrix(sim); /* its model refers to the old scene */
  sim->scene = c->scene, sim->reuse = &c->reuse;
  if (!ms_sim_selects(sim)) status = ms_sim_check_method_forces(sim, c->scene->damping, err);
  if (!status) {
    ms_sim_subtract_steps_made(sim);
    sim->config.choice.out_of_date = 1; /* other unknowns */
    status = msim_sim_set_state(sim, &to, err);
  }
  sim->reuse = NULL;
  if (status) sim->scene = before, sim->config = config, sim->run = run;
  else c->scene = before;
  return status;
}

msim_status msim_sim_edit(msim_sim *sim, const msim_edit *edit, msim_error *err) {
  if (!sim || !edit) return ms_error_set(err, MSIM_ERR_ARG, "sim or edit is NULL");
  const msim_status refused = ms_rank_sim_refuse(sim, "msim_sim_edit", err);
  if (refused) return refused;
  msim_state now = {.size = sizeof now};
  change c = {.rest = NULL};
  msim_sim_state(sim, &now);
  msim_status status = make_change(sim, edit, &now, &c, err);
  if (!status) status = restart(sim, &now, &c, err);
  if (!status && !sim->edited_from) ms_sim_set_edited_from(sim, ms_scene_retain(c.scene));
  if (!status) sim->edits++;
  free_change(sim, &c);
  return status ? status : ms_error_clear(err);
}
