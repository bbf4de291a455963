/* This file is compiled once per instruction set, MS_ISA. */
#include "linear/rank_modes_kernels.h"

#include "base/simd.h"
#include "linear/rank_patches.h"

MS_INLINE ms_quad weights_of(const ms_rank_modes *q, size_t row) {
  return ms_simd_load_quad(q->weight[row]);
}

/*------------------------------------- the matrix -----------------------------------------------*/

static void get_diagonal_block(const ms_model *model, const ms_coefficients *a, double by,
                               int32_t row, double block[3][3]) {
  const size_t sd = (size_t)model->unknowns.first_pinned, dims = (size_t)model->unknowns.dims;
  for (size_t b = 0; b < dims; b++)
    for (size_t c = 0; c < dims; c++) {
      const size_t at = a->block == 1 ? 0 : ms_coefficients_diagonal_element(dims, b, c);
      block[b][c] = a->block == 1 && b != c ? 0 : by * a->diagonal[at * sd + (size_t)row];
    }
}

/* -(t I + g d d^T) of a half-edge of row i (force.h), g = 0 where A is scalar; dims is a constant
 * where this is inlined */
MS_INLINE void get_spring_block(size_t dims, const ms_model *model, const ms_coefficients *a,
                                double by, int32_t i, int32_t at, double block[3][3]) {
  const size_t stride = (size_t)model->unknowns.stride;
  const size_t j = (size_t)ms_half_edges_neighbour(&model->half_edges, at);
  const int is_scalar = a->block == 1;
  const double t = -by * a->t[at], g = is_scalar ? 0 : -by * a->g[at];
  double d[3];
  for (size_t c = 0; c < dims; c++)
    d[c] = is_scalar ? 0 : a->x[c * stride + j] - a->x[c * stride + (size_t)i];
  for (size_t b = 0; b < dims; b++)
    for (size_t c = 0; c < dims; c++) block[b][c] = g * d[b] * d[c] + (b == c ? t : 0);
}

/* sum += block (weights of row j), for a row j of the same patch; blocks are symmetric: b <= c */
MS_INLINE void add_own_column(size_t dims, const ms_rank_modes *q, int32_t j, double block[3][3],
                              ms_quad sum[3][3]) {
  const ms_quad w = weights_of(q, (size_t)j);
  for (size_t b = 0; b < dims; b++)
    for (size_t c = b; c < dims; c++) sum[b][c] += block[b][c] * w;
}

/* The diagonal block of the patch of row i += (weights of row i) sum */
MS_INLINE void add_own_row(size_t dims, ms_rank_modes *q, int32_t i, ms_quad sum[3][3]) {
  const size_t modes = MS_MODES, n = (size_t)q->chol.block;
  const ms_quad w = weights_of(q, (size_t)i);
  double *diagonal = ms_rank_modes_find_block(q, i, i);
  for (size_t c = 0; c < dims; c++)
    for (size_t l = 0; l < modes; l++)
      for (size_t b = 0; b < dims; b++) {
        const ms_quad product = w * sum[b < c ? b : c][b < c ? c : b][l];
        double *to = diagonal + n * (modes * c + l) + modes * b;
        for (size_t k = 0; k < modes; k++) to[k] += product[k];
      }
}

/* Most columns are of the same patch: they are added up before the weights of the row multiply
 * them. */
MS_INLINE void add_row(size_t dims, int with_own, ms_rank_modes *q, const ms_coefficients *a,
                       double by, int32_t i) {
  const ms_model *model = q->model;
  const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, i);
  double block[3][3] = {{0}};
  ms_quad sum[3][3] = {{{0}}};
  if (q->patch[i] < 0) return;
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t j = ms_half_edges_neighbour(&model->half_edges, at);
    const int is_own = j < model->unknowns.nfree;
    if (model->half_edges.spring[at] < 0 || j >= model->unknowns.first_fixed) continue;
    if (is_own && !with_own) continue;
    get_spring_block(dims, model, a, by, i, at, block);
    if (is_own && q->patch[j] == q->patch[i]) add_own_column(dims, q, j, block, sum);
    else ms_rank_modes_add_block(q, i, j, block);
  }
  if (!with_own) return;
  get_diagonal_block(model, a, by, i, block);
  add_own_column(dims, q, i, block, sum);
  add_own_row(dims, q, i, sum);
}

MS_INLINE void add_rows_of(size_t dims, ms_rank_modes *q, const ms_coefficients *a, double by,
                           int with_own) {
  if (with_own)
    for (int32_t i = 0; i < q->model->unknowns.nfree; i++) add_row(dims, 1, q, a, by, i);
  else
    for (int32_t k = 0; k < q->nborder; k++) add_row(dims, 0, q, a, by, q->border[k]);
}

static void add_rows(ms_rank_modes *q, const ms_coefficients *a, double by, int with_own) {
  if (q->model->unknowns.dims == 3) add_rows_of(3, q, a, by, with_own);
  else add_rows_of(2, q, a, by, with_own);
}

/*------------------------------------- vectors --------------------------------------------------*/

static void restrict_to(const ms_rank_modes *q, ms_operands rz, double *sums) {
  const ms_unknowns *rows = &q->model->unknowns;
  const int32_t first = ms_rank_modes_first(q), n = ms_rank_modes_count(q);
  for (int32_t c = 0; c < rows->dims; c++) {
    ms_quad sum[MS_MOST_PATCHES] = {{0}};
    for (int32_t i = 0; i < rows->nfree; i++) {
      const double r = ms_operands_get(&rz, (size_t)(c * rows->stride + i));
      if (q->patch[i] >= 0) sum[q->patch[i] - first] += weights_of(q, (size_t)i) * r;
    }
    for (int32_t p = 0; p < n; p++)
      ms_simd_store_quad(sums + q->chol.block * p + MS_MODES * c, sum[p]);
  }
}

static void correct(const ms_rank_modes *q, const double *by, ms_operands rz) {
  const ms_unknowns *rows = &q->model->unknowns;
  const int32_t first = ms_rank_modes_first(q);
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t i = 0; i < rows->nfree; i++) {
      if (q->patch[i] < 0) continue;
      const double *w = q->weight[i],
                   *b = by + q->chol.block * (q->patch[i] - first) + MS_MODES * c;
      ms_operands_add(&rz, (size_t)(c * rows->stride + i),
                      (w[0] * b[0] + w[1] * b[1]) + (w[2] * b[2] + w[3] * b[3]));
    }
}

const ms_rank_modes_kernels MS_TABLE(ms_rank_modes_kernels) = {add_rows, restrict_to, correct};
