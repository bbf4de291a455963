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
  /* sums = Q^T r, by patch and component */
  void (*restrict_to)(const ms_rank_modes *modes, ms_operands rz, double *sums);
  /* z += Q c */
  void (*correct)(const ms_rank_modes *modes, const double *c, ms_operands rz);
} ms_rank_modes_kernels;

/* The block of an own unknown i and an unknown or ghost j; NULL: there is none */
static inline double *ms_rank_modes_find_block(const ms_rank_modes *q, int32_t i, int32_t j) {
  if (q->patch[i] < 0 || q->patch[j] < 0) return NULL;
  const int32_t row = q->patch[i] - ms_rank_modes_first(q);
  const int32_t index = q->index[row * q->chol.n + q->patch[j]];
  const size_t area = (size_t)(q->chol.block * q->chol.block);
  return index == MS_RANK_NO_BLOCK ? NULL : q->own + area * (size_t)index;
}

/* Own blocks += (weights of row i) block (weights of row j), by columns */
static inline void ms_rank_modes_add_block(ms_rank_modes *q, int32_t i, int32_t j,
                                           double block[3][3]) {
  const int32_t dims = q->model->unknowns.dims, modes = MS_MODES, n = q->chol.block;
  const double *wi = q->weight[i];
  const double *wj = q->weight[j];
  double *to = ms_rank_modes_find_block(q, i, j);
  if (!to) return;
  for (int32_t c = 0; c < dims; c++)
    for (int32_t l = 0; l < modes; l++)
      for (int32_t b = 0; b < dims; b++)
        for (int32_t k = 0; k < modes; k++)
          to[n * (modes * c + l) + modes * b + k] += wi[k] * block[b][c] * wj[l];
}

#endif
