/* probe - a backend inside a real sim, to be called again from outside with the very same system
 *
 * The probe's table has the backend's name and forwards every call to it. A sim takes it by
 * msim_options.backends. */
#ifndef BENCH_PROBE_H
#define BENCH_PROBE_H

#include "msim/backend.h"

typedef struct probe {
  msim_backend table; /* for the sim */
  const msim_backend *inner;
  void *self;            /* of inner */
  const msim_system *A;  /* the sim's, since analyze() */
  int listens;           /* keep what the first solve() from now on is asked */
  size_t length;         /* of b and guess; 0: nothing was kept */
  double *b, *guess, *y; /* y: room for a solution */
  msim_solve_params params;
} probe;

/* The next sim that is created with p->table as a solver is watched by p, which outlives it. */
void probe_init(probe *p, const msim_backend *inner);
void probe_free(probe *p);

/* factor() and solve() once more, for the right side and first guess that were kept. */
msim_status probe_replay(probe *p, double *factor_s, double *solve_s);

#endif
