/* force_split - the forces of a scene in two parts, stiff and others, for methods of another
 * library that treat them differently; by the loops of spring_runs.h */
#ifndef BENCH_FORCE_SPLIT_H
#define BENCH_FORCE_SPLIT_H

#include "spring_runs.h"

typedef struct force_split {
  int by; /* SPLIT_SPRINGS, SPLIT_DAMPING; 0: nothing is stiff */
  spring_runs stiff, others;
} force_split;

/* by: SPLIT_SPRINGS, of which those of at least `stiff` N/m are stiff, SPLIT_DAMPING, or 0. Returns
 * 0 if out of memory. Call force_split_free in any case. */
int force_split_create(const msim_scene_view *view, int by, double stiff, force_split *s);
void force_split_free(force_split *s);

#endif
