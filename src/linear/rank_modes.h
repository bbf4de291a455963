/* rank_modes - the top level of the preconditioner on several ranks: B += Q (Q^T A Q)^-1 Q^T
 *
 * Q has the affine motions of each rank: for each component 1 and the coordinates in the scene,
 * orthonormal; in terms of the modes of the rank's coarse space where it has one, so that this
 * level is a coarse space of coarse spaces (coarse_overlap.h): 12 modes a rank, 8 in planar scenes.
 * They carry corrections across ranks, which coarse spaces of single ranks do not. Q^T A Q has a
 * block row for each rank, with blocks where springs join two ranks. Every rank has all of its
 * factor. Up to MS_RANK_MODES_FACTOR ranks each solves with it; on more ranks each computes its own
 * rows of the inverse from it, once, and multiplies by them: 12 P numbers in place of the whole
 * factor, for a further sum over ranks. */
#ifndef MS_RANK_MODES_H
#define MS_RANK_MODES_H

#include "linear/coarse.h"

#ifndef MS_RANK_MODES_FACTOR /* tests make it small */
#  define MS_RANK_MODES_FACTOR 256
#endif

typedef struct ms_rank_modes {
  const ms_model *model;
  int32_t *rank;              /* first_fixed: of each unknown and ghost */
  double (*weight)[MS_MODES]; /* first_fixed: the functions at each */
  int32_t nborder, *border;   /* unknowns that springs join with ghosts */
  ms_block_cholesky chol;     /* of Q^T A Q, blocks of 12 or 8 */
  int32_t *index;    /* nranks: of block (own rank, r) in `own`; MS_RANK_NO_BLOCK: r sends it */
  double *own, *all; /* blocks of this rank; those of all ranks, in their order */
  int64_t *bytes;    /* nranks: of the blocks of each */
  int32_t *place;    /* where each of `all` is in chol.value */
  double *message, *messages; /* 2 + chol.block, of each rank */
  double *z;                  /* chol.block nranks: b, then the solution */
  double *inverse;            /* own rows of (Q^T A Q)^-1, one after the other; NULL: few ranks */
  int is_ready;               /* 1: factored */
} ms_rank_modes;

/* Collective, with the same status on all ranks: each knows its own unknowns and ghosts. vec: room
 * for a vector of 4 components. After an error it may be there, and must be destroyed. */
msim_status ms_rank_modes_create(const ms_coarse *coarse, const ms_model *model, double *vec,
                                 ms_rank_modes **modes, msim_error *err);
void ms_rank_modes_destroy(const msim_allocator *alloc, ms_rank_modes *modes);

/* Factor Q^T (by A) Q; collective. Where it is not positive definite, nothing is ready. own: the
 * block of this rank, if it is known. Nullable: own */
void ms_rank_modes_factor(ms_rank_modes *modes, const ms_coefficients *a, double by,
                          const double *own);

/* z += Q (Q^T A Q)^-1 Q^T r on the unknowns of this rank, to coarse->z after ms_coarse_solve(), or
 * without a coarse space to that of rz. Returns r.(what is added), and in product[] the sums of
 * both numbers, over all ranks; one gather. Nullable: coarse */
double ms_rank_modes_solve(ms_rank_modes *modes, double product[2], const ms_coarse *coarse,
                           ms_operands rz);

#endif
