#include "layout/planar.h"

static int is_at_level(const ms_scene *scene, int32_t axis, double level, const double *x,
                       const double *v) {
  for (size_t p = 0; p < (size_t)scene->nparticles; p++)
    if (x[3 * p + (size_t)axis] != level || (v && v[3 * p + (size_t)axis] != 0)) return 0;
  return 1;
}

int ms_planar_is_in_plane(const ms_scene *scene, int32_t axis, const double *x, const double *v) {
  return is_at_level(scene, axis, scene->x[axis], x, v);
}

int ms_planar_has_axis(const ms_scene *scene, unsigned skip_off, int32_t axis, double level) {
  if (skip_off & MSIM_SKIP_TWO_D || ms_scene_has_function(scene)) return 0;
  int pushed = scene->external.gravity[axis] != 0 || scene->ncolliders > 0;
  for (int32_t p = 0; p < scene->nparticles && scene->force; p++)
    pushed |= !scene->pinned[p] && scene->force[3 * (size_t)p + (size_t)axis] != 0;
  for (int32_t m = 0; m < scene->nmotions; m++)
    for (size_t i = 0; i < (size_t)scene->motions[m].n * (size_t)scene->motions[m].nt; i++)
      pushed |= scene->motions[m].x[3 * i + (size_t)axis] != level;
  for (int32_t p = 0; p < scene->nplanes; p++) pushed |= scene->planes[p].normal[axis] != 0;
  return !pushed && is_at_level(scene, axis, level, scene->x, scene->v);
}

int32_t ms_planar_find_axis(const ms_scene *scene, unsigned skip_off) {
  int32_t axis = 2;
  while (axis >= 0 && !ms_planar_has_axis(scene, skip_off, axis, scene->x[axis])) axis--;
  return axis;
}
