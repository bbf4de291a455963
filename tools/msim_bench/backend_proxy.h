/* backend_proxy - a backend that forwards all calls to another one, to repeat a solve outside the
 * sim on the same system
 *
 * Its table has the name of the inner backend. A sim uses it through msim_options.backends. */
#ifndef BENCH_BACKEND_PROXY_H
#define BENCH_BACKEND_PROXY_H

#include "msim/backend.h"

typedef struct backend_proxy {
  msim_backend table; /* passed to the sim */
  const msim_backend *backend;
  void *self;            /* state of the inner backend */
  const msim_system *A;  /* owned by the sim; set by analyze() */
  int copy_next;         /* 1: copy the arguments of the next solve() */
  size_t length;         /* of b and guess; 0: no solve() was copied */
  double *b, *guess, *y; /* y: scratch for a solution */
  msim_solve_params params;
} backend_proxy;

/* The next sim that is created with p->table as a solver uses p, which must outlive it. */
void backend_proxy_init(backend_proxy *p, const msim_backend *inner);
void backend_proxy_free(backend_proxy *p);

/* Repeats and times factor() and solve() with the copied right-hand side and initial guess. */
msim_status backend_proxy_repeat(backend_proxy *p, double *factor_s, double *solve_s);

#endif
