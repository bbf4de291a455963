#include "physics/model.h"

#include <string.h>

#include "base/isa.h"
#include "base/vec3.h"
#include "layout/planar.h"
#include "layout/spring_values.h"
#include "physics/external_force.h"
#include "physics/force_function.h"
#include "physics/law_springs.h"
#include "physics/moving_pins.h"
#include "physics/rank_model.h"
#include "physics/single.h"
#include "physics/spring_law.h"

static int has_velocity_forces(const ms_scene *s) {
  return ms_external_has_velocity(&s->external) || ms_scene_function_has(s, MSIM_FORCE_VELOCITY);
}

static unsigned find_features(const ms_scene *s, const ms_springs *springs,
                              const ms_angles *angles) {
  unsigned features = 0;
  if (springs->n) features |= MS_HAS_SPRINGS;
  if (angles->n) features |= MS_HAS_SPRINGS | MS_HAS_DIRECTIONS;
  for (int32_t e = 0; e < angles->n; e++)
    if (angles->damping[e] > 0) features |= MS_HAS_DAMPING;
  for (int32_t e = 0; e < springs->n; e++) {
    if (ms_scene_damping(s, ms_springs_number(springs, e)) > 0) features |= MS_HAS_DAMPING;
    if (!ms_scene_is_linear(s, ms_springs_number(springs, e))) features |= MS_HAS_DIRECTIONS;
  }
  if (has_velocity_forces(s)) features |= MS_HAS_DRAG;
  if (ms_scene_has_function(s)) features |= MS_HAS_DIRECTIONS;
  if (s->nplanes || s->ncolliders) features |= MS_HAS_PLANES;
  return features;
}

/* Does a force sweep write added_force? Otherwise that is base_force itself. */
static int has_computed_forces(const ms_model *m) {
  return m->half_edges.nparts > 0 || m->laws || m->angles.n > 0;
}

static msim_status create_laws(ms_model *m, msim_error *err) {
  msim_status status = ms_law_springs_create(m, &m->laws, err);
  if (status) return status;
  if (m->laws) ms_law_springs_update(m);
  if (!has_computed_forces(m) || MS_NEW_VECTORS(m->scene, &m->unknowns, &m->added_force))
    return MSIM_OK;
  return ms_error_set_memory(err, "a copy of the springs");
}

/* Set base_force, and added_force from it. */
static void update_added_force(ms_model *m) {
  m->base_force = m->function ? m->function->force : m->force;
  if (!has_computed_forces(m)) m->added_force = m->base_force;
  else if (m->base_force) ms_vector_copy_all(m->shape, m->base_force, m->added_force);
  else ms_vector_clear_all(m->shape, m->added_force);
}

static void free_added_force(ms_model *m) {
  if (has_computed_forces(m)) ms_memory_free(&m->scene->alloc, m->added_force);
  m->added_force = NULL;
}

static void remove_constant_forces(ms_model *m) {
  ms_memory_free(&m->scene->alloc, m->force);
  m->force = NULL;
  update_added_force(m);
}

/* What all models of an island share */
static msim_status create_shared(const ms_island *island, int32_t left_out, ms_model *model,
                                 msim_error *err) {
  const ms_scene *scene = model->scene;
  ms_unknowns *rows = &model->unknowns;
  msim_status status =
      ms_layout_create(scene, island, rows, &model->springs, &model->half_edges, err);
  if (left_out >= 0) ms_unknowns_drop_axis(rows, left_out);
  if (!status) status = ms_angles_create(scene, island, rows, &model->angles, err);
  if (status) return status;
  const size_t count = (size_t)rows->first_pinned;
  if (!MS_NEW(&scene->alloc, model->mass, count) || !MS_NEW(&scene->alloc, model->inv_mass, count))
    return ms_error_set_memory(err, "the masses");
  for (size_t r = 0; r < count; r++) {
    model->mass[r] = rows->particle[r] < 0 ? 1.0 : scene->mass[rows->particle[r]];
    model->inv_mass[r] = rows->particle[r] < 0 ? 0.0 : 1.0 / model->mass[r]; /* padding rests */
  }
  return MSIM_OK;
}

/* What each model has for itself */
static msim_status complete(ms_model *model, unsigned skip_off, msim_error *err) {
  const ms_scene *scene = model->scene;
  const ms_unknowns *rows = &model->unknowns;
  model->external = scene->external;
  model->isa = ms_isa_choose();
  model->shape = model->state_shape =
      (ms_shape){.n = rows->nfree, .stride = rows->stride, .dims = rows->dims, .isa = model->isa};
  msim_status status = create_laws(model, err);
  if (!status) status = ms_force_function_create(model, &model->function, err);
  if (!status) status = ms_model_update_forces(model, skip_off, err);
  if (!status) status = ms_moving_pins_create(model, &model->pins, err);
  if (status) return status;
  if (scene->ncolliders && !MS_NEW(&scene->alloc, model->moving_solids, scene->ncolliders))
    return ms_error_set_memory(err, "the colliders");
  model->features = find_features(scene, &model->springs, &model->angles) | skip_off;
  return MSIM_OK;
}

msim_status ms_model_create_island(const ms_scene *scene, const ms_island *island, int32_t left_out,
                                   unsigned skip_off, ms_model *model, msim_error *err) {
  *model = (ms_model){.scene = scene};
  if (!MS_NEW(&scene->alloc, model->sharers, 1)) return ms_error_set_memory(err, "an island");
  *model->sharers = 1;
  const msim_status status = create_shared(island, left_out, model, err);
  return status ? status : complete(model, skip_off, err);
}

msim_status ms_model_create_like(const ms_model *other, unsigned skip_off, ms_model *model,
                                 msim_error *err) {
  *model = (ms_model){.scene = other->scene,
                      .unknowns = other->unknowns,
                      .springs = other->springs,
                      .half_edges = other->half_edges,
                      .angles = other->angles,
                      .mass = other->mass,
                      .inv_mass = other->inv_mass,
                      .sharers = other->sharers};
  ++*model->sharers;
  return complete(model, skip_off, err);
}

msim_status ms_model_create(const ms_scene *scene, unsigned skip_off, ms_model *model,
                            msim_error *err) {
  ms_islands islands;
  *model = (ms_model){.scene = scene};
  msim_status status = ms_islands_create(scene, 1, &islands, err);
  if (status) return status;
  const ms_island all = ms_islands_get(&islands, 0);
  status = ms_model_create_island(scene, &all, ms_planar_find_axis(scene, skip_off), skip_off,
                                  model, err);
  ms_islands_destroy(scene, &islands);
  return status;
}

msim_status ms_model_create_subset(const ms_model *whole, const ms_island *springs,
                                   unsigned skip_off, ms_model *part, msim_error *err) {
  const ms_scene *scene = whole->scene;
  ms_adjacency a = {0};
  *part = *whole;
  part->springs = (ms_springs){0};
  part->half_edges = (ms_half_edges){0};
  part->added_force = NULL;
  part->laws = NULL;
  msim_status status = ms_springs_create(scene, springs, &part->unknowns, &part->springs, err);
  if (!status) status = ms_adjacency_create(scene, &part->unknowns, &part->springs, &a, err);
  if (!status)
    status =
        ms_half_edges_create(scene, &part->unknowns, &part->springs, &a, &part->half_edges, err);
  ms_adjacency_destroy(scene, &a);
  if (status) return status;
  status = create_laws(part, err);
  if (status) return status;
  update_added_force(part);
  part->features = find_features(scene, &part->springs, &part->angles) | skip_off;
  return MSIM_OK;
}

void ms_model_destroy_subset(ms_model *part) {
  if (!part->scene) return;
  free_added_force(part);
  ms_half_edges_destroy(part->scene, &part->half_edges);
  ms_springs_destroy(part->scene, &part->springs);
  ms_law_springs_destroy(part->scene, part->laws);
  *part = (ms_model){0};
}

msim_status ms_model_update_forces(ms_model *model, unsigned skip_off, msim_error *err) {
  const ms_scene *s = model->scene;
  if (s->force && !model->force && !MS_NEW_VECTORS(s, &model->unknowns, &model->force))
    return ms_error_set_memory(err, "the forces on particles");
  model->external = s->external;
  model->features &= ~(unsigned)MS_HAS_DRAG | skip_off;
  if (has_velocity_forces(s)) model->features |= MS_HAS_DRAG;
  if (!s->force) {
    remove_constant_forces(model);
    return MSIM_OK;
  }
  ms_unknowns_gather(&model->unknowns, s->force, model->force);
  update_added_force(model);
  return MSIM_OK;
}

double ms_model_force_acceleration(const ms_model *model, int32_t row) {
  double f[3];
  if (!model->force) return 0;
  ms_unknowns_get(&model->unknowns, model->force, row, f);
  return ms_vec3_norm(f) * model->inv_mass[row];
}

void ms_model_keep_springs_only(ms_model *model) {
  model->external = (ms_external){0};
  remove_constant_forces(model);
  model->features &= ~(unsigned)(MS_HAS_DRAG | MS_HAS_PLANES);
}

void ms_model_update_springs(ms_model *model, unsigned skip_off) {
  ms_spring_values_update(model->scene, &model->springs, &model->half_edges);
  if (model->laws) ms_law_springs_update(model);
  ms_single_update_springs(model);
  model->features = find_features(model->scene, &model->springs, &model->angles) | skip_off;
}

void ms_model_destroy(ms_model *model) {
  if (!model->scene) return;
  const ms_scene *scene = model->scene;
  free_added_force(model);
  ms_rank_model_destroy(scene, model->rank_model);
  ms_single_destroy(scene, model->single);
  ms_moving_pins_destroy(scene, model->pins);
  ms_force_function_destroy(scene, model->function);
  ms_law_springs_destroy(scene, model->laws);
  MS_FREE(&scene->alloc, model->force, model->moving_solids);
  if (model->sharers && --*model->sharers == 0) {
    ms_layout_destroy(scene, &model->unknowns, &model->springs, &model->half_edges);
    ms_angles_destroy(scene, &model->angles);
    MS_FREE(&scene->alloc, model->mass, model->inv_mass, model->sharers);
  }
  *model = (ms_model){0};
}
