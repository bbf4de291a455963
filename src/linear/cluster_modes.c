#include "linear/cluster_modes.h"

#include <math.h>

#include "linear/modes.h"

typedef struct cluster_job {
  const ms_model *model;
  const ms_aggregates *a;
  const int32_t *of; /* the cluster of each aggregate */
  int32_t *local;    /* the index in its cluster of each aggregate */
  double largest;    /* stiffness of a spring */
  ms_modes_workspace w;
} cluster_job;

/* u += by x (x) y, 4 x 4, at (row, column) */
static void add_outer(double *u, int32_t n, int32_t row, int32_t column, double by, const float *x,
                      const float *y) {
  for (int32_t i = 0; i < MS_MODES; i++)
    for (int32_t j = 0; j < MS_MODES; j++)
      u[(row + i) * n + column + j] += by * (double)x[i] * (double)y[j];
}

/* The springs of unknown r, each at both of its ends, to other unknowns of its cluster */
static void add_springs(cluster_job *j, int32_t r, int32_t n) {
  const ms_half_edges *half_edges = &j->model->half_edges;
  const float *weight = j->a->weight, *own = weight + MS_MODES * r;
  const int32_t k = j->a->of[r], row = MS_MODES * j->local[k];
  const ms_half_edge_span span = ms_half_edges_of_row(half_edges, r);
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t neighbour = ms_half_edges_neighbour(half_edges, at);
    const int32_t other = ms_aggregates_find(j->model, j->a, neighbour);
    if (half_edges->spring[at] < 0 || other < 0 || j->of[other] != j->of[k]) continue;
    const double stiffness =
        half_edges->stiffness[ms_half_edges_value(half_edges, at)] / j->largest;
    add_outer(j->w.u, n, row, row, stiffness, own, own);
    if (j->local[other] >= j->local[k])
      add_outer(j->w.u, n, row, MS_MODES * j->local[other], -stiffness, own,
                weight + MS_MODES * neighbour);
  }
}

/* w.u = the upper triangle of P^T K P of the cluster, and w.v = P^T of the affine functions.
 * Returns the mean of the diagonal. */
static double assemble(cluster_job *j, const int32_t *aggregates, int32_t count) {
  const int32_t n = MS_MODES * count;
  double sum = 0;
  for (int32_t i = 0; i < n * n; i++) j->w.u[i] = 0;
  for (int32_t i = 0; i < n; i++) j->w.end[i] = n;
  for (int32_t i = 0; i < n; i++)
    for (int q = 0; q < MS_MODES; q++) j->w.v[i][q] = 0;
  for (int32_t p = 0; p < count; p++)
    for (int32_t i = j->a->first[aggregates[p]]; i < j->a->first[aggregates[p] + 1]; i++) {
      const int32_t r = j->a->unknown[i];
      add_springs(j, r, n);
      double f[MS_MODES];
      ms_modes_affine_functions(j->model, r, f);
      for (int m = 0; m < MS_MODES; m++)
        for (int q = 0; q < MS_MODES; q++)
          j->w.v[MS_MODES * p + m][q] += (double)j->a->weight[MS_MODES * r + m] * f[q];
    }
  for (int32_t i = 0; i < n; i++) sum += j->w.u[i * n + i];
  return sum / n;
}

static void store(const cluster_job *j, const int32_t *aggregates, int32_t count, float *modes) {
  for (int32_t p = 0; p < count; p++)
    for (int m = 0; m < MS_MODES; m++)
      for (int q = 0; q < MS_MODES; q++)
        modes[16 * aggregates[p] + MS_MODES * m + q] = (float)j->w.v[MS_MODES * p + q][m];
}

static double find_largest_stiffness(const ms_half_edges *half_edges) {
  double largest = 0;
  for (size_t at = 0; at < half_edges->nvalues; at++)
    largest = fmax(largest, half_edges->stiffness[at]);
  return largest > 0 ? largest : 1;
}

msim_status ms_cluster_modes_compute(const ms_model *model, const ms_aggregates *aggregates,
                                     const int32_t *of, int32_t n, const ms_buckets *members,
                                     float *modes, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  cluster_job j = {.model = model, .a = aggregates, .of = of};
  int32_t largest = 0;
  for (int32_t k = 0; k < n; k++)
    if (members->first[k + 1] - members->first[k] > largest)
      largest = members->first[k + 1] - members->first[k];
  const int fits = MS_NEW(alloc, j.local, aggregates->n) &&
                   ms_modes_create_workspace(alloc, MS_MODES * largest, &j.w);
  if (fits) j.largest = find_largest_stiffness(&model->half_edges);
  for (int32_t k = 0; k < n && fits; k++) {
    const int32_t *own = members->item + members->first[k];
    const int32_t count = members->first[k + 1] - members->first[k];
    for (int32_t p = 0; p < count; p++) j.local[own[p]] = p;
    ms_modes_complete(MS_MODES * count, assemble(&j, own, count), &j.w);
    store(&j, own, count, modes);
  }
  ms_modes_destroy_workspace(alloc, &j.w);
  ms_memory_free(alloc, j.local);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the modes of the clusters");
}
