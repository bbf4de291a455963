/* laplacian - the constant matrix of prefactored methods: M + h^2 Lap_k, a scalar for each
 * particle, with the Laplacian Lap_k of the spring graph with weights k */
#ifndef BENCH_LAPLACIAN_H
#define BENCH_LAPLACIAN_H

#include "msim/backend.h"
#include "msim/msim.h"

/* A vector has one number per particle, in the order of the factorization, or three such blocks.
 * Pinned particles are included, without off-diagonal entries. */
typedef struct laplacian {
  int32_t n;         /* particles */
  int32_t *particle; /* n: the particle at each position of this order */
  int32_t *place;    /* n: the position of each particle */
  const msim_backend *backend;
  void *self; /* state of the backend */
  msim_host host;
  msim_system matrix; /* owns its arrays */
  msim_error err;
} laplacian;

/* Assembles and factorizes the matrix by CHOLMOD with msim's settings. Returns 0 on failure and
 * sets L->err. Call laplacian_free in any case. */
int laplacian_make(const msim_scene_view *s, double h, laplacian *L);
void laplacian_free(laplacian *L);

/* Solves (M + h^2 Lap_k) y = b for three components, 3n; y must not overlap b. */
msim_status laplacian_solve(const laplacian *L, const double *b, double *y);

#endif
