/* rig - plays the host to one instance of a backend: the matrix in the format and order that it
 * asks for, vectors packed and unpacked, and what every host must get: a sentence with each error,
 * a permutation, its memory back */
#ifndef RIG_H
#define RIG_H

#include "../counting_host.h"
#include "../testing.h"
#include "msim/backend.h"
#include "problem.h"

typedef struct rig {
  counting_host host;
  const msim_backend *table;
  const problem *problem; /* whose values stand in A */
  void *self;
  msim_system A;
  int32_t *order; /* the block row that comes k-th */
  int32_t *graphptr, *graphind, *rowptr, *colind;
  double *val;
  double *inverse;            /* NONE: of the diagonal blocks, or of what can be inverted of them */
  void (*around)(int inside); /* told where a call of the backend begins and ends; nullable */
  msim_solve_info info;       /* of the last call */
  double fill, flops;         /* told by any call so far */
} rig;

void rig_init(rig *r, const msim_backend *table, const problem *p);

/* create and order, then the matrix is built. Whatever is returned, here and below: close the rig.
 */
msim_status rig_create(rig *r);
msim_status rig_analyze(rig *r);

/* All three. */
msim_status rig_open(rig *r, const msim_backend *table, const problem *p);

/* Write the values of a problem with the same pattern, without telling the backend. */
void rig_set(rig *r, const problem *p);

msim_status rig_factor(rig *r, int32_t kind);

/* nrhs vectors one after the other, in the problem's own order; y: guess in, answer out. */
msim_status rig_solve(rig *r, double rtol, int32_t max_iterations, int32_t nrhs, const double *b,
                      double *y);

/* Fails the test where memory was left behind. */
void rig_close(rig *r);

#endif
