#include "linear/modes.h"

#include <math.h>

#include "scene/laws.h"

/*------------------------------------- inverse iteration ----------------------------------------*/

int ms_modes_create_workspace(const msim_allocator *alloc, int32_t n, ms_modes_workspace *w) {
  const size_t size = (size_t)n;
  return MS_NEW(alloc, w->u, size * size) && MS_NEW(alloc, w->v, size) &&
         MS_NEW(alloc, w->end, size);
}

void ms_modes_destroy_workspace(const msim_allocator *alloc, ms_modes_workspace *w) {
  MS_FREE(alloc, w->u, w->v, w->end);
}

/* Replace the Laplacian by the factor of u^T u = Laplacian + shift I. The shift is well above
 * rounding errors, and well below the smallest positive eigenvalue of interest. */
static void factor_laplacian(int32_t n, double mean, ms_modes_workspace *w) {
  const double shift = mean > 0 ? 1e-4 * mean : 1;
  for (int32_t k = 0; k < n; k++) w->u[k * n + k] += shift;
  for (int32_t k = 0; k < n; k++) {
    double *restrict row = w->u + k * n;
    row[k] = sqrt(row[k]);
    for (int32_t i = k + 1; i < w->end[k]; i++) row[i] /= row[k];
    for (int32_t j = k + 1; j < w->end[k]; j++) {
      double *restrict to = w->u + j * n;
      for (int32_t i = j; i < w->end[k]; i++) to[i] -= row[i] * row[j];
    }
  }
}

/* v = (u^T u)^-1 v for MS_MODES vectors side by side */
static void solve_laplacian(const ms_modes_workspace *w, int32_t n) {
  double(*v)[MS_MODES] = w->v;
  for (int32_t k = 0; k < n; k++) {
    const double *row = w->u + k * n;
    for (int m = 0; m < MS_MODES; m++) v[k][m] /= row[k];
    for (int32_t i = k + 1; i < w->end[k]; i++)
      for (int m = 0; m < MS_MODES; m++) v[i][m] -= row[i] * v[k][m];
  }
  for (int32_t k = n - 1; k >= 0; k--) {
    const double *row = w->u + k * n;
    for (int32_t i = w->end[k] - 1; i > k; i--)
      for (int m = 0; m < MS_MODES; m++) v[k][m] -= row[i] * v[i][m];
    for (int m = 0; m < MS_MODES; m++) v[k][m] /= row[k];
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

void ms_modes_iterate(int32_t n, double mean, ms_modes_workspace *w) {
  enum { ITERATIONS = 6 };
  factor_laplacian(n, mean, w);
  for (int32_t i = 0; i < n; i++)
    for (int m = 1; m < MS_MODES; m++)
      w->v[i][m] = ms_vector_random_entry((uint32_t)(MS_MODES * i + m));
  orthonormalise(n, w->v);
  for (int round = 0; round < ITERATIONS; round++) {
    solve_laplacian(w, n);
    orthonormalise(n, w->v);
  }
}

/*------------------------------------- one aggregate --------------------------------------------*/

/* What all aggregates share */
typedef struct modes_job {
  const ms_incidence *graph;
  const ms_model *model;
  ms_aggregates *a;
  int32_t largest; /* unknowns of the largest aggregate */
  int32_t *local;  /* the index in its aggregate of each unknown */
} modes_job;

static double stiffness(const modes_job *j, int32_t half_edge) {
  return ms_scene_stiffness(j->model->scene, j->model->springs.spring[half_edge / 2]);
}

/* Clear the rows of u as far as the Laplacian of the aggregate rows[0..n) fills the factor. Returns
 * the largest stiffness. */
static double prepare_band(const modes_job *j, const int32_t *rows, int32_t n,
                           ms_modes_workspace *w) {
  const ms_buckets *edges = &j->graph->of;
  const int32_t *of = j->a->of;
  double largest = 0;
  for (int32_t i = 0; i < n; i++) {
    w->end[i] = i > 0 && w->end[i - 1] > i ? w->end[i - 1] : i + 1;
    for (int32_t e = edges->first[rows[i]]; e < edges->first[rows[i] + 1]; e++) {
      const int32_t other = j->graph->row[edges->item[e] ^ 1];
      if (of[other] != of[rows[i]]) continue;
      largest = fmax(largest, stiffness(j, edges->item[e]));
      if (j->local[other] >= w->end[i]) w->end[i] = j->local[other] + 1;
    }
    for (int32_t k = i; k < w->end[i]; k++) w->u[i * n + k] = 0;
  }
  return largest;
}

/* u = the upper triangle of the Laplacian of the aggregate rows[0..n), in units of its stiffest
 * spring. Returns the mean of its diagonal. */
static double assemble_laplacian(const modes_job *j, const int32_t *rows, int32_t n,
                                 ms_modes_workspace *w) {
  const ms_buckets *edges = &j->graph->of;
  const int32_t *of = j->a->of;
  const double largest = prepare_band(j, rows, n, w);
  double sum = 0, *u = w->u;
  for (int32_t i = 0; i < n && largest > 0; i++) {
    for (int32_t e = edges->first[rows[i]]; e < edges->first[rows[i] + 1]; e++) {
      const int32_t other = j->graph->row[edges->item[e] ^ 1];
      if (of[other] != of[rows[i]]) continue;
      const double k = stiffness(j, edges->item[e]) / largest;
      if (j->local[other] > i) u[i * n + j->local[other]] -= k;
      u[i * n + i] += k;
      sum += k;
    }
  }
  return sum / n;
}

/* w->v = the modes of the aggregate rows[0..n) */
static void compute_modes(const modes_job *j, const int32_t *rows, int32_t n,
                          ms_modes_workspace *w) {
  const double mean = assemble_laplacian(j, rows, n, w);
  for (int32_t i = 0; i < n; i++) w->v[i][0] = 1;
  ms_modes_iterate(n, mean, w);
}

/*------------------------------------- all aggregates -------------------------------------------*/

/* The aggregates that one thread computes, with arrays of its own */
typedef struct modes_share {
  const modes_job *job;
  int32_t begin, end;
  ms_modes_workspace w;
} modes_share;

static void compute_share(void *data, int32_t item) {
  modes_share *s = (modes_share *)data + item;
  ms_aggregates *a = s->job->a;
  for (int32_t k = s->begin; k < s->end; k++) {
    const int32_t *rows = a->unknown + a->first[k], n = a->first[k + 1] - a->first[k];
    compute_modes(s->job, rows, n, &s->w);
    for (int32_t i = 0; i < n; i++)
      for (int m = 0; m < MS_MODES; m++) a->weight[MS_MODES * rows[i] + m] = (float)s->w.v[i][m];
  }
}

static int create_shares(const modes_job *j, int32_t n, modes_share *shares) {
  int fits = 1;
  for (int32_t i = 0; i < n && fits; i++) {
    shares[i].job = j;
    shares[i].begin = (int32_t)((int64_t)j->a->n * i / n);
    shares[i].end = (int32_t)((int64_t)j->a->n * (i + 1) / n);
    fits = ms_modes_create_workspace(&j->model->scene->alloc, j->largest, &shares[i].w);
  }
  return fits;
}

static void destroy_shares(const msim_allocator *alloc, int32_t n, modes_share *shares) {
  for (int32_t i = 0; shares && i < n; i++) ms_modes_destroy_workspace(alloc, &shares[i].w);
  ms_memory_free(alloc, shares);
}

static void number_members(modes_job *j) {
  const ms_aggregates *a = j->a;
  for (int32_t k = 0; k < a->n; k++) {
    const int32_t n = a->first[k + 1] - a->first[k];
    if (n > j->largest) j->largest = n;
    for (int32_t i = 0; i < n; i++) j->local[a->unknown[a->first[k] + i]] = i;
  }
}

msim_status ms_modes_compute(const ms_model *model, const ms_incidence *graph, ms_aggregates *a,
                             msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const int32_t threads = ms_pool_thread_count(model->pool);
  modes_job j = {.graph = graph, .model = model, .a = a};
  modes_share *shares = NULL;
  int fits = MS_NEW(alloc, j.local, model->unknowns.nfree) && MS_NEW(alloc, shares, threads);
  if (fits) number_members(&j);
  fits = fits && create_shares(&j, threads, shares);
  if (fits) ms_pool_run(model->pool, compute_share, shares, threads);
  destroy_shares(alloc, threads, shares);
  ms_memory_free(alloc, j.local);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the modes of the aggregates");
}
