/* rig - a minimal host for one instance of a backend: it builds the matrix in the format and order
 * that the backend asks for, packs and unpacks vectors, and checks what the contract demands: a
 * message with each error, a valid permutation, all memory freed */
#ifndef RIG_H
#define RIG_H

#include "../counting_host.h"
#include "../testing.h"
#include "msim/backend.h"
#include "problem.h"

typedef struct rig {
  counting_host host;
  const msim_backend *table;
  const problem *problem; /* its values are in A */
  void *self;
  msim_system A;
  int32_t *order; /* order[k]: the block row at position k */
  int32_t *graphptr, *graphind, *rowptr, *colind;
  double *val;
  double *inverse;             /* MSIM_FORMAT_NONE: of the diagonal blocks, else the identity */
  void (*on_call)(int inside); /* called with 1 before and with 0 after each call; nullable */
  msim_solve_info info;        /* of the last call */
  double fill, flops;          /* the largest that any call has returned */
} rig;

extern const char *rig_options; /* of all instances: solver.options; NULL: none */

void rig_init(rig *r, const msim_backend *table, const problem *p);

/* Create the instance and order the matrix, then build it. Close the rig after every status that it
 * or the functions below return. */
msim_status rig_create(rig *r);
msim_status rig_analyze(rig *r);

/* rig_init, rig_create and rig_analyze. */
msim_status rig_open(rig *r, const msim_backend *table, const problem *p);

/* Write the values of a problem of the same pattern into the matrix; the backend is not called. */
void rig_set(rig *r, const problem *p);

msim_status rig_factor(rig *r, int32_t kind);

/* nrhs vectors one after the other, in the order of the problem; y: initial guess in, solution
 * out. */
msim_status rig_solve(rig *r, double rtol, int32_t max_iterations, int32_t nrhs, const double *b,
                      double *y);

/* Destroys the instance; fails the test where memory was not freed. */
void rig_close(rig *r);

#endif
