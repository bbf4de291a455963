/* cost_limits - decides which solvers are too expensive to be timed on a system */
#ifndef BENCH_COST_LIMITS_H
#define BENCH_COST_LIMITS_H

#include "bench_scenes.h"

/* Cost limits of a benchmark: flops of a factorization, products A x of an iterative method. */
typedef struct cost_limits {
  double flops;     /* without dense kernels */
  double dense;     /* with dense kernels; 0: no limit */
  double products;  /* with a short recurrence */
  double restarted; /* with restarts */
} cost_limits;

/* Why a solver is too expensive; NULL: it is not. text: buffer for the reason. */
const char *reason_to_skip(const char *solver, const moving_scene *m, double h, double rtol,
                           const cost_limits *t, char text[static 128]);

#endif
