/* runs - the forces of a scene by a loop of our own, as a careful user would write it for another
 * library: coordinates by components, springs in runs of neighbours i, i + 1, ... to j, j + 1, ...,
 * which compilers vectorise */
#ifndef BENCH_RUNS_H
#define BENCH_RUNS_H

#include "msim/msim.h"

typedef struct spring_run {
  int32_t i, j, first, length; /* particles; of the springs from `first` on */
} spring_run;

typedef struct runs {
  int32_t n, count, used;
  spring_run *all;
  double *k, *rest, *damping; /* `used` springs, in the order of the runs */
  int elastic, damped;        /* any spring has k, damping */
  double *weight;             /* 3n, x of all, then y, then z: m g, 0 where pinned */
  double drag;
} runs;

/* 0: there is no memory. Call runs_free in any case. */
int runs_make(const msim_scene_view *view, runs *r);
void runs_free(runs *r);

/* Of all particles, also those that are pinned; x, v and f by components, without planes. */
void runs_force(const runs *r, const double *x, const double *v, double *f);

#endif
