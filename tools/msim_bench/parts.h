/* parts - the arrays of a scene that a recipe makes, to be changed before a scene is made of them
 */
#ifndef BENCH_PARTS_H
#define BENCH_PARTS_H

#include "msim/msim.h"

typedef struct parts {
  msim_scene *recipe;
  msim_scene_view view;       /* of it */
  double *v, *mass;           /* 3n, 0; n */
  double *k, *rest, *damping; /* springs */
} parts;

/* Takes the recipe, also where it fails; NULL fails with MSIM_ERR_MEMORY. Call parts_free in any
 * case. */
msim_status parts_take(msim_scene *recipe, parts *p);
void parts_free(parts *p);

/* Its particles, and its springs where they are asked for. */
msim_status parts_add(const parts *p, int springs, msim_scene *scene, msim_error *err);

#endif
