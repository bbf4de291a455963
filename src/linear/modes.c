#include "linear/modes.h"

#include <math.h>

#include "scene/laws.h"

/*------------------------------------- one aggregate --------------------------------------------*/

typedef struct workspace {
  const ms_incidence *graph;
  const ms_model *model;
  const int32_t *of;     /* the aggregate of each unknown */
  int32_t *local;        /* the index in its aggregate of each unknown */
  double *l;             /* a dense matrix of the size of the largest aggregate */
  double (*v)[MS_MODES]; /* the modes of one aggregate */
} workspace;

static double stiffness(const workspace *w, int32_t half_edge) {
  return ms_scene_stiffness(w->model->scene, w->model->springs.spring[half_edge / 2]);
}

/* l = the dense Laplacian of the aggregate rows[0..n), in units of its stiffest spring. Returns the
 * mean of its diagonal. */
static double assemble_laplacian(const workspace *w, const int32_t *rows, int32_t n) {
  const ms_incidence *graph = w->graph;
  const int32_t *first = graph->of.first, *half_edge = graph->of.item, *of = w->of;
  double largest = 0, sum = 0, *l = w->l;
  for (int32_t i = 0; i < n; i++)
    for (int32_t e = first[rows[i]]; e < first[rows[i] + 1]; e++)
      if (of[graph->row[half_edge[e] ^ 1]] == of[rows[i]])
        largest = fmax(largest, stiffness(w, half_edge[e]));
  for (int32_t i = 0; i < n * n; i++) l[i] = 0;
  for (int32_t i = 0; i < n && largest > 0; i++) {
    for (int32_t e = first[rows[i]]; e < first[rows[i] + 1]; e++) {
      const int32_t other = graph->row[half_edge[e] ^ 1];
      if (of[other] != of[rows[i]]) continue;
      const double k = stiffness(w, half_edge[e]) / largest;
      l[i * n + w->local[other]] -= k;
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

/* v = the modes of the aggregate rows[0..n) */
static void compute_modes(const workspace *w, const int32_t *rows, int32_t n) {
  enum { ITERATIONS = 6 };
  double(*v)[MS_MODES] = w->v;
  factor_laplacian(n, assemble_laplacian(w, rows, n), w->l);
  for (int32_t i = 0; i < n; i++) {
    v[i][0] = 1;
    for (int m = 1; m < MS_MODES; m++)
      v[i][m] = ms_vector_random_entry((uint32_t)(MS_MODES * i + m));
  }
  orthonormalise(n, v);
  for (int round = 0; round < ITERATIONS; round++) {
    solve_laplacian(w->l, n, v);
    orthonormalise(n, v);
  }
}

msim_status ms_modes_compute(const ms_model *model, const ms_incidence *graph, ms_aggregates *a,
                             msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  int32_t largest = 0;
  for (int32_t k = 0; k < a->n; k++) {
    const int32_t n = a->first[k + 1] - a->first[k];
    if (n > largest) largest = n;
  }
  workspace w = {.graph = graph, .model = model, .of = a->of};
  const int fits = MS_NEW(alloc, w.local, model->unknowns.nfree) &&
                   MS_NEW(alloc, w.l, (size_t)largest * (size_t)largest) &&
                   MS_NEW(alloc, w.v, largest);
  for (int32_t k = 0; k < a->n && fits; k++) {
    const int32_t *rows = a->unknown + a->first[k], n = a->first[k + 1] - a->first[k];
    for (int32_t i = 0; i < n; i++) w.local[rows[i]] = i;
    compute_modes(&w, rows, n);
    for (int32_t i = 0; i < n; i++)
      for (int m = 0; m < MS_MODES; m++) a->weight[MS_MODES * rows[i] + m] = (float)w.v[i][m];
  }
  MS_FREE(alloc, w.local, w.l, w.v);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the modes of the aggregates");
}
