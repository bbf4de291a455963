#include "linear/modes.h"

#include <math.h>

#include "scene/laws.h"

/*------------------------------------- affine functions -----------------------------------------*/

void ms_modes_affine_functions(const ms_model *model, int32_t row, double f[MS_MODES]) {
  const double *x = model->scene->x + 3 * (size_t)model->unknowns.particle[row];
  f[0] = 1;
  for (int c = 0; c < 3; c++) f[c + 1] = model->features & MS_HAS_DIRECTIONS ? x[c] : 0;
}

/*------------------------------------- an orthonormal basis -------------------------------------*/

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

/* v = (u^T u)^-1 v for the vectors from `first` on, side by side */
static void solve_laplacian(const ms_modes_workspace *w, int32_t n, int first) {
  double(*v)[MS_MODES] = w->v;
  for (int32_t k = 0; k < n; k++) {
    const double *row = w->u + k * n;
    for (int m = first; m < MS_MODES; m++) v[k][m] /= row[k];
    for (int32_t i = k + 1; i < w->end[k]; i++)
      for (int m = first; m < MS_MODES; m++) v[i][m] -= row[i] * v[k][m];
  }
  for (int32_t k = n - 1; k >= 0; k--) {
    const double *row = w->u + k * n;
    for (int32_t i = w->end[k] - 1; i > k; i--)
      for (int m = first; m < MS_MODES; m++) v[k][m] -= row[i] * v[i][m];
    for (int m = first; m < MS_MODES; m++) v[k][m] /= row[k];
  }
}

/* Vector m less its projections on the first `count` ones, which are orthonormal. Returns its
 * length. */
static double orthogonalise(int32_t n, double (*v)[MS_MODES], int m, int count) {
  double square = 0;
  for (int other = 0; other < count; other++) {
    double dot = 0;
    for (int32_t i = 0; i < n; i++) dot += v[i][other] * v[i][m];
    for (int32_t i = 0; i < n; i++) v[i][m] -= dot * v[i][other];
  }
  for (int32_t i = 0; i < n; i++) square += v[i][m] * v[i][m];
  return sqrt(square);
}

static void normalise(int32_t n, double (*v)[MS_MODES], int m, double length) {
  for (int32_t i = 0; i < n; i++) v[i][m] /= length;
}

/* Modified Gram-Schmidt, from vector `first` on */
static void orthonormalise(int32_t n, double (*v)[MS_MODES], int first) {
  for (int m = first; m < MS_MODES; m++) normalise(n, v, m, orthogonalise(n, v, m, m));
}

/* A coordinate is not independent where only a LITTLE part of it is none of the others', as in a
 * tilted cloth that is nearly flat. */
int ms_modes_orthonormalise_coordinates(int32_t n, double (*v)[MS_MODES]) {
  const double LITTLE = 0.1;
  double largest = 0;
  int known = 1;
  normalise(n, v, 0, orthogonalise(n, v, 0, 0));
  for (int m = 1; m < MS_MODES; m++) largest = fmax(largest, orthogonalise(n, v, m, 1));
  for (int m = 1; m < MS_MODES; m++) {
    for (int32_t i = 0; i < n; i++) v[i][known] = v[i][m];
    const double length = orthogonalise(n, v, known, known);
    if (length > LITTLE * largest) normalise(n, v, known++, length);
  }
  return known;
}

/* Inverse iteration. The start is a quadratic sequence, as a linear one may be a coordinate. */
void ms_modes_complete(int32_t n, double mean, ms_modes_workspace *w) {
  enum { ITERATIONS = 8 };
  const int known = ms_modes_orthonormalise_coordinates(n, w->v);
  if (known == MS_MODES) return;
  factor_laplacian(n, mean, w);
  for (int32_t i = 0; i < n; i++)
    for (int m = known; m < MS_MODES; m++)
      w->v[i][m] = ms_vector_random_entry(MS_MODES * (uint32_t)i * (uint32_t)i + (uint32_t)m);
  orthonormalise(n, w->v, known);
  for (int round = 0; round < ITERATIONS; round++) {
    solve_laplacian(w, n, known);
    orthonormalise(n, w->v, known);
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
  return ms_scene_stiffness(j->model->scene, ms_springs_number(&j->model->springs, half_edge / 2));
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
  for (int32_t i = 0; i < n; i++) ms_modes_affine_functions(j->model, rows[i], w->v[i]);
  ms_modes_complete(n, assemble_laplacian(j, rows, n, w), w);
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
