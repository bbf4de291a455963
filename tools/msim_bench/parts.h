/* parts - copies of a scene's arrays, to be modified before another scene is built from them */
#ifndef BENCH_PARTS_H
#define BENCH_PARTS_H

#include "msim/msim.h"

typedef struct parts {
  msim_scene *recipe;
  msim_scene_view view;       /* of the recipe */
  double *v, *mass;           /* 3n, 0 at first; n */
  double *k, *rest, *damping; /* of each spring */
} parts;

/* Takes ownership of the recipe, also on failure; fails with MSIM_ERR_MEMORY if it is NULL. Call
 * parts_free in any case. */
msim_status parts_take(msim_scene *recipe, parts *p);
void parts_free(parts *p);

/* Adds the particles, and the springs if requested. */
msim_status parts_add(const parts *p, int springs, msim_scene *scene, msim_error *err);

#endif
