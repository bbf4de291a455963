/* block_cholesky - L L^T of a small sparse symmetric matrix of dense blocks
 *
 * For coarse matrices: hundreds to thousands of block rows, blocks of 8 x 8 or 12 x 12 scalars.
 * The order is minimum degree on the graph of the blocks (Tinney and Walker 1967), which finds the
 * pattern of the factor on its way. The factor is right-looking, a block column at a time; it is
 * kept in single precision, which is enough for a preconditioner and half as much to read. */
#ifndef MS_BLOCK_CHOLESKY_H
#define MS_BLOCK_CHOLESKY_H

#include "base/memory.h"
#include "msim/status.h"

enum { MS_LARGEST_BLOCK = 12 };

typedef struct ms_block_cholesky {
  int32_t n, block;  /* block rows; scalars in each, 8 or 12 */
  int32_t *position; /* n: where each row comes in the order of elimination */
  int32_t *first;    /* n + 1: the blocks of each column, in that order */
  int32_t *row;      /* first[n]: their rows, in that order, ascending; the diagonal comes first */
  double *value;     /* block^2 first[n]: A, then L; each block by columns */
  float *factor;     /* the same; diagonal blocks inverted */
  double *packed;    /* block n: a vector in that order */
  const struct ms_block_kernels *kernels;
} ms_block_cholesky;

/* ptr: n + 1, ind: both triangles, without the diagonal, no entry twice. */
msim_status ms_block_cholesky_create(const msim_allocator *alloc, int32_t n, int32_t block,
                                     const int32_t *ptr, const int32_t *ind, int isa,
                                     ms_block_cholesky *chol, msim_error *err);
void ms_block_cholesky_destroy(const msim_allocator *alloc, ms_block_cholesky *chol);

/* The number of the block (i, j) of A, i and j in the caller's order; it holds A_ij where
 * position[i] >= position[j], otherwise A_ji. -1: not in the pattern. */
int32_t ms_block_cholesky_find(const ms_block_cholesky *chol, int32_t i, int32_t j);

/* From A in value; the upper triangles of diagonal blocks are not read. MSIM_NOT_SPD: no factor. */
msim_status ms_block_cholesky_factor(ms_block_cholesky *chol);

/* x = A^-1 x, in the caller's order, block scalars a row. */
void ms_block_cholesky_solve(const ms_block_cholesky *chol, double *x);

#endif
