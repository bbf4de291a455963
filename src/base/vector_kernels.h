/* vector_kernels - the vector sums that every step takes, one set for each instruction set */
#ifndef MS_VECTOR_KERNELS_H
#define MS_VECTOR_KERNELS_H

#include "base/isa.h"
#include "base/vector.h"

/* As vector.h has them; no bit depends on the instruction set. */
typedef struct ms_vector_kernels {
  void (*add_all)(ms_shape s, const double *x, int n, const double *w, const double *const *y,
                  double *z);
  /* 1 if no number is NaN or beyond MS_HUGE; 0: some may be */
  int (*is_good)(ms_shape s, const double *x);
} ms_vector_kernels;

#endif
