/* vector_kernels - the vector operations of every step, compiled for each instruction set */
#ifndef MS_VECTOR_KERNELS_H
#define MS_VECTOR_KERNELS_H

#include "base/isa.h"
#include "base/vector.h"

/* Functions of vector.h; their results do not depend on the instruction set. */
typedef struct ms_vector_kernels {
  /* sums: 1 or 2 */
  void (*combinations)(ms_shape s, int n, const double *const *y, int sums,
                       const ms_combination *of);
  /* 1: no number is NaN or beyond MS_LARGEST_VALID; 0: some may be */
  int (*is_valid)(ms_shape s, const double *x);
} ms_vector_kernels;

#endif
