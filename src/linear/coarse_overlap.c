#include "linear/coarse_overlap.h"

#include <string.h>

#include "linear/modes.h"
#include "linear/rank_patches.h"

/*------------------------------------- creation -------------------------------------------------*/

/* An aggregate is connected, and so in one patch. Returns 0 if memory is exhausted. */
static int find_patches(const ms_coarse *coarse, struct ms_coarse_overlap *q) {
  const ms_aggregates *a = &coarse->aggregates;
  const msim_allocator *alloc = &coarse->model->scene->alloc;
  int32_t *of = NULL;
  if (MS_NEW(alloc, of, coarse->model->unknowns.nfree))
    q->n = ms_rank_patches_find(coarse->model, of);
  for (int32_t k = 0; k < a->n && q->n; k++) q->patch[k] = of[a->unknown[a->first[k]]];
  ms_memory_free(alloc, of);
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

static void list_links(const ms_coarse *coarse, const ms_sparse_graph *graph,
                       struct ms_coarse_overlap *q) {
  for (int32_t i = 0; i < graph->n; i++)
    for (int32_t at = graph->ptr[i]; at < graph->ptr[i + 1]; at++) {
      const int32_t j = graph->ind[at];
      if (coarse->position[i] < coarse->position[j]) continue;
      int32_t *link = q->links[q->nlinks++];
      link[0] = i, link[1] = j, link[2] = ms_coarse_find(coarse, i, j);
    }
}

msim_status ms_coarse_overlap_create(const ms_coarse *coarse, const ms_sparse_graph *graph,
                                     struct ms_coarse_overlap **overlap, msim_error *err) {
  static const char WHAT[] = "the affine motions of the rank";
  const msim_allocator *alloc = &coarse->model->scene->alloc;
  const size_t block = MS_MODES * (size_t)coarse->model->unknowns.dims;
  struct ms_coarse_overlap *q = *overlap = ms_memory_allocate(alloc, 1, sizeof *q);
  if (!q || !MS_NEW(alloc, q->patch, graph->n) || !find_patches(coarse, q) ||
      !MS_NEW(alloc, q->motions, MS_MODES * (size_t)graph->n) || !find_motions(coarse, q) ||
      !MS_NEW(alloc, q->links, graph->ptr[graph->n]) ||
      !MS_NEW(alloc, q->matrix, 2 * block * block * (size_t)q->n) ||
      !MS_NEW(alloc, q->b, block * (size_t)q->n))
    return ms_error_set_memory(err, WHAT);
  list_links(coarse, graph, q);
  const ms_sparse_graph none = {.n = q->n, .ptr = (int32_t[MS_MOST_PATCHES + 1]){0}};
  msim_status status =
      ms_block_cholesky_create(alloc, &none, (int32_t)block, coarse->model->isa, &q->chol, err);
  q->chol.value = q->matrix + block * block * (size_t)q->n;
  return status;
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

/* R^T A R of one patch. Motions that do not depend on coordinates have zeros: 1 on the diagonal
 * makes them harmless. */
static void compute_block(const ms_coarse *coarse, int32_t patch, double *sum) {
  enum { MOST = MS_BLOCK_CHOLESKY_MAX_BLOCK * MS_BLOCK_CHOLESKY_MAX_BLOCK };
  const struct ms_coarse_overlap *q = coarse->overlap;
  const size_t n = (size_t)q->chol.block, area = n * n;
  double links[MOST] = {0}, block[MOST];
  memset(sum, 0, area * sizeof *sum);
  for (int32_t k = 0; k < coarse->aggregates.n; k++) {
    if (q->patch[k] != patch) continue;
    mirror(n, coarse->value + area * (size_t)coarse->diagonal[k], block);
    add_product(n, block, q->motions + MS_MODES * k, q->motions + MS_MODES * k, sum);
  }
  for (int32_t k = 0; k < q->nlinks; k++) {
    const int32_t *link = q->links[k];
    if (q->patch[link[0]] != patch) continue;
    add_product(n, coarse->value + area * (size_t)link[2], q->motions + MS_MODES * link[0],
                q->motions + MS_MODES * link[1], links);
  }
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < n; i++) sum[n * j + i] += links[n * j + i] + links[n * i + j];
  for (size_t i = 0; i < n; i++)
    if (sum[n * i + i] == 0) sum[n * i + i] = 1;
}

void ms_coarse_overlap_factor(const ms_coarse *coarse) {
  struct ms_coarse_overlap *q = coarse->overlap;
  const size_t area = (size_t)(q->chol.block * q->chol.block);
  for (int32_t p = 0; p < q->n; p++) {
    double *block = q->matrix + area * (size_t)p;
    compute_block(coarse, p, block);
    memcpy(q->chol.value + area * (size_t)ms_block_cholesky_find(&q->chol, p, p), block,
           area * sizeof *block);
  }
  q->is_factored = !ms_block_cholesky_factor(&q->chol);
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
