#include "checkpoint/saved_scene.h"

#include <math.h>
#include <string.h>

/*------------------------------------- forces ---------------------------------------------------*/

static size_t count_bytes(const ms_scene *s) { return 3 * (size_t)s->nparticles * sizeof(double); }

void ms_saved_scene_write_forces(ms_archive *b, const msim_sim *sim) {
  const ms_scene *s = sim->scene;
  int32_t changed = sim->created_from != NULL, there = s->force != NULL;
  ms_external external = s->external;
  MS_ARCHIVE_TRANSFER(b, changed);
  if (changed || b->direction == MS_ARCHIVE_COUNT) {
    MS_ARCHIVE_TRANSFER(b, external);
    MS_ARCHIVE_TRANSFER(b, there);
    if (there) ms_archive_transfer(b, s->force, count_bytes(s));
    else if (b->direction == MS_ARCHIVE_COUNT) b->position += count_bytes(s);
  }
}

/* *force: an array that the caller frees; NULL: none */
static msim_status read_values(ms_archive *b, const ms_scene *s, ms_external *external,
                               double **force, msim_error *err) {
  int32_t there = 0;
  MS_ARCHIVE_TRANSFER(b, *external);
  MS_ARCHIVE_TRANSFER(b, there);
  ms_archive_check(b, (there | 1) == 1, "the forces on particles");
  if (ms_archive_failed(b) || !there) return MSIM_OK;
  if (!MS_NEW(&s->alloc, *force, 3 * (size_t)s->nparticles))
    return ms_error_set_memory(err, "the forces on particles");
  ms_archive_transfer(b, *force, count_bytes(s));
  return MSIM_OK;
}

/* *scene: a copy of the sim's with these forces. Setters refuse impossible values. */
static msim_status copy_with_forces(const msim_sim *sim, const ms_external *external,
                                    const double *force, ms_scene **scene, msim_error *err) {
  msim_scene copy = {ms_scene_retain(sim->scene)};
  msim_status status = msim_scene_set_forces(&copy, force, err);
  if (!status) status = msim_scene_set_gravity(&copy, external->gravity, err);
  if (!status) status = msim_scene_set_drag(&copy, external->drag, err);
  if (status) ms_scene_release(copy.data);
  else *scene = copy.data;
  return status;
}

static int has_forces(const ms_scene *s, const ms_external *external, const double *force) {
  if (memcmp(&s->external, external, sizeof *external) != 0 || !s->force != !force) return 0;
  return !force || memcmp(s->force, force, count_bytes(s)) == 0;
}

msim_status ms_saved_scene_read_forces(ms_archive *b, const msim_sim *sim, ms_scene **scene,
                                       int32_t *changed, msim_error *err) {
  const ms_scene *created = sim->created_from;
  ms_external external = {.drag = 0};
  double *force = NULL;
  *scene = NULL;
  MS_ARCHIVE_TRANSFER(b, *changed);
  ms_archive_check(b, (*changed | 1) == 1, "the change of forces");
  msim_status status = MSIM_OK;
  if (*changed && !ms_archive_failed(b))
    status = read_values(b, sim->scene, &external, &force, err);
  if (!status && !ms_archive_failed(b)) {
    if (*changed && has_forces(sim->scene, &external, force)) *scene = ms_scene_retain(sim->scene);
    else if (*changed) status = copy_with_forces(sim, &external, force, scene, err);
    else if (created)
      status = copy_with_forces(sim, &created->external, created->force, scene, err);
    else *scene = ms_scene_retain(sim->scene);
  }
  ms_memory_free(&sim->alloc, force);
  return status;
}

/*------------------------------------- springs --------------------------------------------------*/

static void archive_springs(ms_archive *b, ms_scene *s) {
  double *arrays[] = {s->k, s->rest, s->damping};
  for (int i = 0; i < 3; i++) {
    ms_archive_transfer(b, arrays[i], (size_t)s->nsprings * sizeof(double));
    for (int32_t e = 0; e < s->nsprings && b->direction == MS_ARCHIVE_READ; e++)
      ms_archive_check(b, isfinite(arrays[i][e]) && arrays[i][e] >= 0, "a spring");
  }
}

void ms_saved_scene_write_springs(ms_archive *b, const msim_sim *sim) {
  archive_springs(b, sim->chosen_for);
}

msim_status ms_saved_scene_read_springs(ms_archive *b, const msim_sim *sim, ms_scene **scene,
                                        msim_error *err) {
  msim_scene copy = {ms_scene_retain(sim->scene)};
  *scene = ms_scene_make_writable(&copy, err);
  if (*scene) {
    archive_springs(b, *scene);
    return MSIM_OK;
  }
  ms_scene_release(sim->scene);
  return MSIM_ERR_MEMORY;
}
