/* rank_modes - the top level of the preconditioner on several ranks: B += Q (Q^T A Q)^-1 Q^T
 *
 * Q has the affine motions of each rank's unknowns: for each component 1 and the coordinates in the
 * scene, less their mean, over half the extent of the rank: 12 modes a rank, 6 in planar scenes.
 * They carry corrections across ranks, which coarse spaces of single ranks do not. Every rank has
 * the whole dense factor, and solves with it alike. */
#ifndef MS_RANK_MODES_H
#define MS_RANK_MODES_H

#include "physics/force.h"
#include "layout/rank_part.h"

enum { MS_RANK_MODES_MOST = 12 };

typedef struct ms_rank_modes {
  const ms_model *model;
  int32_t n, own;             /* modes of all ranks, and the first one of this rank */
  int32_t block;              /* modes of a rank */
  int32_t *rank;              /* first_fixed: of each unknown and ghost */
  double *weight;             /* 4 first_fixed: 1 and the coordinates of each; less where planar */
  double *rows;               /* block n: Q^T A Q, rows of this rank */
  double *factor;             /* n^2: L, by rows */
  double *message, *messages; /* 1 + block, of each rank */
  double *z;                  /* n */
  int is_ready;               /* 1: factored */
} ms_rank_modes;

/* NULL in one process. After an error it may be there, and must be destroyed. */
msim_status ms_rank_modes_create(const ms_model *model, ms_rank_modes **modes, msim_error *err);
void ms_rank_modes_destroy(const msim_allocator *alloc, ms_rank_modes *modes);

/* Factor Q^T (by A) Q; collective. Modes that depend on others are left out. */
void ms_rank_modes_factor(ms_rank_modes *modes, const ms_coefficients *a, double by);

/* z += Q (Q^T A Q)^-1 Q^T r on the unknowns of this rank. Returns r.(what is added) plus `share`,
 * both summed over all ranks; collective. */
double ms_rank_modes_solve(ms_rank_modes *modes, double share, const double *r, double *z);

#endif
