/* kernel - the forces that another library gets: by msim_sim_force, through flat arrays, or by the
 * loop of runs.h, in arrays by components; whichever is the faster in this scene */
#ifndef BENCH_KERNEL_H
#define BENCH_KERNEL_H

#include "split.h"
#include "truth.h"

typedef struct kernel {
  const truth *truth;
  runs runs;
  split split;             /* by components */
  int by_runs;             /* which of the two; where forces are split, always the loop */
  double *x, *v, *inverse; /* the start, in the order of that one */
  /* What they cost, s, the best of a few times; what making a sim costs, and a whole step of
   * velocity Verlet, which makes one evaluation. */
  double flat_s, runs_s, create_s, step_s;
  double stiff_s, others_s; /* parts of the split; NAN: there is none */
  double difference;        /* of the two, over the largest force */
  double split_difference;  /* of the whole and the sum of its parts, likewise */
} kernel;

/* 0: there is no memory. Call kernel_free in any case. */
int kernel_make(const truth *t, kernel *k);
void kernel_free(kernel *k);

/* part: of enum FORCE_PARTS */
void kernel_force(const kernel *k, int part, const double *x, const double *v, double *f);

/* Back to x0 y0 z0 x1 ... */
void kernel_unfold(const kernel *k, const double *from, double *to);

#endif
