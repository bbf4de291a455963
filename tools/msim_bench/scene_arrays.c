#include "scene_arrays.h"

#include <stdlib.h>
#include <string.h>

void scene_arrays_free(scene_arrays *p) {
  double *arrays[] = {p->v, p->mass, p->k, p->rest, p->damping};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
  msim_scene_destroy(p->recipe);
  *p = (scene_arrays){.recipe = NULL};
}

/* n may be 0. */
static double *copy_doubles(const double *from, size_t n) {
  double *to = malloc((n + 1) * sizeof *to);
  if (to && n) memcpy(to, from, n * sizeof *to);
  return to;
}

msim_status scene_arrays_take(msim_scene *recipe, scene_arrays *p) {
  *p = (scene_arrays){.recipe = recipe, .view = {.size = sizeof p->view}};
  if (!recipe) return MSIM_ERR_MEMORY;
  msim_scene_get(recipe, &p->view);
  const size_t n = (size_t)p->view.nparticles, springs = (size_t)p->view.nsprings;
  p->v = calloc(3 * n, sizeof *p->v);
  p->mass = copy_doubles(p->view.mass, n);
  p->k = copy_doubles(p->view.k, springs);
  p->rest = copy_doubles(p->view.rest, springs);
  p->damping = copy_doubles(p->view.damping, springs);
  return p->v && p->mass && p->k && p->rest && p->damping ? MSIM_OK : MSIM_ERR_MEMORY;
}

msim_status scene_arrays_add(const scene_arrays *p, int springs, msim_scene *scene,
                             msim_error *err) {
  const msim_scene_view *view = &p->view;
  const msim_status status =
      msim_scene_add_particles(scene, view->nparticles, view->x, p->v, p->mass, err);
  if (status || !springs) return status;
  return msim_scene_add_springs(scene, view->nsprings, view->ij, p->k, p->rest, p->damping, err);
}
