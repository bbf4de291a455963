/* rank_modes - the top level of the preconditioner on several ranks: B += Q (Q^T A Q)^-1 Q^T
 *
 * Q has the affine motions of each patch of each rank (rank_patches.h), the parts of bodies that
 * ranks share: for each component 1 and the coordinates in the scene, orthonormal; in terms of the
 * modes of the rank's coarse space where it has one, so that this level is a coarse space of coarse
 * spaces (coarse_overlap.h): 12 modes a patch, 8 in planar scenes. They carry corrections across
 * ranks, which coarse spaces of single ranks do not. Q^T A Q has a block row for each patch, with
 * blocks where springs join two patches. Every rank has all of its factor. Up to
 * MS_RANK_MODES_FACTOR ranks each solves with it; on more ranks each computes its own rows of the
 * inverse from it, once, and multiplies by them: 12 P numbers in place of the whole factor, for a
 * further sum over ranks. */
#ifndef MS_RANK_MODES_H
#define MS_RANK_MODES_H

#include "base/ranks.h"
#include "linear/coarse.h"

#ifndef MS_RANK_MODES_FACTOR /* tests make it small */
#  define MS_RANK_MODES_FACTOR 256
#endif

typedef struct ms_rank_modes {
  const ms_model *model;
  int32_t *first;             /* nranks + 1: the patches of each rank */
  int32_t most;               /* patches of a rank */
  int32_t *patch;             /* first_fixed: of each unknown and ghost; -1: none */
  double (*weight)[MS_MODES]; /* first_fixed: the functions at each */
  int32_t nborder, *border;   /* unknowns that springs join with ghosts */
  ms_block_cholesky chol;     /* of Q^T A Q, blocks of 12 or 8 */
  int32_t *index;    /* of block (own patch p, q) in `own`, at p chol.n + q; MS_RANK_NO_BLOCK: there
                        is none, or another rank sends it */
  double *own, *all; /* blocks of this rank; those of all ranks, in their order */
  int64_t *bytes;    /* nranks: of the blocks of each */
  int32_t *place;    /* where each of `all` is in chol.value */
  double *message, *messages; /* 2 + chol.block most, of each rank */
  double *z;                  /* chol.block chol.n: b, then the solution */
  double *inverse;            /* own rows of (Q^T A Q)^-1, one after the other; NULL: few ranks */
  int is_ready;               /* 1: factored */
} ms_rank_modes;

/* The first patch of this rank, and the number of its patches */
static inline int32_t ms_rank_modes_first(const ms_rank_modes *q) {
  return q->first[q->model->shape.ranks->rank];
}
static inline int32_t ms_rank_modes_count(const ms_rank_modes *q) {
  return q->first[q->model->shape.ranks->rank + 1] - ms_rank_modes_first(q);
}

/* Collective, with the same status on all ranks: each sets its own unknowns and ghosts. vec: room
 * for a vector of 4 components. After an error it may be there, and must be destroyed. */
msim_status ms_rank_modes_create(const ms_coarse *coarse, const ms_model *model, double *vec,
                                 ms_rank_modes **modes, msim_error *err);
void ms_rank_modes_destroy(const msim_allocator *alloc, ms_rank_modes *modes);

/* Factor Q^T (by A) Q; collective. Where it is not positive definite, nothing is ready. own: has
 * the blocks of the patches of this rank, if they are known. Nullable: own */
void ms_rank_modes_factor(ms_rank_modes *modes, const ms_coefficients *a, double by,
                          const struct ms_coarse_overlap *own);

/* z += Q (Q^T A Q)^-1 Q^T r on the unknowns of this rank, to coarse->z after ms_coarse_solve(), or
 * without a coarse space to that of rz. Returns r.(what is added), and in product[] the sums of
 * both numbers, over all ranks; one gather. Nullable: coarse */
double ms_rank_modes_solve(ms_rank_modes *modes, double product[2], const ms_coarse *coarse,
                           ms_operands rz);

#endif
