/* coarse_overlap - what the coarse space of a rank shares with the modes of ranks (rank_modes.h)
 *
 * The affine motions of a patch belong to both, and both would correct them: that adds up to 1 to
 * the largest eigenvalue of B A. The coarse correction, which involves no other rank, leaves
 * them to those modes:
 *     z = A^-1 r - R (R^T A R)^-1 R^T r,
 * where A is the coarse matrix of the rank, and R has these motions in terms of the coarse modes:
 * the correction by deflation (Nicolaides, SIAM J. Numer. Anal. 24 (1987) 355). It stays positive
 * semidefinite for any R, as A^-1 less its part in the range of R. A cycle in place of A^-1 differs
 * from it by little in motions as smooth as these, less than what the modes of ranks add.
 */
#ifndef MS_COARSE_OVERLAP_H
#define MS_COARSE_OVERLAP_H

#include "linear/coarse.h"

struct ms_coarse_overlap {
  int32_t n;                   /* patches (rank_patches.h) */
  int32_t *patch;              /* aggregates.n: of each, connected ones in parts; -1: none */
  double (*motions)[MS_MODES]; /* 4 aggregates.n: R, of each mode; alike in each component */
  int32_t nlinks;
  int32_t (*links)[3]; /* pairs of aggregates that springs connect, and their blocks in `value` */
  double *matrix;      /* R^T A R in the layout of chol.value, which follows it */
  ms_block_cholesky chol; /* its factor */
  int is_factored;
  double *b; /* R^T r, by patch and component */
};

/* graph: the aggregates that springs connect with each one */
msim_status ms_coarse_overlap_create(const ms_coarse *coarse, const ms_sparse_graph *graph,
                                     struct ms_coarse_overlap **overlap, msim_error *err);
void ms_coarse_overlap_destroy(const msim_allocator *alloc, struct ms_coarse_overlap *overlap);

/* P R at an unknown: what its motion has of each; 0 if it belongs to no aggregate */
void ms_coarse_overlap_weights(const ms_coarse *coarse, int32_t row, double weight[MS_MODES]);

/* Factor R^T A R, A in coarse->value. */
void ms_coarse_overlap_factor(const ms_coarse *coarse);

/* The block of two patches that springs connect, or of one, in R^T A R, by columns */
void ms_coarse_overlap_get_block(const struct ms_coarse_overlap *overlap, int32_t row,
                                 int32_t column, double *block);

/* b = R^T coarse->r */
void ms_coarse_overlap_restrict(const ms_coarse *coarse);

/* coarse->z -= R (R^T A R)^-1 b */
void ms_coarse_overlap_subtract(const ms_coarse *coarse);

/* coarse->z += R c */
void ms_coarse_overlap_add(const ms_coarse *coarse, const double *c);

#endif
