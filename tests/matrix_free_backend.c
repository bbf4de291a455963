/* A correct backend without a matrix, for tests: conjugate gradients by apply() and two_level(),
 * also where ranks share the system; precondition() is for the norm. It checks the padding of
 * vectors that the host guarantees. */
#include <math.h>
#include <string.h>

#include "msim/backend.h"
#include "msim/comm.h"

typedef struct cg_solver {
  const msim_host *host;
  double *r, *z, *p, *q; /* residual, preconditioned residual, direction, A p */
} cg_solver;

static msim_status cg_fail(cg_solver *g, msim_status status, const char *why) {
  g->host->fail(g->host, "%s", why);
  return status;
}

static msim_status cg_create(const msim_host *host, void **self) {
  cg_solver *g = host->alloc(host, sizeof *g);
  *self = g;
  if (!g) return MSIM_ERR_MEMORY;
  *g = (cg_solver){.host = host};
  return MSIM_OK;
}

static size_t length(const msim_system *A) { return (size_t)A->block * (size_t)A->stride; }

static msim_status cg_analyze(void *self, const msim_system *A, msim_solve_info *info) {
  cg_solver *g = self;
  (void)info;
  if (A->n < 1 || A->block < 1 || A->block > 3 || A->format != MSIM_FORMAT_NONE)
    return cg_fail(g, MSIM_ERR_ARG, "needs format NONE and blocks of 1 to 3");
  if (A->val || A->rowptr || A->graphptr || A->stride < A->n)
    return cg_fail(g, MSIM_ERR_BACKEND, "received a matrix with format NONE");
  double **work[] = {&g->r, &g->z, &g->p, &g->q};
  for (size_t i = 0; i < 4; i++) {
    *work[i] = g->host->alloc(g->host, length(A) * sizeof(double));
    if (!*work[i]) return MSIM_ERR_MEMORY;
  }
  return MSIM_OK;
}

static msim_status cg_factor(void *self, const msim_system *A, int32_t kind,
                             msim_solve_info *info) {
  (void)self, (void)A, (void)kind, (void)info;
  return MSIM_OK;
}

/* x.y over all ranks; of x only the unknowns count, as apply() overwrites its padding */
static double dot(const msim_system *A, const double *x, const double *y) {
  double sum = 0;
  for (size_t i = 0; i < length(A); i++)
    if (i % (size_t)A->stride < (size_t)A->n) sum += x[i] * y[i];
  if (A->comm && A->comm->sum(A->comm->self, 1, &sum)) return -1;
  return sum;
}

/* 1 if every entry that is no unknown is zero. */
static int is_padding_zero(const msim_system *A, const double *x) {
  for (size_t i = 0; i < length(A); i++)
    if (i % (size_t)A->stride >= (size_t)A->n && x[i] != 0) return 0;
  return 1;
}

/* r.z with z = D^-1 r */
static double preconditioned_norm2(cg_solver *g, const msim_system *A, const double *r) {
  A->precondition(A, r, g->z);
  return dot(A, r, g->z);
}

/* One search direction, from g->r; rho: r.z of the previous one, 0 at the start. */
static msim_status cg_iterate(cg_solver *g, const msim_system *A, double *rho, double *y) {
  const size_t n = length(A);
  A->two_level(A, g->r, g->z);
  const double next = dot(A, g->r, g->z), beta = *rho > 0 ? next / *rho : 0;
  for (size_t i = 0; i < n; i++) g->p[i] = g->z[i] + (*rho > 0 ? beta * g->p[i] : 0);
  A->apply(A, g->p, g->q);
  if (!is_padding_zero(A, g->z) || !is_padding_zero(A, g->q))
    return cg_fail(g, MSIM_ERR_BACKEND, "padding is not zero");
  const double curvature = dot(A, g->p, g->q);
  if (!(curvature > 0)) return MSIM_NOT_SPD;
  for (size_t i = 0; i < n; i++) y[i] += next / curvature * g->p[i];
  for (size_t i = 0; i < n; i++) g->r[i] -= next / curvature * g->q[i];
  *rho = next;
  return MSIM_OK;
}

/* When the residual of the recurrence meets the tolerance, restart from the true residual. */
static msim_status solve_one(cg_solver *g, const msim_system *A, const msim_solve_params *params,
                             const double *b, double *y, msim_solve_info *info) {
  const size_t n = length(A);
  const double goal = params->rtol * sqrt(preconditioned_norm2(g, A, b));
  double rho = 0, left = 0;
  for (int64_t i = 0;; i++, info->iterations++) {
    if (left <= goal) {
      A->apply(A, y, g->q);
      for (size_t k = 0; k < n; k++) g->r[k] = b[k] - g->q[k];
      rho = 0;
      if (sqrt(preconditioned_norm2(g, A, g->r)) <= goal) return MSIM_OK;
    }
    if (i == params->max_iterations) return MSIM_NOT_CONVERGED;
    const msim_status status = cg_iterate(g, A, &rho, y);
    if (status) return status;
    left = sqrt(preconditioned_norm2(g, A, g->r));
  }
}

static msim_status cg_solve(void *self, const msim_system *A, const msim_solve_params *params,
                            int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  cg_solver *g = self;
  msim_status status = MSIM_OK;
  if (nrhs < 1) return cg_fail(g, MSIM_ERR_ARG, "needs at least one right-hand side");
  for (; nrhs > 0 && !status; nrhs--, b += length(A), y += length(A)) {
    if (!is_padding_zero(A, b) || !is_padding_zero(A, y))
      return cg_fail(g, MSIM_ERR_BACKEND, "padding is not zero");
    status = solve_one(g, A, params, b, y, info);
  }
  return status;
}

static void cg_destroy(void *self) {
  cg_solver *g = self;
  if (!g) return;
  double *work[] = {g->r, g->z, g->p, g->q};
  for (size_t i = 0; i < 4; i++) g->host->free(g->host, work[i]);
  g->host->free(g->host, g);
}

MSIM_BACKEND_ENTRY(matrix_free) {
  static const msim_backend table = {
      .abi = MSIM_BACKEND_ABI,
      .size = sizeof(msim_backend),
      .name = "matrix_free",
      .library = "none",
      .license = "MIT",
      .flags = MSIM_BACKEND_ITERATIVE | MSIM_BACKEND_RANKS | MSIM_BACKEND_TWO_LEVEL,
      .format = MSIM_FORMAT_NONE,
      .create = cg_create,
      .analyze = cg_analyze,
      .factor = cg_factor,
      .solve = cg_solve,
      .destroy = cg_destroy,
  };
  return &table;
}
