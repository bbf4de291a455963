/* coarse - the coarse part of a two-level preconditioner: P (P^T A P)^-1 P^T
 *
 * P spreads 4 modes of each aggregate and component over its rows; P^T A P is a sparse matrix of
 * blocks of 4 dims scalars, component-major in a block row, and is factored. */
#ifndef MS_COARSE_H
#define MS_COARSE_H

#include "linear/aggregates.h"
#include "linear/block_cholesky.h"
#include "physics/force.h"

typedef struct ms_coarse {
  const ms_model *model;
  ms_aggregates aggregates;
  ms_block_cholesky chol;
  int32_t *block;    /* 8 halves.nslots: the block to which a half spring between two aggregates
                     belongs; -1: none, or its twin takes care of it */
  int32_t *diagonal; /* aggregates.n: the block of each */
  int braced;        /* the matrix at hand leaves t < 0 out */
  double *r, *z;     /* coarse vectors */
  float *modes;      /* aggregates.weight, where rows may be held; else NULL */
  int32_t *held;     /* nheld rows that are held; NULL where none may be */
  int32_t nheld;
  const struct ms_coarse_kernels *kernels;
} ms_coarse;

msim_status ms_coarse_create(const ms_model *model, int32_t aggregate_size, ms_coarse *coarse,
                             msim_error *err);
void ms_coarse_destroy(ms_coarse *coarse);

/* Rows that are held do not move: their modes are 0 from now on, until others are held. */
void ms_coarse_hold(ms_coarse *coarse, const ms_hold *hold, int32_t n);

/* 1: just these rows are held, in that order, in whatever directions. */
int ms_coarse_holds(const ms_coarse *coarse, const ms_hold *hold, int32_t n);

/* Factor P^T A P, with A as pcg.h has it: coefficients of half springs and the inertia of rows.
 * braced: 1, t < 0 counts as 0, so that A is positive definite.
 * MSIM_NOT_SPD: no factor; A is then not positive definite, up to rounding. */
msim_status ms_coarse_factor(ms_coarse *coarse, const float *coefficients, const double *inertia,
                             int braced);

/* coarse->r = P^T r, coarse->z = (P^T A P)^-1 coarse->r; returns r.z of these. */
double ms_coarse_solve(ms_coarse *coarse, const double *r);

#endif
