/* laplacian - the one matrix that methods with a prefactored system keep: M + h^2 Lap_k, a scalar
 * for each particle, Lap_k the graph's Laplacian with the weights k */
#ifndef BENCH_LAPLACIAN_H
#define BENCH_LAPLACIAN_H

#include "msim/backend.h"
#include "scenes.h"

/* Vectors have one number for each particle at its place in the factor's order, or three such
 * after each other. Pinned particles are there too, tied to nobody. */
typedef struct laplacian {
  int32_t n;         /* particles */
  int32_t *particle; /* n: which one is at each place */
  int32_t *place;    /* n: where each one is */
  const msim_backend *by;
  void *self; /* of by */
  msim_host host;
  msim_system matrix; /* its arrays are ours */
  msim_error err;
} laplacian;

/* Made and factored by CHOLMOD as msim tunes it. 0 where it failed, and why in L->err. Call
 * laplacian_free in any case. */
int laplacian_make(const moving *m, double h, laplacian *L);
void laplacian_free(laplacian *L);

/* (M + h^2 Lap_k) y = b in three components, 3n; y apart from b. */
msim_status laplacian_solve(const laplacian *L, const double *b, double *y);

#endif
