/* coarse_cycle_kernels - loops of coarse_cycle.h over blocks: one table per instruction set */
#ifndef MS_COARSE_CYCLE_KERNELS_H
#define MS_COARSE_CYCLE_KERNELS_H

#include "base/isa.h"
#include "linear/coarse_cycle.h"

/* Each computes what one place p of an aggregate, or one cluster, contributes, and writes to no
 * other's. */
typedef struct ms_coarse_cycle_kernels {
  /* chol.value += the blocks of Q^T A Q that the cluster owns */
  void (*add_products)(ms_coarse_cycle *cycle, int32_t cluster);
  /* r = L^-1 of the caller's r */
  void (*scale)(ms_coarse_cycle *cycle, const double *r, int32_t p);
  /* c = f Q^T of the residual after the first smoothing */
  void (*restrict_cluster)(ms_coarse_cycle *cycle, int32_t cluster);
  /* z = that smoothing, and the correction */
  void (*correct_cluster)(ms_coarse_cycle *cycle, int32_t cluster);
  /* z of the caller = L^-T of the second smoothing */
  void (*finish)(const ms_coarse_cycle *cycle, double *z, int32_t p);
} ms_coarse_cycle_kernels;

#endif
