/* coarse - the coarse correction of a two-level preconditioner: P (P^T A P)^-1 P^T
 *
 * The prolongation P maps the 4 modes of each aggregate and component to the unknowns. P^T A P is a
 * sparse matrix with blocks of 4 dims scalars, ordered by component, then mode. It is factored, or
 * where its factor would be large, (P^T A P)^-1 is replaced by a cycle (coarse_cycle.h). */
#ifndef MS_COARSE_H
#define MS_COARSE_H

#include "linear/aggregates.h"
#include "linear/block_cholesky.h"
#include "linear/coarse_cycle.h"
#include "linear/linear.h"
#include "linear/restriction.h"
#include "physics/force.h"

typedef struct ms_coarse {
  const ms_model *model;
  ms_aggregates aggregates;
  ms_restriction restriction;
  ms_block_cholesky chol; /* of P^T A P; n = 0: there is a cycle */
  ms_coarse_cycle cycle;  /* n = 0: there is a factor */
  double *value;          /* P^T A P, where chol or cycle takes it from: used by ms_coarse_factor()
                             alone, and as long as 4 vectors at least, which ms_pcg has in it */
  size_t value_size;      /* its length */
  int32_t *position;      /* aggregates.n: owners of blocks as in block_cholesky.h */
  int32_t *first_block;   /* aggregates.n + 1: the range of each aggregate in `block` */
  int32_t *block; /* the off-diagonal blocks to which half-edges of the aggregate contribute, in the
                     order of its unknowns: those of ms_coarse_owns_block() only */
  int32_t *diagonal;    /* aggregates.n: the index of each diagonal block */
  int drops_negative_t; /* 1: in the present matrix t < 0 counts as 0 */
  double *r, *z;        /* coarse vectors */
  float *modes;         /* unconstrained aggregates.weight; NULL where there are no planes */
  int32_t *constrained; /* nheld constrained unknowns; NULL where there are no planes */
  int32_t nconstrained;
  int is_constrained_more;           /* 1: by ms_coarse_constrain_more() */
  struct ms_coarse_overlap *overlap; /* with the modes of ranks; NULL: one process */
  int leaves_overlap;                /* 1: to those, which are ready */
  const struct ms_coarse_kernels *kernels;
} ms_coarse;

/* 1: half-edges of aggregate `own` to `other` (-1: none) contribute to an off-diagonal block: of
 * the two half-edges of a spring, that of the aggregate eliminated later does. */
static inline int ms_coarse_owns_block(const ms_coarse *coarse, int32_t own, int32_t other) {
  return other >= 0 && coarse->position[own] > coarse->position[other];
}

/* The index in `value` of the block of aggregates i and j, position[i] >= position[j] */
static inline int32_t ms_coarse_find(const ms_coarse *coarse, int32_t i, int32_t j) {
  return coarse->cycle.n ? ms_coarse_cycle_find(&coarse->cycle, i, j)
                         : ms_block_cholesky_find(&coarse->chol, i, j);
}

msim_status ms_coarse_create(const ms_model *model, ms_coarse_size size, ms_coarse *coarse,
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

/* Factor P^T A P. braced makes A positive definite where angular springs do not prevent it; a cycle
 * leaves out t < 0 in any case. MSIM_NOT_SPD: A is not positive definite, up to rounding, and there
 * is no factor. */
msim_status ms_coarse_factor(ms_coarse *coarse, const ms_coarse_matrix *a);

/* Sum P^T r over the slices [begin, end), a chunk of restriction.h; chunks in any order, by any
 * threads. r: of doubles, or of floats if `single` */
void ms_coarse_restrict(ms_coarse *coarse, int single, const void *r, int32_t begin, int32_t end);

/* After that of all chunks: coarse->r = P^T r, coarse->z = (P^T A P)^-1 coarse->r, without what it
 * leaves to the modes of ranks (coarse_overlap.h). Returns coarse->r . coarse->z. */
double ms_coarse_solve(ms_coarse *coarse);

#endif
