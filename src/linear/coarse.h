/* coarse - the coarse correction of a two-level preconditioner: P (P^T A P)^-1 P^T
 *
 * The prolongation P maps the 4 modes of each aggregate and component to the unknowns. P^T A P is a
 * sparse matrix with blocks of 4 dims scalars, ordered by component, then mode; it is factored. */
#ifndef MS_COARSE_H
#define MS_COARSE_H

#include "linear/aggregates.h"
#include "linear/block_cholesky.h"
#include "linear/restriction.h"
#include "physics/force.h"

typedef struct ms_coarse {
  const ms_model *model;
  ms_aggregates aggregates;
  ms_restriction restriction;
  ms_block_cholesky chol;
  int32_t *block;       /* 8 halves.nslots: the off-diagonal block to which a half-edge contributes;
                     -1: none, or the opposite half-edge contributes to it */
  int32_t *diagonal;    /* aggregates.n: the index of each diagonal block */
  int drops_negative_t; /* 1: in the present matrix t < 0 counts as 0 */
  double *r, *z;        /* coarse vectors */
  float *modes;         /* unconstrained aggregates.weight; NULL where there are no planes */
  int32_t *constrained; /* nheld constrained unknowns; NULL where there are no planes */
  int32_t nconstrained;
  int is_constrained_more; /* 1: by ms_coarse_constrain_more() */
  const struct ms_coarse_kernels *kernels;
} ms_coarse;

msim_status ms_coarse_create(const ms_model *model, int32_t aggregate_size, ms_coarse *coarse,
                             msim_error *err);
void ms_coarse_destroy(ms_coarse *coarse);

/* Set the modes of n constrained unknowns to 0, as these do not move, and restore those of the
 * unknowns constrained before. */
void ms_coarse_constrain(ms_coarse *coarse, const ms_constraint *constraint, int32_t n);

/* The same with an older factor, of other constraints: modes that are 0 in it stay so. */
void ms_coarse_constrain_more(ms_coarse *coarse, const ms_constraint *constraint, int32_t n);

/* 1: exactly these unknowns are constrained, in this order, whatever the directions. */
int ms_coarse_is_constrained_by(const ms_coarse *coarse, const ms_constraint *constraint,
                                int32_t n);

/* A in the units of ms_pcg (pcg.h) */
typedef struct ms_coarse_matrix {
  const float *coefficients; /* of springs */
  const double *inertia;
  const ms_coefficients *a; /* its angular springs, times `by`, belong to A */
  double by;
  int braced; /* 1 if t < 0 counts as 0 */
} ms_coarse_matrix;

/* Factor P^T A P. braced makes A positive definite where angular springs do not prevent it.
 * MSIM_NOT_SPD: A is not positive definite, up to rounding, and there is no factor. */
msim_status ms_coarse_factor(ms_coarse *coarse, const ms_coarse_matrix *a);

/* Sum P^T r over the slices [begin, end), a chunk of restriction.h; chunks in any order, by any
 * threads. */
void ms_coarse_restrict(ms_coarse *coarse, const double *r, int32_t begin, int32_t end);

/* After that of all chunks: coarse->r = P^T r, coarse->z = (P^T A P)^-1 coarse->r. Returns
 * coarse->r . coarse->z. */
double ms_coarse_solve(ms_coarse *coarse);

#endif
