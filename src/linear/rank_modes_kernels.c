/* This file is compiled once per instruction set, MS_ISA. */
#include "linear/rank_modes_kernels.h"

#include "base/simd.h"

MS_INLINE ms_quad weights_of(const ms_rank_modes *q, size_t row) {
  return ms_simd_load_quad(q->weight + MS_RANK_WEIGHTS * row);
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
  const size_t j = (size_t)model->half_edges.neighbour[at];
  const int is_scalar = a->block == 1;
  const double t = -by * a->t[at], g = is_scalar ? 0 : -by * a->g[at];
  double d[3];
  for (size_t c = 0; c < dims; c++)
    d[c] = is_scalar ? 0 : a->x[c * stride + j] - a->x[c * stride + (size_t)i];
  for (size_t b = 0; b < dims; b++)
    for (size_t c = 0; c < dims; c++) block[b][c] = g * d[b] * d[c] + (b == c ? t : 0);
}

/* sum += block (weights of row j), for a row j of this rank; blocks are symmetric: b <= c */
MS_INLINE void add_own_column(size_t dims, const ms_rank_modes *q, int32_t j, double block[3][3],
                              ms_quad sum[3][3]) {
  const ms_quad w = weights_of(q, (size_t)j);
  for (size_t b = 0; b < dims; b++)
    for (size_t c = b; c < dims; c++) sum[b][c] += block[b][c] * w;
}

/* The diagonal block of this rank, the first own one, += (weights of row i) sum */
MS_INLINE void add_own_row(size_t dims, ms_rank_modes *q, int32_t i, ms_quad sum[3][3]) {
  const size_t modes = 1 + dims, n = (size_t)q->chol.block;
  const ms_quad w = weights_of(q, (size_t)i);
  for (size_t c = 0; c < dims; c++)
    for (size_t l = 0; l < modes; l++)
      for (size_t b = 0; b < dims; b++) {
        const ms_quad product = w * sum[b < c ? b : c][b < c ? c : b][l];
        double *to = q->own + n * (modes * c + l) + modes * b;
        for (size_t k = 0; k < modes; k++) to[k] += product[k];
      }
}

/* Most columns are own ones: they are added up before the weights of the row multiply them. */
MS_INLINE void add_row(size_t dims, ms_rank_modes *q, const ms_coefficients *a, double by,
                       int32_t i) {
  const ms_model *model = q->model;
  const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, i);
  double block[3][3];
  ms_quad sum[3][3] = {{{0}}};
  get_diagonal_block(model, a, by, i, block);
  add_own_column(dims, q, i, block, sum);
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t j = model->half_edges.neighbour[at];
    if (model->half_edges.spring[at] < 0 || j >= model->unknowns.first_fixed) continue;
    get_spring_block(dims, model, a, by, i, at, block);
    if (j < model->unknowns.nfree) add_own_column(dims, q, j, block, sum);
    else ms_rank_modes_add_block(q, i, j, block);
  }
  add_own_row(dims, q, i, sum);
}

static void add_rows(ms_rank_modes *q, const ms_coefficients *a, double by) {
  for (int32_t i = 0; i < q->model->unknowns.nfree; i++) {
    if (q->model->unknowns.dims == 3) add_row(3, q, a, by, i);
    else add_row(2, q, a, by, i);
  }
}

/*------------------------------------- vectors --------------------------------------------------*/

/* In planar scenes the last component is summed twice. rz.single is a constant where this is
 * inlined. */
MS_INLINE void restrict_vector(const ms_rank_modes *q, ms_operands rz,
                               double sums[3][MS_RANK_WEIGHTS]) {
  const ms_unknowns *rows = &q->model->unknowns;
  const size_t second = (size_t)rows->stride, last = (size_t)(rows->dims - 1) * second;
  ms_quad sum[3] = {{0}};
  for (size_t i = 0; i < (size_t)rows->nfree; i++) {
    const ms_quad w = weights_of(q, i);
    sum[0] += w * ms_operands_get(&rz, i);
    sum[1] += w * ms_operands_get(&rz, second + i);
    sum[2] += w * ms_operands_get(&rz, last + i);
  }
  for (int c = 0; c < 3; c++) ms_simd_store_quad(sums[c], sum[c]);
}

static void restrict_to(const ms_rank_modes *q, ms_operands rz, double sums[3][MS_RANK_WEIGHTS]) {
  if (rz.single) restrict_vector(q, (ms_operands){rz.x, NULL, 1}, sums);
  else restrict_vector(q, (ms_operands){rz.x, NULL, 0}, sums);
}

/* Lanes are components. */
MS_INLINE void correct_vector(const ms_rank_modes *q, double by[3][MS_RANK_WEIGHTS],
                              ms_operands rz) {
  const ms_unknowns *rows = &q->model->unknowns;
  const size_t stride = (size_t)rows->stride;
  ms_quad column[MS_RANK_WEIGHTS];
  for (int k = 0; k < MS_RANK_WEIGHTS; k++) column[k] = (ms_quad){by[0][k], by[1][k], by[2][k]};
  for (size_t i = 0; i < (size_t)rows->nfree; i++) {
    const double *w = q->weight + MS_RANK_WEIGHTS * i;
    const ms_quad sum =
        (w[0] * column[0] + w[1] * column[1]) + (w[2] * column[2] + w[3] * column[3]);
    ms_operands_add(&rz, i, sum[0]), ms_operands_add(&rz, stride + i, sum[1]);
    if (rows->dims == 3) ms_operands_add(&rz, 2 * stride + i, sum[2]);
  }
}

static void correct(const ms_rank_modes *q, double by[3][MS_RANK_WEIGHTS], ms_operands rz) {
  if (rz.single) correct_vector(q, by, (ms_operands){NULL, rz.y, 1});
  else correct_vector(q, by, (ms_operands){NULL, rz.y, 0});
}

const ms_rank_modes_kernels MS_TABLE(ms_rank_modes_kernels) = {add_rows, restrict_to, correct};
