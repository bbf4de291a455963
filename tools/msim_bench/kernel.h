/* kernel - the forces for the methods of another library: by msim_sim_force on interleaved arrays,
 * or by the loop of runs.h on arrays by components, whichever is faster in this scene */
#ifndef BENCH_KERNEL_H
#define BENCH_KERNEL_H

#include "split.h"
#include "truth.h"

typedef struct kernel {
  const truth *truth;
  runs runs;
  split split;             /* arrays by components */
  int by_runs;             /* 1: the loop; always so if the forces are split */
  double *x, *v, *inverse; /* initial state and 1/m, in the layout in use */
  /* Times in s, the minimum of 5: forces by msim_sim_force and by the loop; creating a sim; a step
   * of velocity Verlet, which takes one evaluation. */
  double flat_s, runs_s, create_s, step_s;
  double stiff_s, others_s; /* of split forces; NAN: not split */
  double difference;        /* of both implementations, over the largest force */
  double split_difference;  /* of the forces and the sum of their parts, likewise */
} kernel;

/* Returns 0 if out of memory. Call kernel_free in any case. */
int kernel_make(const truth *t, kernel *k);
void kernel_free(kernel *k);

/* part: ALL_FORCES, STIFF_FORCES or OTHER_FORCES */
void kernel_force(const kernel *k, int part, const double *x, const double *v, double *f);

/* Converts from the layout in use to x0 y0 z0 x1 ... */
void kernel_unfold(const kernel *k, const double *from, double *to);

#endif
