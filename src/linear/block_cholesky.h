/* block_cholesky - the factorization A = L L^T of a small sparse symmetric matrix of dense blocks
 *
 * For coarse matrices: hundreds to thousands of block rows, blocks of 8 x 8 or 12 x 12 scalars. The
 * order is minimum degree on the graph of the blocks (Tinney and Walker 1967), which also yields
 * the pattern of the factor. The factorization is right-looking, by block columns. The factor is
 * stored in single precision, which suffices for a preconditioner and halves the memory traffic. */
#ifndef MS_BLOCK_CHOLESKY_H
#define MS_BLOCK_CHOLESKY_H

#include "linear/sparse_matrix.h"

enum { MS_BLOCK_CHOLESKY_MAX_BLOCK = 12 };

typedef struct ms_block_cholesky {
  int32_t n, block;  /* block rows; scalars in each, 8 or 12 */
  int32_t *position; /* n: position of each block row in the elimination order */
  int32_t *first;    /* n + 1: the first block of each column, by position */
  int32_t *row;      /* first[n]: block rows, by position, ascending; the diagonal block is first */
  double *value; /* block^2 first[n], owned and set by the caller: A, then L; each block by columns.
                        Solves do not use it. */
  float *factor; /* L rounded, with inverted diagonal blocks; the same layout */
  double *packed; /* block n: a vector in the elimination order */
  const struct ms_block_kernels *kernels;
} ms_block_cholesky;

/* block: scalars in each block row, 8 or 12; isa: base/isa.h; most: if the factor would have
 * more numbers, chol is empty */
msim_status ms_block_cholesky_create(const msim_allocator *alloc, const ms_sparse_graph *graph,
                                     int32_t block, int isa, double most, ms_block_cholesky *chol,
                                     msim_error *err);
void ms_block_cholesky_destroy(const msim_allocator *alloc, ms_block_cholesky *chol);

/* The length of `value` and `factor`; 0 before creation */
static inline size_t ms_block_cholesky_size(const ms_block_cholesky *chol) {
  return chol->first ? (size_t)(chol->block * chol->block) * (size_t)chol->first[chol->n] : 0;
}

/* The index of block (i, j) in `value`, i and j in the caller's order; it is A_ij where
 * position[i] >= position[j], otherwise A_ji. -1: not in the pattern. */
int32_t ms_block_cholesky_find(const ms_block_cholesky *chol, int32_t i, int32_t j);

/* Factor A, given in `value`; the upper triangles of diagonal blocks are not read. MSIM_NOT_SPD: A
 * is not positive definite, and there is no factor. */
msim_status ms_block_cholesky_factor(ms_block_cholesky *chol);

/* x = A^-1 x, in the caller's order, `block` scalars per block row */
void ms_block_cholesky_solve(const ms_block_cholesky *chol, double *x);

#endif
