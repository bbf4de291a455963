#include "linear/coarse_overlap.h"

#include <math.h>
#include <string.h>

#include "base/ranks.h"
#include "linear/modes.h"
#include "linear/rank_patches.h"

static const char WHAT[] = "the affine motions of the rank";

/*------------------------------------- creation -------------------------------------------------*/

/* An aggregate is connected, and so in one patch. For splitting, it is where its first unknown is.
 * Returns 0 if memory is exhausted. */
static int find_patches(const ms_coarse *coarse, struct ms_coarse_overlap *q) {
  const ms_aggregates *a = &coarse->aggregates;
  const ms_model *model = coarse->model;
  const msim_allocator *alloc = &model->scene->alloc;
  ms_rank_places at = {.n = a->n, .x = model->scene->x};
  int32_t *of = NULL;
  if (MS_NEW(alloc, of, model->unknowns.nfree) && MS_NEW(alloc, at.particle, a->n))
    q->n = ms_rank_patches_find(model, of);
  for (int32_t k = 0; k < a->n && q->n; k++) {
    q->patch[k] = of[a->unknown[a->first[k]]];
    at.particle[k] = model->unknowns.particle[a->unknown[a->first[k]]];
  }
  if (q->n) q->n = ms_rank_patches_split(q->n, model->shape.ranks->n, at, q->patch);
  MS_FREE(alloc, of, at.particle);
  return q->n > 0;
}

/* R = W^T of the affine functions, W the modes of the aggregates, orthonormal like these. Returns 0
 * if memory is exhausted. */
static int find_motions(const ms_coarse *coarse, struct ms_coarse_overlap *q) {
  const ms_aggregates *a = &coarse->aggregates;
  const msim_allocator *alloc = &coarse->model->scene->alloc;
  double(*room)[MS_MODES] = NULL;
  if (!MS_NEW(alloc, room, MS_MODES * (size_t)a->n)) return 0;
  for (int32_t i = 0; i < a->first[a->n]; i++) {
    const int32_t row = a->unknown[i];
    double f[MS_MODES];
    ms_modes_affine_functions(coarse->model, row, f);
    for (int m = 0; m < MS_MODES; m++)
      for (int k = 0; k < MS_MODES; k++)
        q->motions[MS_MODES * a->of[row] + m][k] += (double)a->weight[MS_MODES * row + m] * f[k];
  }
  ms_rank_patches_orthonormalise(q->n, q->patch, MS_MODES, MS_MODES * a->n, q->motions, room);
  ms_memory_free(alloc, room);
  return 1;
}

/* Connected aggregates are both in patches, or neither is. */
static void list_links(const ms_coarse *coarse, const ms_sparse_graph *graph,
                       struct ms_coarse_overlap *q) {
  for (int32_t i = 0; i < graph->n; i++)
    for (int32_t at = graph->ptr[i]; at < graph->ptr[i + 1]; at++) {
      const int32_t j = graph->ind[at];
      if (q->patch[i] < 0 || coarse->position[i] < coarse->position[j]) continue;
      int32_t *link = q->links[q->nlinks++];
      link[0] = i, link[1] = j, link[2] = ms_coarse_find(coarse, i, j);
    }
}

/* The pattern of R^T A R, and room for it */
static msim_status create_matrix(const ms_coarse *coarse, struct ms_coarse_overlap *q,
                                 msim_error *err) {
  const msim_allocator *alloc = &coarse->model->scene->alloc;
  int32_t ptr[MS_MOST_PATCHES + 1] = {0}, ind[MS_MOST_PATCHES * MS_MOST_PATCHES];
  int is_linked[MS_MOST_PATCHES][MS_MOST_PATCHES] = {{0}};
  const ms_sparse_graph graph = {.n = q->n, .ptr = ptr, .ind = ind};
  for (int32_t k = 0; k < q->nlinks; k++) {
    const int32_t p = q->patch[q->links[k][0]], other = q->patch[q->links[k][1]];
    if (p != other) is_linked[p][other] = is_linked[other][p] = 1;
  }
  for (int32_t p = 0; p < q->n; p++) {
    ptr[p + 1] = ptr[p];
    for (int32_t other = 0; other < q->n; other++)
      if (is_linked[p][other]) ind[ptr[p + 1]++] = other;
  }
  const msim_status status =
      ms_block_cholesky_create(alloc, &graph, MS_MODES * coarse->model->unknowns.dims,
                               coarse->model->isa, INFINITY, &q->chol, err);
  const size_t size = ms_block_cholesky_size(&q->chol);
  if (status) return status;
  if (!MS_NEW(alloc, q->matrix, 2 * size)) return ms_error_set_memory(err, WHAT);
  q->chol.value = q->matrix + size;
  return MSIM_OK;
}

msim_status ms_coarse_overlap_create(const ms_coarse *coarse, const ms_sparse_graph *graph,
                                     struct ms_coarse_overlap **overlap, msim_error *err) {
  const msim_allocator *alloc = &coarse->model->scene->alloc;
  const size_t block = MS_MODES * (size_t)coarse->model->unknowns.dims;
  struct ms_coarse_overlap *q = *overlap = ms_memory_allocate(alloc, 1, sizeof *q);
  if (!q || !MS_NEW(alloc, q->patch, graph->n) || !find_patches(coarse, q) ||
      !MS_NEW(alloc, q->motions, MS_MODES * (size_t)graph->n) || !find_motions(coarse, q) ||
      !MS_NEW(alloc, q->links, graph->ptr[graph->n]) || !MS_NEW(alloc, q->b, block * (size_t)q->n))
    return ms_error_set_memory(err, WHAT);
  list_links(coarse, graph, q);
  return create_matrix(coarse, q, err);
}

void ms_coarse_overlap_destroy(const msim_allocator *alloc, struct ms_coarse_overlap *q) {
  if (!q) return;
  ms_block_cholesky_destroy(alloc, &q->chol);
  MS_FREE(alloc, q->patch, q->motions, q->links, q->matrix, q->b, q);
}

void ms_coarse_overlap_weights(const ms_coarse *coarse, int32_t row, double weight[MS_MODES]) {
  const int32_t of = coarse->aggregates.of[row];
  for (int k = 0; k < MS_MODES; k++) {
    weight[k] = 0;
    for (int m = 0; m < MS_MODES && of >= 0; m++)
      weight[k] += (double)coarse->aggregates.weight[MS_MODES * row + m] *
                   coarse->overlap->motions[MS_MODES * of + m][k];
  }
}

/*------------------------------------- the matrix -----------------------------------------------*/

/* sum += R_i^T block R_j, all by columns */
static void add_product(size_t n, const double *block, double (*ri)[MS_MODES],
                        double (*rj)[MS_MODES], double *sum) {
  for (size_t c = 0; c < n; c += MS_MODES)
    for (size_t d = 0; d < n; d += MS_MODES)
      for (size_t i = 0; i < MS_MODES; i++) {
        double row[MS_MODES] = {0};
        for (size_t j = 0; j < MS_MODES; j++)
          for (size_t l = 0; l < MS_MODES; l++) row[l] += block[n * (d + j) + c + i] * rj[j][l];
        for (size_t l = 0; l < MS_MODES; l++)
          for (size_t k = 0; k < MS_MODES; k++) sum[n * (d + l) + c + k] += ri[i][k] * row[l];
      }
}

/* The lower triangle of a diagonal block and its transpose */
static void mirror(size_t n, const double *lower, double *block) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = j; i < n; i++) block[n * j + i] = block[n * i + j] = lower[n * j + i];
}

/* to += block, or its transpose */
static void add_block(size_t n, const double *block, int transposed, double *to) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < n; i++) to[n * j + i] += block[transposed ? n * i + j : n * j + i];
}

static int is_transposed(const struct ms_coarse_overlap *q, int32_t row, int32_t column) {
  return q->chol.position[row] < q->chol.position[column];
}

/* matrix += the block of a pair of aggregates, R_i^T A_ij R_j, and within a patch its transpose */
static void add_link(const ms_coarse *coarse, const int32_t link[3]) {
  const struct ms_coarse_overlap *q = coarse->overlap;
  const size_t n = (size_t)q->chol.block, area = n * n;
  const int32_t row = q->patch[link[0]], column = q->patch[link[1]];
  double product[MS_BLOCK_CHOLESKY_MAX_BLOCK * MS_BLOCK_CHOLESKY_MAX_BLOCK] = {0};
  double *to = q->matrix + area * (size_t)ms_block_cholesky_find(&q->chol, row, column);
  add_product(n, coarse->value + area * (size_t)link[2], q->motions + MS_MODES * link[0],
              q->motions + MS_MODES * link[1], product);
  add_block(n, product, is_transposed(q, row, column), to);
  if (row == column) add_block(n, product, 1, to);
}

/* Motions that do not depend on coordinates have zeros: 1 on the diagonal makes them harmless. */
static void compute_matrix(const ms_coarse *coarse) {
  const struct ms_coarse_overlap *q = coarse->overlap;
  const size_t n = (size_t)q->chol.block, area = n * n;
  double block[MS_BLOCK_CHOLESKY_MAX_BLOCK * MS_BLOCK_CHOLESKY_MAX_BLOCK];
  memset(q->matrix, 0, ms_block_cholesky_size(&q->chol) * sizeof *q->matrix);
  for (int32_t k = 0; k < coarse->aggregates.n; k++) {
    if (q->patch[k] < 0) continue;
    const int32_t at = ms_block_cholesky_find(&q->chol, q->patch[k], q->patch[k]);
    mirror(n, coarse->value + area * (size_t)coarse->diagonal[k], block);
    add_product(n, block, q->motions + MS_MODES * k, q->motions + MS_MODES * k,
                q->matrix + area * (size_t)at);
  }
  for (int32_t k = 0; k < q->nlinks; k++) add_link(coarse, q->links[k]);
  for (int32_t p = 0; p < q->n; p++) {
    double *diagonal = q->matrix + area * (size_t)ms_block_cholesky_find(&q->chol, p, p);
    for (size_t i = 0; i < n; i++)
      if (diagonal[n * i + i] == 0) diagonal[n * i + i] = 1;
  }
}

void ms_coarse_overlap_factor(const ms_coarse *coarse) {
  struct ms_coarse_overlap *q = coarse->overlap;
  compute_matrix(coarse);
  memcpy(q->chol.value, q->matrix, ms_block_cholesky_size(&q->chol) * sizeof *q->matrix);
  q->is_factored = !ms_block_cholesky_factor(&q->chol);
}

void ms_coarse_overlap_get_block(const struct ms_coarse_overlap *q, int32_t row, int32_t column,
                                 double *block) {
  const size_t n = (size_t)q->chol.block, area = n * n;
  memset(block, 0, area * sizeof *block);
  add_block(n, q->matrix + area * (size_t)ms_block_cholesky_find(&q->chol, row, column),
            is_transposed(q, row, column), block);
}

/*------------------------------------- solution -------------------------------------------------*/

void ms_coarse_overlap_restrict(const ms_coarse *coarse) {
  const struct ms_coarse_overlap *q = coarse->overlap;
  const int32_t dims = coarse->model->unknowns.dims;
  const double *r = coarse->r;
  memset(q->b, 0, (size_t)(q->n * q->chol.block) * sizeof *q->b);
  for (int32_t g = 0; g < coarse->aggregates.n; g++) {
    double *b = q->b + (q->patch[g] < 0 ? 0 : q->chol.block * q->patch[g]); /* R = 0 if none */
    for (int32_t c = 0; c < dims; c++)
      for (int32_t m = 0; m < MS_MODES; m++, r++)
        for (int32_t k = 0; k < MS_MODES; k++)
          b[MS_MODES * c + k] += q->motions[MS_MODES * g + m][k] * *r;
  }
}

void ms_coarse_overlap_add(const ms_coarse *coarse, const double *by) {
  const struct ms_coarse_overlap *q = coarse->overlap;
  const int32_t dims = coarse->model->unknowns.dims;
  double *z = coarse->z;
  for (int32_t g = 0; g < coarse->aggregates.n; g++) {
    const double *of = by + (q->patch[g] < 0 ? 0 : q->chol.block * q->patch[g]);
    for (int32_t c = 0; c < dims; c++)
      for (int32_t m = 0; m < MS_MODES; m++, z++)
        for (int32_t k = 0; k < MS_MODES; k++)
          *z += q->motions[MS_MODES * g + m][k] * of[MS_MODES * c + k];
  }
}

void ms_coarse_overlap_subtract(const ms_coarse *coarse) {
  const struct ms_coarse_overlap *q = coarse->overlap;
  double c[MS_MOST_PATCHES * MS_BLOCK_CHOLESKY_MAX_BLOCK];
  if (!q->is_factored) return;
  memcpy(c, q->b, (size_t)(q->n * q->chol.block) * sizeof *c);
  ms_block_cholesky_solve(&q->chol, c);
  for (int32_t i = 0; i < q->n * q->chol.block; i++) c[i] = -c[i];
  ms_coarse_overlap_add(coarse, c);
}
