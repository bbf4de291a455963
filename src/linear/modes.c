#include "linear/modes.h"

#include <math.h>

/*------------------------------------- graph ----------------------------------------------------*/

msim_status ms_modes_create_graph(const ms_model *model, ms_modes_graph *graph, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const ms_springs *s = &model->springs;
  const int32_t n = model->unknowns.nfree;
  /* n + 2: during filling first[r + 1] is the next free place of row r */
  *graph =
      (ms_modes_graph){.first = ms_memory_allocate(alloc, (size_t)n + 2, sizeof(int32_t)),
                       .neighbour = ms_memory_allocate(alloc, 2 * (size_t)s->n, sizeof(int32_t)),
                       .k = ms_memory_allocate(alloc, 2 * (size_t)s->n, sizeof(double))};
  if (!graph->first || !graph->neighbour || !graph->k)
    return ms_error_set_memory(err, "the graph of the springs");
  for (int32_t e = 0; e < s->n; e++)
    if (s->i[e] < n && s->j[e] < n) graph->first[s->i[e] + 2]++, graph->first[s->j[e] + 2]++;
  for (int32_t r = 0; r < n; r++) graph->first[r + 2] += graph->first[r + 1];
  for (int32_t e = 0; e < s->n; e++) {
    if (s->i[e] >= n || s->j[e] >= n) continue;
    for (int end = 0; end < 2; end++) {
      const int32_t at = graph->first[(end ? s->j : s->i)[e] + 1]++;
      graph->neighbour[at] = (end ? s->i : s->j)[e];
      graph->k[at] = s->k[e];
    }
  }
  return MSIM_OK;
}

void ms_modes_destroy_graph(const ms_model *model, ms_modes_graph *graph) {
  ms_memory_free(&model->scene->alloc, graph->first);
  ms_memory_free(&model->scene->alloc, graph->neighbour);
  ms_memory_free(&model->scene->alloc, graph->k);
  *graph = (ms_modes_graph){0};
}

/*------------------------------------- one aggregate --------------------------------------------*/

/* l = the dense Laplacian of the aggregate rows[0..n), in units of its stiffest spring. Returns the
 * mean of its diagonal. local: the index in `rows` of each unknown. */
static double assemble_laplacian(const ms_modes_graph *graph, const int32_t *rows, int32_t n,
                                 const int32_t *local, const int32_t *of, double *l) {
  double largest = 0, sum = 0;
  for (int32_t i = 0; i < n; i++)
    for (int32_t e = graph->first[rows[i]]; e < graph->first[rows[i] + 1]; e++)
      if (of[graph->neighbour[e]] == of[rows[i]]) largest = fmax(largest, graph->k[e]);
  for (int32_t i = 0; i < n * n; i++) l[i] = 0;
  for (int32_t i = 0; i < n && largest > 0; i++) {
    for (int32_t e = graph->first[rows[i]]; e < graph->first[rows[i] + 1]; e++) {
      if (of[graph->neighbour[e]] != of[rows[i]]) continue;
      const double k = graph->k[e] / largest;
      l[i * n + local[graph->neighbour[e]]] -= k;
      l[i * n + i] += k;
      sum += k;
    }
  }
  return sum / n;
}

/* Replace the Laplacian l by the lower Cholesky factor of l + shift I. The shift is well above
 * rounding errors, and well below the smallest positive eigenvalue of interest. */
static void factor_laplacian(int32_t n, double mean, double *l) {
  const double shift = mean > 0 ? 1e-4 * mean : 1;
  for (int32_t j = 0; j < n; j++) {
    double d = l[j * n + j] + shift;
    for (int32_t k = 0; k < j; k++) d -= l[j * n + k] * l[j * n + k];
    l[j * n + j] = d = sqrt(d);
    for (int32_t i = j + 1; i < n; i++) {
      double s = l[i * n + j];
      for (int32_t k = 0; k < j; k++) s -= l[i * n + k] * l[j * n + k];
      l[i * n + j] = s / d;
    }
  }
}

/* v = (l l^T)^-1 v for MS_MODES vectors side by side */
static void solve_laplacian(const double *l, int32_t n, double (*v)[MS_MODES]) {
  for (int32_t i = 0; i < n; i++) {
    for (int32_t k = 0; k < i; k++)
      for (int m = 0; m < MS_MODES; m++) v[i][m] -= l[i * n + k] * v[k][m];
    for (int m = 0; m < MS_MODES; m++) v[i][m] /= l[i * n + i];
  }
  for (int32_t i = n - 1; i >= 0; i--) {
    for (int m = 0; m < MS_MODES; m++) v[i][m] /= l[i * n + i];
    for (int32_t k = 0; k < i; k++)
      for (int m = 0; m < MS_MODES; m++) v[k][m] -= l[i * n + k] * v[i][m];
  }
}

/* Modified Gram-Schmidt */
static void orthonormalise(int32_t n, double (*v)[MS_MODES]) {
  for (int m = 0; m < MS_MODES; m++) {
    for (int other = 0; other < m; other++) {
      double dot = 0;
      for (int32_t i = 0; i < n; i++) dot += v[i][other] * v[i][m];
      for (int32_t i = 0; i < n; i++) v[i][m] -= dot * v[i][other];
    }
    double norm = 0;
    for (int32_t i = 0; i < n; i++) norm += v[i][m] * v[i][m];
    for (int32_t i = 0; i < n; i++) v[i][m] /= sqrt(norm);
  }
}

/* v = the modes of one aggregate of n unknowns. l: n^2 doubles, scratch */
static void compute_modes(const ms_modes_graph *graph, const ms_aggregates *a, int32_t cluster,
                          const int32_t *local, double *l, double (*v)[MS_MODES]) {
  enum { ITERATIONS = 6 };
  const int32_t *rows = a->unknown + a->first[cluster];
  const int32_t n = a->first[cluster + 1] - a->first[cluster];
  factor_laplacian(n, assemble_laplacian(graph, rows, n, local, a->of, l), l);
  for (int32_t i = 0; i < n; i++) {
    v[i][0] = 1;
    for (int m = 1; m < MS_MODES; m++)
      v[i][m] = ms_vector_random_entry((uint32_t)(MS_MODES * i + m));
  }
  orthonormalise(n, v);
  for (int round = 0; round < ITERATIONS; round++) {
    solve_laplacian(l, n, v);
    orthonormalise(n, v);
  }
}

msim_status ms_modes_compute(const ms_model *model, const ms_modes_graph *graph, ms_aggregates *a,
                             msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  int32_t largest = 0;
  for (int32_t k = 0; k < a->n; k++) {
    const int32_t n = a->first[k + 1] - a->first[k];
    if (n > largest) largest = n;
  }
  int32_t *local = ms_memory_allocate(alloc, (size_t)model->unknowns.nfree, sizeof *local);
  double *l = ms_memory_allocate(alloc, (size_t)largest * (size_t)largest, sizeof *l);
  double(*v)[MS_MODES] = ms_memory_allocate(alloc, (size_t)largest, sizeof *v);
  const int failed = !local || !l || !v;
  for (int32_t k = 0; k < a->n && !failed; k++) {
    const int32_t first = a->first[k], n = a->first[k + 1] - first;
    for (int32_t i = 0; i < n; i++) local[a->unknown[first + i]] = i;
    compute_modes(graph, a, k, local, l, v);
    for (int32_t i = 0; i < n; i++)
      for (int m = 0; m < MS_MODES; m++)
        a->weight[MS_MODES * a->unknown[first + i] + m] = (float)v[i][m];
  }
  ms_memory_free(alloc, local);
  ms_memory_free(alloc, l);
  ms_memory_free(alloc, v);
  return failed ? ms_error_set_memory(err, "the modes of the aggregates") : MSIM_OK;
}
