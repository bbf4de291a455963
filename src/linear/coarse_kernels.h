/* coarse_kernels - restriction and Galerkin product of coarse.h: one table per instruction set */
#ifndef MS_COARSE_KERNELS_H
#define MS_COARSE_KERNELS_H

#include "base/isa.h"
#include "linear/coarse.h"

typedef struct ms_coarse_kernels {
  /* value += the part of P^T A P that the unknowns of one aggregate contribute */
  void (*assemble)(ms_coarse *coarse, const float *coefficients, const double *inertia,
                   int32_t aggregate);
  /* The sums of restriction.h of a chunk, rows [begin, end); r: of doubles, or of floats if
   * `single` */
  void (*restrict_rows)(ms_coarse *coarse, int single, const void *r, size_t begin, size_t end);
  /* coarse->r = P^T r, for one aggregate, from the sums of its parts */
  void (*add_parts)(ms_coarse *coarse, int32_t aggregate);
} ms_coarse_kernels;

#endif
