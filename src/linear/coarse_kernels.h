/* coarse_kernels - restriction and Galerkin product of coarse.h: one table per instruction set */
#ifndef MS_COARSE_KERNELS_H
#define MS_COARSE_KERNELS_H

#include "base/isa.h"
#include "linear/coarse.h"

typedef struct ms_coarse_kernels {
  /* chol.value += the part of P^T A P that the unknowns of one aggregate contribute */
  void (*assemble)(ms_coarse *coarse, const float *coefficients, const double *inertia,
                   int32_t aggregate);
  /* coarse->r = P^T r, for one aggregate */
  void (*restrict_to)(ms_coarse *coarse, const double *r, int32_t aggregate);
} ms_coarse_kernels;

#endif
