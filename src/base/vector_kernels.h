/* vector_kernels - the vector operations of every step, compiled for each instruction set */
#ifndef MS_VECTOR_KERNELS_H
#define MS_VECTOR_KERNELS_H

#include "base/isa.h"
#include "base/vector.h"

/* Functions of vector.h; their results do not depend on the instruction set. */
typedef struct ms_vector_kernels {
  void (*linear_combination)(ms_shape s, const double *x, int n, const double *w,
                             const double *const *y, double *z);
  /* 1: no number is NaN or beyond MS_LARGEST_VALID; 0: some may be */
  int (*is_valid)(ms_shape s, const double *x);
} ms_vector_kernels;

#endif
