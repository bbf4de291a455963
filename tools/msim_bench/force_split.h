/* force_split - the forces of a scene in two parts, stiff and others, for methods of another
 * library that treat them differently; by the loops of spring_runs.h */
#ifndef BENCH_FORCE_SPLIT_H
#define BENCH_FORCE_SPLIT_H

#include "precision_scenes.h"
#include "spring_runs.h"

typedef struct force_split {
  int by; /* SPLIT_SPRINGS, SPLIT_DAMPING; 0: nothing is stiff */
  spring_runs stiff, others;
} force_split;

/* Returns 0 if out of memory. Call force_split_free in any case. */
int force_split_create(const precision_scene *kind, const msim_scene_view *view, force_split *s);
void force_split_free(force_split *s);

#endif
