/* forces - sets the constant forces on the particles of a scene */
#include <string.h>

#include "scene/scene.h"

/* 1: all forces are 0, also without any. */
static int are_zero(int32_t n, const double *force) {
  for (size_t i = 0; force && i < 3 * (size_t)n; i++)
    if (force[i] != 0) return 0;
  return 1;
}

msim_status msim_scene_set_forces(msim_scene *scene, const double *force, msim_error *err) {
  if (!scene) return ms_error_set(err, MSIM_ERR_ARG, "scene is NULL");
  const int32_t n = scene->data->nparticles;
  if (force && ms_scene_check_finite("particles.force", 3 * (int64_t)n, 3, force, err))
    return MSIM_ERR_ARG;
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  if (are_zero(n, force)) {
    ms_memory_free(&s->alloc, s->force);
    s->force = NULL;
    return ms_error_clear(err);
  }
  if (!s->force && !MS_NEW(&s->alloc, s->force, 3 * (size_t)s->particle_capacity))
    return ms_error_set_memory(err, "the forces on particles");
  memcpy(s->force, force, 3 * (size_t)n * sizeof *force);
  return ms_error_clear(err);
}
