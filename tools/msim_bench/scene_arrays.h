/* scene_arrays - copies of a scene's arrays, to be modified before another scene is built from them
 * */
#ifndef BENCH_SCENE_ARRAYS_H
#define BENCH_SCENE_ARRAYS_H

#include "msim/msim.h"

typedef struct scene_arrays {
  msim_scene *recipe;
  msim_scene_view view;       /* of the recipe */
  double *v, *mass;           /* 3n, 0 at first; n */
  double *k, *rest, *damping; /* of each spring */
} scene_arrays;

/* Takes ownership of the recipe, also on failure; fails with MSIM_ERR_MEMORY if it is NULL. Call
 * scene_arrays_free in any case. */
msim_status scene_arrays_take(msim_scene *recipe, scene_arrays *p);
void scene_arrays_free(scene_arrays *p);

/* Adds the particles, and the springs if requested. */
msim_status scene_arrays_add(const scene_arrays *p, int springs, msim_scene *scene,
                             msim_error *err);

#endif
