#include "linear/block_cholesky.h"

#include <math.h>
#include <string.h>

#include "linear/block_kernels.h"

MS_TABLES(ms_block_kernels);

/*------------------------------------- order and pattern ----------------------------------------*/

/* The rows not yet eliminated, each with its neighbours among them */
typedef struct elimination_graph {
  const msim_allocator *alloc;
  int32_t n;
  int32_t **neighbours;   /* n arrays */
  int32_t *degree, *room; /* n: number of neighbours; capacity of the array */
  int32_t leaves, *least; /* 2 leaves: tournament tree; its root, 1: the row of least degree */
  int64_t *mark; /* n: the number of the last call of replace_by_neighbours() that met this row */
  int64_t searches; /* calls of replace_by_neighbours() */
} elimination_graph;

static void update_tournament(elimination_graph *e, int32_t node) {
  const int32_t i = e->least[2 * node], j = e->least[2 * node + 1];
  const int second = j >= 0 && (i < 0 || e->degree[j] < e->degree[i]);
  e->least[node] = second ? j : i;
}

static void set_degree(elimination_graph *e, int32_t i, int32_t degree) {
  e->degree[i] = degree;
  for (int32_t node = (e->leaves + i) / 2; node; node /= 2) update_tournament(e, node);
}

/* Remove from the tree, and return, the first row of least degree. */
static int32_t take_least(elimination_graph *e) {
  const int32_t i = e->least[1];
  e->least[e->leaves + i] = -1;
  set_degree(e, i, e->degree[i]);
  return i;
}

static msim_status create_elimination_graph(elimination_graph *e, const ms_sparse_graph *graph) {
  const size_t n = (size_t)e->n;
  for (e->leaves = 1; e->leaves < e->n;) e->leaves *= 2;
  if (!MS_NEW(e->alloc, e->neighbours, n) || !MS_NEW(e->alloc, e->degree, n) ||
      !MS_NEW(e->alloc, e->room, n) || !MS_NEW(e->alloc, e->mark, n) ||
      !MS_NEW(e->alloc, e->least, 2 * (size_t)e->leaves))
    return MSIM_ERR_MEMORY;
  for (int32_t i = 0; i < e->n; i++) {
    const int32_t first = graph->ptr[i], degree = graph->ptr[i + 1] - first;
    if (!MS_NEW(e->alloc, e->neighbours[i], degree)) return MSIM_ERR_MEMORY;
    if (degree) memcpy(e->neighbours[i], graph->ind + first, (size_t)degree * sizeof(int32_t));
    e->degree[i] = e->room[i] = degree;
  }
  for (int32_t i = 0; i < e->leaves; i++) e->least[e->leaves + i] = i < e->n ? i : -1;
  for (int32_t node = e->leaves - 1; node; node--) update_tournament(e, node);
  return MSIM_OK;
}

static void destroy_elimination_graph(elimination_graph *e) {
  for (int32_t i = 0; i < e->n && e->neighbours; i++) ms_memory_free(e->alloc, e->neighbours[i]);
  MS_FREE(e->alloc, e->neighbours, e->degree, e->room, e->mark, e->least);
}

/* Replace k in the neighbours of i by the other neighbours of k. */
static msim_status replace_by_neighbours(elimination_graph *e, int32_t i, int32_t k) {
  msim_error err;
  const int64_t look = ++e->searches;
  int32_t kept = 0;
  for (int32_t a = 0; a < e->degree[i]; a++) {
    const int32_t j = e->neighbours[i][a];
    if (j != k) e->neighbours[i][kept++] = j, e->mark[j] = look;
  }
  e->mark[i] = look;
  const msim_status status = ms_memory_reserve(e->alloc, MS_ARRAY(e->neighbours[i]), kept,
                                               &e->room[i], (int64_t)kept + e->degree[k], &err);
  if (status) return status;
  for (int32_t a = 0; a < e->degree[k]; a++) {
    const int32_t j = e->neighbours[k][a];
    if (e->mark[j] != look) e->neighbours[i][kept++] = j;
  }
  set_degree(e, i, kept);
  return MSIM_OK;
}

/* Eliminate all rows, always that of least degree next, unless L gets more than `most` blocks.
 * blocks: their number */
static msim_status eliminate_by_degree(elimination_graph *e, int64_t most, int32_t *position,
                                       int64_t *blocks) {
  *blocks = e->n;
  for (int32_t step = 0; step < e->n && *blocks <= most; step++) {
    const int32_t k = take_least(e);
    position[k] = step;
    *blocks += e->degree[k];
    for (int32_t a = 0; a < e->degree[k]; a++) {
      msim_status status = replace_by_neighbours(e, e->neighbours[k][a], k);
      if (status) return status;
    }
  }
  return MSIM_OK;
}

static void sort_indices(int32_t *a, int32_t n) {
  for (int32_t i = 1; i < n; i++) {
    const int32_t x = a[i];
    int32_t j = i;
    for (; j > 0 && a[j - 1] > x; j--) a[j] = a[j - 1];
    a[j] = x;
  }
}

/* The neighbours of a row at its elimination are the pattern of its column of L. */
static void write_pattern(const elimination_graph *e, ms_block_cholesky *chol) {
  for (int32_t i = 0; i < e->n; i++) chol->first[chol->position[i] + 1] = e->degree[i] + 1;
  for (int32_t k = 0; k < e->n; k++) chol->first[k + 1] += chol->first[k];
  for (int32_t i = 0; i < e->n; i++) {
    int32_t *column = chol->row + chol->first[chol->position[i]];
    column[0] = chol->position[i];
    for (int32_t a = 0; a < e->degree[i]; a++) column[a + 1] = chol->position[e->neighbours[i][a]];
    sort_indices(column, e->degree[i] + 1);
  }
}

static int allocate_factor(const msim_allocator *alloc, int64_t blocks, ms_block_cholesky *chol) {
  const size_t n = (size_t)chol->n, area = (size_t)chol->block * (size_t)chol->block;
  return MS_NEW(alloc, chol->first, n + 1) && MS_NEW(alloc, chol->row, blocks) &&
         MS_NEW(alloc, chol->factor, area * (size_t)blocks) &&
         MS_NEW(alloc, chol->packed, n * (size_t)chol->block);
}

msim_status ms_block_cholesky_create(const msim_allocator *alloc, const ms_sparse_graph *graph,
                                     int32_t block, int isa, double most, ms_block_cholesky *chol,
                                     msim_error *err) {
  const int32_t n = graph->n;
  const int64_t most_blocks = (int64_t)fmin(most / (block * block), INT32_MAX);
  elimination_graph e = {.alloc = alloc, .n = n};
  int64_t blocks = 0;
  *chol = (ms_block_cholesky){.n = n, .block = block, .kernels = ms_block_kernels_of[isa]};
  msim_status status =
      MS_NEW(alloc, chol->position, n) ? create_elimination_graph(&e, graph) : MSIM_ERR_MEMORY;
  if (!status) status = eliminate_by_degree(&e, most_blocks, chol->position, &blocks);
  const int fits = blocks <= most_blocks;
  if (!status && (fits ? !allocate_factor(alloc, blocks, chol) : most_blocks == INT32_MAX))
    status = MSIM_ERR_MEMORY;
  if (!status && fits) write_pattern(&e, chol);
  if (!status && !fits) ms_block_cholesky_destroy(alloc, chol);
  destroy_elimination_graph(&e);
  return status ? ms_error_set_memory(err, "the coarse factorization") : MSIM_OK;
}

void ms_block_cholesky_destroy(const msim_allocator *alloc, ms_block_cholesky *chol) {
  MS_FREE(alloc, chol->position, chol->first, chol->row, chol->factor, chol->packed);
  *chol = (ms_block_cholesky){0};
}

/*------------------------------------- values ---------------------------------------------------*/

/* The index of the block in row r of column c, both by position; -1: not in the pattern. */
static int32_t find(const ms_block_cholesky *chol, int32_t r, int32_t c) {
  int32_t low = chol->first[c], high = chol->first[c + 1] - 1;
  while (low < high) {
    const int32_t middle = low + (high - low) / 2;
    if (chol->row[middle] < r) low = middle + 1;
    else high = middle;
  }
  return chol->row[low] == r ? low : -1;
}

int32_t ms_block_cholesky_find(const ms_block_cholesky *chol, int32_t i, int32_t j) {
  const int32_t p = chol->position[i], q = chol->position[j];
  return p >= q ? find(chol, p, q) : find(chol, q, p);
}

/* Subtract L_ik L_jk^T from A_ij for all rows i >= j of column k. The rows of column k below j are
 * also rows of column j, so that one scan of column j finds them all. */
static void update_columns(const ms_block_cholesky *chol, int32_t k) {
  const size_t block = (size_t)chol->block, area = block * block;
  const int32_t end = chol->first[k + 1];
  for (int32_t b = chol->first[k] + 1; b < end; b++) {
    int32_t target = chol->first[chol->row[b]];
    for (int32_t a = b; a < end; a++, target++) {
      while (chol->row[target] < chol->row[a]) target++;
      chol->kernels->subtract_product(block, chol->value + area * (size_t)a,
                                      chol->value + area * (size_t)b,
                                      chol->value + area * (size_t)target);
    }
  }
}

msim_status ms_block_cholesky_factor(ms_block_cholesky *chol) {
  const size_t block = (size_t)chol->block, area = block * block;
  for (int32_t k = 0; k < chol->n; k++) {
    const size_t diagonal = area * (size_t)chol->first[k];
    double inverse[MS_BLOCK_CHOLESKY_MAX_BLOCK * MS_BLOCK_CHOLESKY_MAX_BLOCK];
    if (!chol->kernels->invert_factor(block, chol->value + diagonal, inverse)) return MSIM_NOT_SPD;
    for (size_t i = 0; i < area; i++) chol->factor[diagonal + i] = (float)inverse[i];
    for (int32_t b = chol->first[k] + 1; b < chol->first[k + 1]; b++)
      chol->kernels->times_transpose(block, chol->value + area * (size_t)b, inverse,
                                     chol->factor + area * (size_t)b);
    update_columns(chol, k);
  }
  return MSIM_OK;
}

void ms_block_cholesky_solve(const ms_block_cholesky *chol, double *x) {
  const size_t block = (size_t)chol->block;
  for (int32_t i = 0; i < chol->n; i++)
    memcpy(chol->packed + block * (size_t)chol->position[i], x + block * (size_t)i,
           block * sizeof *x);
  chol->kernels->solve(chol, chol->packed);
  for (int32_t i = 0; i < chol->n; i++)
    memcpy(x + block * (size_t)i, chol->packed + block * (size_t)chol->position[i],
           block * sizeof *x);
}
