/* block_kernels - dense arithmetic on blocks of 8 x 8 or 12 x 12, by columns; one table for each
 * instruction set, all with the same bits */
#ifndef MS_BLOCK_KERNELS_H
#define MS_BLOCK_KERNELS_H

#include "base/isa.h"
#include "linear/block_cholesky.h"

typedef struct ms_block_kernels {
  /* Replace the lower triangle of a by L, a = L L^T; inverse = L^-1, with zeros above the
   * diagonal. Returns 0 if a pivot is not positive. */
  int (*invert_factor)(size_t block, double *a, double *inverse);
  /* a = a b^T, and `rounded` the same in single precision */
  void (*times_transpose)(size_t block, double *a, const double *b, float *rounded);
  /* target -= a b^T */
  void (*subtract_product)(size_t block, const double *a, const double *b, double *target);
  /* x = (L L^T)^-1 x by chol->factor, in the elimination order */
  void (*solve)(const ms_block_cholesky *chol, double *x);
} ms_block_kernels;

#endif
