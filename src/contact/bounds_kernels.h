/* bounds_kernels - bounds on the particles of some rows, for broad_phase.h */
#ifndef MS_BOUNDS_KERNELS_H
#define MS_BOUNDS_KERNELS_H

#include "base/isa.h"
#include "base/vector.h"

typedef struct ms_bounds_kernels {
  /* The least and the largest number of each component in rows [begin, end), NaN left out */
  void (*bound)(ms_shape s, const double *x, int32_t begin, int32_t end, double *low, double *high);
} ms_bounds_kernels;

#endif
