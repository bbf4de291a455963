/* rules - decides which solvers are too expensive to be timed on a system */
#ifndef BENCH_RULES_H
#define BENCH_RULES_H

#include "scenes.h"

/* Cost limits of a benchmark: flops of a factorization, products A x of an iterative method. */
typedef struct thrift {
  double flops;     /* without dense kernels */
  double dense;     /* with dense kernels; 0: no limit */
  double products;  /* with a short recurrence */
  double restarted; /* with restarts */
} thrift;

/* Why a solver is too expensive; NULL: it is not. text: buffer for the reason. */
const char *leave_out(const char *solver, const moving *m, double h, double rtol, const thrift *t,
                      char text[static 128]);

#endif
