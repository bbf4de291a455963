/* solver - interface of reference programs to a library, called as its manual recommends */
#ifndef REFERENCE_SOLVER_H
#define REFERENCE_SOLVER_H

#include "protocol.h"

/* A x = b, A by rows. */
typedef struct csr_system {
  int32_t n, max_iterations;
  int32_t *rowptr, *colind; /* n + 1; rowptr[n] */
  double *val, *b;          /* rowptr[n]; n */
  double rtol;
} csr_system;

/* Defined by each reference program. */
typedef struct reference_solver {
  reference_hello hello;
  /* Takes another system, which remains valid until the next call, and does all that does not
   * depend on the values. Returns 0 on failure. */
  int (*prepare)(const csr_system *system);
  /* Factorizes and solves; sets times, iterations, and reason on failure. */
  int (*solve)(int variant, double *x, reference_reply *reply);
} reference_solver;

extern const reference_solver solver;

#endif
