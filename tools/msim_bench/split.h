/* split - the forces of a scene in two parts, stiff and others, for methods of another library that
 * treat them differently; by the loops of runs.h */
#ifndef BENCH_SPLIT_H
#define BENCH_SPLIT_H

#include "precision_scenes.h"
#include "runs.h"

typedef struct split {
  int by; /* SPLIT_SPRINGS, SPLIT_DAMPING; 0: nothing is stiff */
  runs stiff, others;
} split;

/* Returns 0 if out of memory. Call split_free in any case. */
int split_make(const precision_scene *kind, const msim_scene_view *view, split *s);
void split_free(split *s);

#endif
