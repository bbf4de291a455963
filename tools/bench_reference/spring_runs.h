/* spring_runs - the forces of a scene by a vectorizable loop, as a careful user would write it:
 * coordinates by components, springs in runs that connect i, i + 1, ... with j, j + 1, ... */
#ifndef BENCH_SPRING_RUNS_H
#define BENCH_SPRING_RUNS_H

#include "msim/msim.h"

typedef struct spring_run {
  int32_t i, j, first, length; /* first particles; the springs from index `first` on */
} spring_run;

typedef struct spring_runs {
  int32_t n, count, used;
  spring_run *all;
  double *k, *rest, *damping; /* of `used` springs, in the order of the runs */
  int elastic, damped;        /* whether any spring has k > 0, damping > 0 */
  double *weight;             /* 3n, by components: m g, 0 for pinned particles */
  double drag;
} spring_runs;

/* Springs without stiffness and damping are left out. Returns 0 if out of memory. Call
 * spring_runs_free in any case. */
int spring_runs_create(const msim_scene_view *view, spring_runs *r);
void spring_runs_free(spring_runs *r);

/* Forces on all particles, including pinned ones, without planes; x, v and f by components. */
void spring_runs_force(const spring_runs *r, const double *x, const double *v, double *f);

#endif
