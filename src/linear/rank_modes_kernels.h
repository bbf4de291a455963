/* rank_modes_kernels - loops over the unknowns of rank_modes.h: one table per instruction set */
#ifndef MS_RANK_MODES_KERNELS_H
#define MS_RANK_MODES_KERNELS_H

#include "base/isa.h"
#include "linear/rank_modes.h"

enum { MS_RANK_NO_BLOCK = -1 };

typedef struct ms_rank_modes_kernels {
  /* own blocks += the part of Q^T (by A) Q of springs, masses, drag and force functions; without
   * that of this rank alone unless with_own */
  void (*add_rows)(ms_rank_modes *modes, const ms_coefficients *a, double by, int with_own);
  /* sums = Q^T r, by component */
  void (*restrict_to)(const ms_rank_modes *modes, ms_operands rz, double *sums);
  /* z += Q c */
  void (*correct)(const ms_rank_modes *modes, const double *c, ms_operands rz);
} ms_rank_modes_kernels;

/* Own blocks += (weights of row i) block (weights of row j), by columns */
static inline void ms_rank_modes_add_block(ms_rank_modes *q, int32_t i, int32_t j,
                                           double block[3][3]) {
  const int32_t dims = q->model->unknowns.dims, modes = MS_MODES, n = q->chol.block;
  const double *wi = q->weight[i];
  const double *wj = q->weight[j];
  if (q->index[q->rank[j]] == MS_RANK_NO_BLOCK) return;
  double *to = q->own + (size_t)(n * n) * (size_t)q->index[q->rank[j]];
  for (int32_t c = 0; c < dims; c++)
    for (int32_t l = 0; l < modes; l++)
      for (int32_t b = 0; b < dims; b++)
        for (int32_t k = 0; k < modes; k++)
          to[n * (modes * c + l) + modes * b + k] += wi[k] * block[b][c] * wj[l];
}

#endif
