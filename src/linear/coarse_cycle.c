#include "linear/coarse_cycle.h"

#include <math.h>
#include <string.h>

#include "linear/block_kernels.h"
#include "linear/cluster_modes.h"
#include "linear/clusters.h"
#include "linear/coarse_cycle_kernels.h"

MS_TABLES(ms_coarse_cycle_kernels);

/*------------------------------------- pattern --------------------------------------------------*/

/* Each pair of aggregates once. Returns 0 if memory is exhausted. */
static int create_incidence(const msim_allocator *alloc, const ms_sparse_graph *graph,
                            ms_incidence *incidence) {
  ms_springs links = {0};
  int fits = MS_NEW(alloc, links.i, graph->ptr[graph->n] / 2) &&
             MS_NEW(alloc, links.j, graph->ptr[graph->n] / 2);
  for (int32_t k = 0; k < graph->n && fits; k++)
    for (int32_t at = graph->ptr[k]; at < graph->ptr[k + 1]; at++)
      if (graph->ind[at] < k) links.i[links.n] = k, links.j[links.n++] = graph->ind[at];
  fits = fits && ms_incidence_create(alloc, &links, graph->n, incidence);
  MS_FREE(alloc, links.i, links.j);
  return fits;
}

/* Returns how many clusters; -1 if memory is exhausted. */
static int32_t group_aggregates(const msim_allocator *alloc, const ms_sparse_graph *graph,
                                int32_t size, ms_coarse_cycle *s) {
  const ms_cluster_size aggregates = {.complete = size, .least = 1};
  ms_incidence incidence = {0};
  int32_t clusters = -1;
  if (MS_NEW(alloc, s->cluster, s->n) && MS_NEW(alloc, s->position, s->n) &&
      create_incidence(alloc, graph, &incidence))
    clusters = ms_clusters_grow(alloc, &incidence, s->n, aggregates, s->cluster, &s->members);
  ms_incidence_destroy(alloc, &incidence);
  for (int32_t p = 0; p < s->n && clusters >= 0; p++) s->position[s->members.item[p]] = p;
  return clusters;
}

/* Links are by column, so that a product reads each one first where they follow each other, and
 * again, for its row, while it is in cache. Those of each column ascend, as rows are gone through
 * in their order. */
static int list_links(const msim_allocator *alloc, const ms_sparse_graph *graph,
                      ms_coarse_cycle *s) {
  const int32_t n = graph->n, links = graph->ptr[n] / 2, *item = s->members.item;
  int32_t *next = NULL;
  int fits = MS_NEW(alloc, s->first, (size_t)n + 1) && MS_NEW(alloc, s->row, links) &&
             MS_NEW(alloc, s->column, links) && MS_NEW(alloc, next, n);
  for (int32_t p = 0; p < n && fits; p++) {
    next[p] = s->first[p + 1] = s->first[p];
    for (int32_t at = graph->ptr[item[p]]; at < graph->ptr[item[p] + 1]; at++)
      s->first[p + 1] += s->position[graph->ind[at]] > p;
  }
  for (int32_t row = 0; row < n && fits; row++)
    for (int32_t at = graph->ptr[item[row]]; at < graph->ptr[item[row] + 1]; at++) {
      const int32_t column = s->position[graph->ind[at]];
      if (column < row) s->column[next[column]] = column, s->row[next[column]++] = row;
    }
  ms_memory_free(alloc, next);
  return fits && ms_buckets_create(alloc, links, s->row, n, &s->left);
}

int32_t ms_coarse_cycle_find(const ms_coarse_cycle *s, int32_t i, int32_t j) {
  const int32_t row = s->position[i], column = s->position[j];
  if (row == column) return row;
  for (int32_t e = s->first[column]; e < s->first[column + 1]; e++)
    if (s->row[e] == row) return s->n + e;
  return -1;
}

/* The clusters linked with each one, of both triangles; links->ind NULL: ptr only. mark: scratch */
static void list_cluster_graph(const ms_coarse_cycle *s, const ms_sparse_graph *graph,
                               int32_t *mark, ms_sparse_graph *links) {
  for (int32_t c = 0; c < links->n; c++) mark[c] = -1;
  for (int32_t c = 0; c < links->n; c++) {
    links->ptr[c + 1] = links->ptr[c];
    mark[c] = c;
    for (int32_t p = s->members.first[c]; p < s->members.first[c + 1]; p++) {
      const int32_t k = s->members.item[p];
      for (int32_t at = graph->ptr[k]; at < graph->ptr[k + 1]; at++) {
        const int32_t other = s->cluster[graph->ind[at]];
        if (mark[other] == c) continue;
        mark[other] = c;
        if (links->ind) links->ind[links->ptr[c + 1]] = other;
        links->ptr[c + 1]++;
      }
    }
  }
}

static msim_status analyse_clusters(const ms_model *model, const ms_sparse_graph *graph,
                                    int32_t clusters, ms_coarse_cycle *s, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  ms_sparse_graph links = {.n = clusters};
  int32_t *mark = NULL;
  int fits = MS_NEW(alloc, links.ptr, (size_t)clusters + 1) && MS_NEW(alloc, mark, clusters);
  if (fits) list_cluster_graph(s, graph, mark, &links);
  fits = fits && MS_NEW(alloc, links.ind, links.ptr[clusters]);
  if (fits) list_cluster_graph(s, graph, mark, &links);
  const msim_status status =
      fits ? ms_block_cholesky_create(alloc, &links, s->block, model->isa, INFINITY, &s->chol, err)
           : ms_error_set_memory(err, "the coarse matrix");
  MS_FREE(alloc, links.ptr, links.ind, mark);
  return status;
}

/*------------------------------------- creation and destruction ---------------------------------*/

static int allocate_values(const msim_allocator *alloc, int32_t clusters, ms_coarse_cycle *s) {
  const size_t n = (size_t)s->n, block = (size_t)s->block, area = block * block;
  const size_t links = (size_t)s->first[n], triangles = ms_coarse_cycle_triangle(block) * n;
  return MS_NEW(alloc, s->modes, MS_MODES * MS_MODES * n) && MS_NEW(alloc, s->inverse, triangles) &&
         MS_NEW(alloc, s->link, area * links) && MS_NEW(alloc, s->prolongation, triangles) &&
         MS_NEW(alloc, s->r, block * n) && MS_NEW(alloc, s->z, block * n) &&
         MS_NEW(alloc, s->c, block * (size_t)clusters);
}

msim_status ms_coarse_cycle_create(const ms_model *model, const ms_aggregates *aggregates,
                                   const ms_sparse_graph *graph, int32_t size, ms_coarse_cycle *s,
                                   msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  *s = (ms_coarse_cycle){.n = graph->n,
                         .block = MS_MODES * model->unknowns.dims,
                         .kernels = ms_coarse_cycle_kernels_of[model->isa]};
  const int32_t clusters = group_aggregates(alloc, graph, size, s);
  if (clusters < 0 || !list_links(alloc, graph, s) || !allocate_values(alloc, clusters, s))
    return ms_error_set_memory(err, "the coarse matrix");
  const msim_status status =
      ms_cluster_modes_compute(model, aggregates, s->cluster, clusters, &s->members, s->modes, err);
  return status ? status : analyse_clusters(model, graph, clusters, s, err);
}

void ms_coarse_cycle_destroy(const msim_allocator *alloc, ms_coarse_cycle *s) {
  ms_buckets_destroy(alloc, &s->left);
  ms_buckets_destroy(alloc, &s->members);
  ms_block_cholesky_destroy(alloc, &s->chol);
  MS_FREE(alloc, s->position, s->first, s->row, s->column, s->inverse, s->link, s->prolongation,
          s->cluster, s->modes, s->r, s->z, s->c);
  *s = (ms_coarse_cycle){0};
}

/*------------------------------------- values ---------------------------------------------------*/

/* One loop over all aggregates or clusters, by all threads; no two write to the same place. */
typedef struct cycle_job {
  ms_coarse_cycle *s;
  const double *r;
  double *z;
} cycle_job;

enum { CHUNK = 16, MOST = MS_BLOCK_CHOLESKY_MAX_BLOCK * MS_BLOCK_CHOLESKY_MAX_BLOCK };

static void add_products_chunk(void *data, int32_t begin, int32_t end) {
  ms_coarse_cycle *s = ((cycle_job *)data)->s;
  for (int32_t c = begin; c < end; c++) s->kernels->add_products(s, c);
}

static float *inverse_of(const ms_coarse_cycle *s, int32_t p) {
  return s->inverse + ms_coarse_cycle_triangle((size_t)s->block) * (size_t)p;
}

/* Replace D_k by L^-1; L^T Q follows from L. Returns 0 if D_k is not positive definite. */
static int factor_diagonal(ms_coarse_cycle *s, int32_t p) {
  const size_t n = (size_t)s->block, area = n * n;
  double *l = s->value + area * (size_t)p, inverse[MOST];
  float *to = s->prolongation + ms_coarse_cycle_triangle(n) * (size_t)p;
  const float *modes = s->modes + MS_MODES * MS_MODES * s->members.item[p];
  if (!s->chol.kernels->invert_factor(n, l, inverse)) return 0;
  for (size_t c = 0; c < n; c++) {
    const size_t of = c / MS_MODES * MS_MODES; /* the component's first mode */
    for (size_t i = 0; i < of + MS_MODES; i++) {
      double sum = 0;
      for (size_t q = 0; q < MS_MODES; q++)
        if (of + q >= i) sum += l[i * n + of + q] * (double)modes[c % MS_MODES * MS_MODES + q];
      *to++ = (float)sum;
    }
  }
  memcpy(l, inverse, area * sizeof *l);
  to = inverse_of(s, p);
  for (size_t c = 0; c < n; c++)
    for (size_t i = c / 4 * 4; i < n; i++) *to++ = (float)inverse[c * n + i];
  return 1;
}

static void factor_diagonal_chunk(void *data, int32_t begin, int32_t end) {
  ms_coarse_cycle *s = ((cycle_job *)data)->s;
  for (int32_t p = begin; p < end; p++)
    if (!factor_diagonal(s, p)) *inverse_of(s, p) = 0;
}

static int is_definite(const ms_coarse_cycle *s) {
  for (int32_t p = 0; p < s->n; p++)
    if (!(*inverse_of(s, p) > 0)) return 0;
  return 1;
}

/* N^T = L_column^-1 A^T L_row^-T, as two products with transposes */
static void scale_link(ms_coarse_cycle *s, int32_t e) {
  const size_t n = (size_t)s->block, area = n * n;
  double *a = s->value + area * (size_t)(s->n + e), t[MOST];
  float unused[MOST];
  int16_t *to = s->link + area * (size_t)e;
  s->chol.kernels->times_transpose(n, a, s->value + area * (size_t)s->column[e], unused);
  for (size_t i = 0; i < area; i++) t[i] = a[i % n * n + i / n];
  s->chol.kernels->times_transpose(n, t, s->value + area * (size_t)s->row[e], unused);
  for (size_t i = 0; i < area; i++) {
    const size_t column = i / n, row = i % n;
    to[(column / 2 * (n / 4) + row / 4) * 8 + column % 2 * 4 + row % 4] =
        (int16_t)lrint(INT16_MAX * fmax(-1, fmin(1, t[i])));
  }
}

static void scale_links_chunk(void *data, int32_t begin, int32_t end) {
  ms_coarse_cycle *s = ((cycle_job *)data)->s;
  for (int32_t e = begin; e < end; e++) scale_link(s, e);
}

msim_status ms_coarse_cycle_factor(ms_coarse_cycle *s, ms_pool *pool) {
  cycle_job j = {.s = s};
  ms_pool_run_chunks(pool, add_products_chunk, &j, s->chol.n, CHUNK);
  ms_pool_run_chunks(pool, factor_diagonal_chunk, &j, s->n, CHUNK);
  if (!is_definite(s)) return MSIM_NOT_SPD;
  ms_pool_run_chunks(pool, scale_links_chunk, &j, s->first[s->n], CHUNK);
  return ms_block_cholesky_factor(&s->chol);
}

/*------------------------------------- solution -------------------------------------------------*/

static void scale_chunk(void *data, int32_t begin, int32_t end) {
  const cycle_job *j = data;
  for (int32_t p = begin; p < end; p++) j->s->kernels->scale(j->s, j->r, p);
}

static void restrict_chunk(void *data, int32_t begin, int32_t end) {
  const cycle_job *j = data;
  for (int32_t c = begin; c < end; c++) j->s->kernels->restrict_cluster(j->s, c);
}

static void correct_chunk(void *data, int32_t begin, int32_t end) {
  const cycle_job *j = data;
  for (int32_t c = begin; c < end; c++) j->s->kernels->correct_cluster(j->s, c);
}

static void finish_chunk(void *data, int32_t begin, int32_t end) {
  const cycle_job *j = data;
  for (int32_t p = begin; p < end; p++) j->s->kernels->finish(j->s, j->z, p);
}

void ms_coarse_cycle_solve(ms_coarse_cycle *s, ms_pool *pool, const double *r, double *z) {
  cycle_job j = {.s = s, .r = r, .z = z};
  ms_pool_run_chunks(pool, scale_chunk, &j, s->n, CHUNK);
  ms_pool_run_chunks(pool, restrict_chunk, &j, s->chol.n, CHUNK / 4);
  ms_block_cholesky_solve(&s->chol, s->c);
  ms_pool_run_chunks(pool, correct_chunk, &j, s->chol.n, CHUNK / 4);
  ms_pool_run_chunks(pool, finish_chunk, &j, s->n, CHUNK);
}
