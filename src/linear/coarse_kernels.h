/* coarse_kernels - loops between rows and aggregates, one set for each instruction set */
#ifndef MS_COARSE_KERNELS_H
#define MS_COARSE_KERNELS_H

#include "base/isa.h"
#include "linear/coarse.h"

typedef struct ms_coarse_kernels {
  /* chol.value += the rows of one aggregate of P^T A P */
  void (*assemble)(ms_coarse *coarse, const float *coefficients, const double *inertia,
                   int32_t aggregate);
  /* the part of P^T r of one aggregate */
  void (*restrict_to)(ms_coarse *coarse, const double *r, int32_t aggregate);
} ms_coarse_kernels;

#endif
