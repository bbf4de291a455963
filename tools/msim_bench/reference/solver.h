/* solver - a library as its own manual says to call it, to compare msim with */
#ifndef REFERENCE_SOLVER_H
#define REFERENCE_SOLVER_H

#include "protocol.h"

/* A x = b, by rows. */
typedef struct csr_system {
  int32_t n, max_iterations;
  int32_t *rowptr, *colind; /* n + 1; rowptr[n] */
  double *val, *b, *guess;  /* rowptr[n]; n; n */
  double rtol;
} csr_system;

/* What each reference program defines. */
typedef struct reference_solver {
  reference_hello hello;
  /* Take another system, which lives until the next call: what need not be done again when the
   * values change. 0 where it failed. */
  int (*prepare)(const csr_system *system);
  /* From values to solution; sets times, iterations, and reason where it fails. */
  int (*solve)(int variant, double *x, reference_reply *reply);
} reference_solver;

extern const reference_solver solver;

#endif
