/* coarse_cycle - an approximate inverse of A = P^T A P (coarse.h) where its factor would be large
 *
 * One V-cycle with clusters of aggregates (Briggs, Henson and McCormick 2000, ch. 3 and 8):
 *     z = S r,  z += f Q (Q^T A Q)^-1 Q^T (r - A z),  z += S (r - A z),
 * with damped block Jacobi, S = w D^-1, as smoother. Q maps the 4 modes of each cluster, in terms
 * of those of its aggregates (cluster_modes.h), to these; Q^T A Q is factored. As Q is not smooth
 * at the borders of clusters, its modes are stiffer than the motions that they stand for, and a
 * factor f > 1 enlarges the correction, which would be too small (Braess 1995). The map r -> z is
 *     2 S - S A S + f T (Q^T A Q)^-1 T^T,  T = (I - S A) Q,
 * which is symmetric, and positive definite for w < 2 / lambda_max(D^-1 A); its product with A has
 * eigenvalues of at most f. As springs with t < 0 are left out, and each spring acts on the
 * difference of the motions of two aggregates at most, A <= 2 D (|a - b|^2 <= 2 |a|^2 + 2 |b|^2),
 * so that each w < 1 will do.
 *
 * It computes in the units of D = L L^T, in which A becomes I + N, N = L^-1 (A - D) L^-T, and all
 * numbers of N are within [-1, 1]. There rounding is harmless however stiff springs are: the map
 * stays positive definite, whatever N is in it, and 16 bits resolve all but the smoothest motions,
 * which are those of the clusters, in double precision. */
#ifndef MS_COARSE_CYCLE_H
#define MS_COARSE_CYCLE_H

#include "linear/aggregates.h"
#include "linear/block_cholesky.h"

/* w and f. Cloths and solids take the fewest iterations near these. */
#define MS_COARSE_CYCLE_DAMPING         0.95
#define MS_COARSE_CYCLE_OVER_CORRECTION 1.25

typedef struct ms_coarse_cycle {
  int32_t n, block;    /* aggregates, 0: there is no cycle; scalars of each */
  ms_buckets members;  /* the aggregates of each cluster; all arrays have them in this order */
  int32_t *position;   /* n: the place of each aggregate in it; owners as in block_cholesky.h */
  int32_t *first;      /* n + 1: the range of each column in `row` */
  int32_t *row;        /* first[n]: links (row, column), row > column, by column, ascending */
  int32_t *column;     /* first[n] */
  ms_buckets left;     /* the links of each row */
  double *value;       /* ms_coarse_cycle_size(), the caller's, who sets it: A, the diagonal blocks
                          first, by columns; then chol.value */
  float *inverse;      /* ms_coarse_cycle_triangle() n: L^-1 */
  int16_t *link;       /* block^2 first[n]: N^T of each link, in units of 1 / INT16_MAX; columns in
                         pairs, interleaved by 4 rows */
  float *prolongation; /* ms_coarse_cycle_triangle() n: L^T Q */
  int32_t *cluster;    /* n, in the order of the aggregates: that of each */
  float *modes;        /* 16 n, likewise: Q, cluster_modes.h */
  ms_block_cholesky chol; /* of Q^T A Q */
  float *r, *z;           /* block n: L^-1 r; L^T z */
  double *c;              /* block chol.n: f Q^T (r - A z), then the correction by clusters */
  const struct ms_coarse_cycle_kernels *kernels;
} ms_coarse_cycle;

/* size: aggregates in a cluster; graph: which aggregates springs connect */
msim_status ms_coarse_cycle_create(const ms_model *model, const ms_aggregates *aggregates,
                                   const ms_sparse_graph *graph, int32_t size,
                                   ms_coarse_cycle *cycle, msim_error *err);
void ms_coarse_cycle_destroy(const msim_allocator *alloc, ms_coarse_cycle *cycle);

/* The length of `value` up to chol.value, block^2 (n + first[n]); 0 before creation */
static inline size_t ms_coarse_cycle_size(const ms_coarse_cycle *cycle) {
  return cycle->first ? (size_t)(cycle->block * cycle->block) *
                            ((size_t)cycle->n + (size_t)cycle->first[cycle->n])
                      : 0;
}

/* The numbers of a triangle of blocks of 4 x 4 on and below (L^-1), or on and above the diagonal
 * (L^T Q, as Q maps each component to itself), by columns */
static inline size_t ms_coarse_cycle_triangle(size_t block) { return block * (block + 4) / 2; }

/* The index in `value` of the block of aggregates i and j, position[i] >= position[j]; -1: not in
 * the pattern */
int32_t ms_coarse_cycle_find(const ms_coarse_cycle *cycle, int32_t i, int32_t j);

/* Prepare cycles with A, given in `value`, whose content is lost; chol.value is 0. MSIM_NOT_SPD: A
 * is not positive definite. */
msim_status ms_coarse_cycle_factor(ms_coarse_cycle *cycle, ms_pool *pool);

/* z, approximately A^-1 r; each has `block` scalars per aggregate. */
void ms_coarse_cycle_solve(ms_coarse_cycle *cycle, ms_pool *pool, const double *r, double *z);

#endif
