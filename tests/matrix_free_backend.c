/* A correct backend without a matrix: preconditioned steepest descent by apply() and
 * precondition(). It checks what the host promises of vectors. */
#include <math.h>
#include <string.h>

#include "msim/backend.h"

typedef struct descent {
  const msim_host *host;
  double *r, *z, *q;
} descent;

static msim_status create(const msim_host *host, void **self) {
  descent *d = host->alloc(host, sizeof *d);
  *self = d;
  if (!d) return MSIM_ERR_MEMORY;
  *d = (descent){.host = host};
  return MSIM_OK;
}

static msim_status analyze(void *self, const msim_system *A, msim_solve_info *info) {
  descent *d = self;
  size_t bytes = 3 * (size_t)A->stride * sizeof(double);
  (void)info;
  if (A->val || A->rowptr || A->graphptr || A->stride < A->n) {
    d->host->fail(d->host, "a matrix where none was asked for");
    return MSIM_ERR_BACKEND;
  }
  d->r = d->host->alloc(d->host, bytes);
  d->z = d->host->alloc(d->host, bytes);
  d->q = d->host->alloc(d->host, bytes);
  return d->r && d->z && d->q ? MSIM_OK : MSIM_ERR_MEMORY;
}

static msim_status factor(void *self, const msim_system *A, int32_t kind, msim_solve_info *info) {
  (void)self, (void)A, (void)kind, (void)info;
  return MSIM_OK;
}

static double dot(size_t n, const double *x, const double *y) {
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

/* Is all that is not an unknown zero? */
static int padded(const msim_system *A, const double *x) {
  for (int32_t i = 0; i < 3 * A->stride; i++)
    if (i % A->stride >= A->n && x[i] != 0) return 0;
  return 1;
}

static msim_status solve(void *self, const msim_system *A, const msim_solve_params *params,
                         int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  descent *d = self;
  size_t n = 3 * (size_t)A->stride;
  (void)nrhs;
  if (!padded(A, b) || !padded(A, y)) {
    d->host->fail(d->host, "padding that is not zero");
    return MSIM_ERR_BACKEND;
  }
  for (; info->iterations < params->max_iterations; info->iterations++) {
    A->apply(A, y, d->q);
    if (!padded(A, d->q)) return MSIM_ERR_BACKEND;
    for (size_t i = 0; i < n; i++) d->r[i] = b[i] - d->q[i];
    if (sqrt(dot(n, d->r, d->r)) <= params->rtol * sqrt(dot(n, b, b))) return MSIM_OK;
    A->precondition(A, d->r, d->z);
    if (!padded(A, d->z)) return MSIM_ERR_BACKEND;
    A->apply(A, d->z, d->q);
    double curvature = dot(n, d->z, d->q);
    if (!(curvature > 0)) return MSIM_NOT_SPD;
    double alpha = dot(n, d->r, d->z) / curvature;
    for (size_t i = 0; i < n; i++) y[i] += alpha * d->z[i];
  }
  return MSIM_NOT_CONVERGED;
}

static void destroy(void *self) {
  descent *d = self;
  if (!d) return;
  d->host->free(d->host, d->r);
  d->host->free(d->host, d->z);
  d->host->free(d->host, d->q);
  d->host->free(d->host, d);
}

MSIM_BACKEND_ENTRY(matrix_free) {
  static const msim_backend table = {
      .abi = MSIM_BACKEND_ABI,
      .size = sizeof(msim_backend),
      .name = "matrix_free",
      .library = "none",
      .license = "MIT",
      .flags = MSIM_BACKEND_ITERATIVE,
      .format = MSIM_FORMAT_NONE,
      .create = create,
      .analyze = analyze,
      .factor = factor,
      .solve = solve,
      .destroy = destroy,
  };
  return &table;
}
