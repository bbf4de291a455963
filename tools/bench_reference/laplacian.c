#include "laplacian.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

/*------------------------------------- the host of the backend ----------------------------------*/

enum { LINE = 64 }; /* bytes, alignment of vectors */

static void *allocate_aligned(size_t bytes) {
  return aligned_alloc(LINE, (bytes / LINE + 1) * LINE);
}

static void *laplacian_host_alloc(const msim_host *host, size_t bytes) {
  (void)host;
  return allocate_aligned(bytes);
}

static void laplacian_host_free(const msim_host *host, void *block) {
  (void)host;
  free(block);
}

static void laplacian_host_fail(const msim_host *host, const char *format, ...) {
  msim_error *err = host->data;
  va_list args;
  va_start(args, format);
  vsnprintf(err->text, sizeof err->text, format, args);
  va_end(args);
}

/* This host uses its plugin in one thread. */
static void laplacian_host_lock(const msim_host *host) { (void)host; }

/*------------------------------------- the graph ------------------------------------------------*/

/* Springs between free particles, in both directions. Assumes at most one spring per pair, as in
 * cloths and jellies. */
typedef struct graph {
  int32_t *ptr, *ind; /* n + 1; ptr[n], ascending within a row */
  double *k, *total;  /* ptr[n]: weights of ind; n: sum over all springs of a free particle */
} graph;

static void graph_free(graph *g) {
  free(g->ptr);
  free(g->ind);
  free(g->k);
  free(g->total);
}

static int has_free_ends(const msim_scene_view *s, int32_t spring) {
  return !s->pinned[s->ij[2 * spring]] && !s->pinned[s->ij[2 * spring + 1]];
}

/* Inserts column j into the sorted row that begins at `first` and ends before `at`. */
static void insert_entry(int32_t *ind, double *k, int32_t first, int32_t at, int32_t j,
                         double value) {
  for (; at > first && ind[at - 1] > j; at--) ind[at] = ind[at - 1], k[at] = k[at - 1];
  ind[at] = j, k[at] = value;
}

static int graph_make(const msim_scene_view *s, graph *g) {
  const size_t n = (size_t)s->nparticles, most = 2 * (size_t)s->nsprings + 1;
  *g = (graph){.ptr = calloc(n + 1, sizeof *g->ptr),
               .ind = malloc(most * sizeof *g->ind),
               .k = malloc(most * sizeof *g->k),
               .total = calloc(n, sizeof *g->total)};
  int32_t *filled = calloc(n, sizeof *filled);
  const int made = g->ptr && g->ind && g->k && g->total && filled;
  for (int32_t e = 0; made && e < 2 * s->nsprings; e++) {
    const int32_t p = s->ij[e];
    g->total[p] += s->pinned[p] ? 0 : s->k[e / 2];
    g->ptr[p + 1] += has_free_ends(s, e / 2);
  }
  for (size_t p = 0; made && p < n; p++) g->ptr[p + 1] += g->ptr[p];
  for (int32_t e = 0; made && e < 2 * s->nsprings; e++) {
    if (!has_free_ends(s, e / 2)) continue;
    const int32_t p = s->ij[e], first = g->ptr[p];
    insert_entry(g->ind, g->k, first, first + filled[p]++, s->ij[e ^ 1], s->k[e / 2]);
  }
  free(filled);
  return made;
}

/*------------------------------------- the matrix -----------------------------------------------*/

/* Fills the upper triangle in the order of the factorization. */
static int fill_matrix(const msim_scene_view *s, double h, const graph *g, laplacian *L) {
  const size_t n = (size_t)L->n, entries = n + (size_t)g->ptr[n] / 2;
  int32_t *rowptr = allocate_aligned((n + 1) * sizeof *rowptr),
          *colind = allocate_aligned(entries * sizeof *colind);
  double *val = allocate_aligned(entries * sizeof *val);
  L->matrix = (msim_system){.size = sizeof L->matrix,
                            .n = L->n,
                            .block = 1,
                            .format = MSIM_FORMAT_UPPER,
                            .graphptr = rowptr,
                            .graphind = colind,
                            .rowptr = rowptr,
                            .colind = colind,
                            .val = val};
  if (!rowptr || !colind || !val) return 0;
  rowptr[0] = 0;
  for (int32_t i = 0; i < L->n; i++) {
    const int32_t p = L->particle[i], first = rowptr[i];
    int32_t at = first;
    insert_entry(colind, val, first, at++, i, s->mass[p] + h * h * g->total[p]);
    for (int32_t e = g->ptr[p]; e < g->ptr[p + 1]; e++)
      if (L->place[g->ind[e]] > i)
        insert_entry(colind, val, first, at++, L->place[g->ind[e]], -h * h * g->k[e]);
    rowptr[i + 1] = at;
  }
  return 1;
}

static msim_status order_and_factor(const msim_scene_view *s, double h, const graph *g,
                                    laplacian *L) {
  msim_solve_info info = {.size = sizeof info};
  msim_status status = L->backend->create(&L->host, &L->self);
  if (!status) status = L->backend->order(L->self, L->n, g->ptr, g->ind, L->particle);
  if (status) return status;
  for (int32_t i = 0; i < L->n; i++) L->place[L->particle[i]] = i;
  if (!fill_matrix(s, h, g, L)) return MSIM_ERR_MEMORY;
  status = L->backend->analyze(L->self, &L->matrix, &info);
  if (!status) status = L->backend->factor(L->self, &L->matrix, MSIM_FACTOR_SPD, &info);
  return status;
}

int laplacian_make(const msim_scene_view *s, double h, laplacian *L) {
  const size_t n = (size_t)s->nparticles;
  *L = (laplacian){.n = s->nparticles};
  if (msim_solver_backend("cholmod", NULL, &L->backend, &L->err) != MSIM_OK) return 0;
  L->host = (msim_host){.size = sizeof L->host,
                        .alloc = laplacian_host_alloc,
                        .free = laplacian_host_free,
                        .fail = laplacian_host_fail,
                        .data = &L->err,
                        .lock = laplacian_host_lock,
                        .unlock = laplacian_host_lock};
  L->particle = malloc(n * sizeof *L->particle);
  L->place = malloc(n * sizeof *L->place);
  snprintf(L->err.text, sizeof L->err.text, "out of memory for the prefactored matrix");
  graph g;
  const int made =
      graph_make(s, &g) && L->particle && L->place && order_and_factor(s, h, &g, L) == MSIM_OK;
  graph_free(&g);
  return made;
}

void laplacian_free(laplacian *L) {
  if (L->backend) L->backend->destroy(L->self);
  free((void *)L->matrix.rowptr);
  free((void *)L->matrix.colind);
  free((void *)L->matrix.val);
  free(L->particle);
  free(L->place);
  *L = (laplacian){0};
}

msim_status laplacian_solve(const laplacian *L, const double *b, double *y) {
  const msim_solve_params params = {.size = sizeof params, .rtol = 1e-12};
  msim_solve_info info = {.size = sizeof info};
  return L->backend->solve(L->self, &L->matrix, &params, 3, b, y, &info);
}
