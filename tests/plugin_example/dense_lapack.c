/* dense-lapack - LAPACK's dense Cholesky factorization as a linear solver of msim
 *
 * An example to start a solver plugin from. It needs only the headers of msim and the library that
 * it wraps: a plugin does not link to libmsim. Suitable for some hundred particles. */
#include <string.h>

#include <msim/backend.h>

/* LAPACK is Fortran: every argument is a pointer, and the lengths of strings follow at the end. */
void dpotrf_(const char *uplo, const int *n, double *a, const int *lda, int *info, size_t);
void dpotrs_(const char *uplo, const int *n, const int *nrhs, const double *a, const int *lda,
             double *b, const int *ldb, int *info, size_t);

/* The state of one instance. Several may exist at a time, so there are no global variables. */
typedef struct dense {
  const msim_host *host; /* provides memory and takes error messages */
  int n;                 /* number of unknowns */
  double *a;             /* n x n, dense: A, then its factor */
} dense;

/* An error is a status < 0 with a message for the user. */
static msim_status refuse(dense *self, const char *why) {
  self->host->fail(self->host, "%s", why);
  return MSIM_ERR_ARG;
}

static msim_status create(const msim_host *host, void **result) {
  dense *self = host->alloc(host, sizeof *self);
  *result = self;
  if (!self) return MSIM_ERR_MEMORY;
  *self = (dense){.host = host};
  return MSIM_OK;
}

/* Called once, before there are values: allocate here. n block rows are `block` unknowns each. */
static msim_status analyze(void *data, const msim_system *A, msim_solve_info *info) {
  dense *self = data;
  if (A->n < 1 || A->block < 1 || A->block > 3 || A->format != MSIM_FORMAT_UPPER)
    return refuse(self, "needs an UPPER matrix of 1 x 1, 2 x 2 or 3 x 3 blocks");
  if (A->n > 10000) return refuse(self, "has a dense matrix: the limit is 10000 block rows");
  self->n = A->block * A->n;
  const size_t n = (size_t)self->n;
  self->a = self->host->alloc(self->host, n * n * sizeof *self->a);
  if (!self->a) return MSIM_ERR_MEMORY;
  info->fill = 0.5 * (double)n * (double)(n + 1);
  info->flops = (double)n * (double)n * (double)n / 3;
  return MSIM_OK;
}

/* A = L L^T, computed each time the values are new. LAPACK stores by columns: the upper triangle,
 * which the host gives by rows, is its lower one. It reads that triangle only. */
static msim_status factor(void *data, const msim_system *A, int32_t kind, msim_solve_info *info) {
  dense *self = data;
  const size_t n = (size_t)self->n;
  int bad;
  (void)kind; /* always MSIM_FACTOR_SPD, as the table has no other flags */
  memset(self->a, 0, n * n * sizeof *self->a);
  for (size_t row = 0; row < n; row++)
    for (int32_t e = A->rowptr[row]; e < A->rowptr[row + 1]; e++)
      self->a[n * row + (size_t)A->colind[e]] = A->val[e];
  dpotrf_("L", &self->n, self->a, &self->n, &bad, 1);
  info->definite = bad ? MSIM_DEFINITE_NOT : MSIM_DEFINITE_POSITIVE;
  return bad ? MSIM_NOT_SPD : MSIM_OK; /* not an error: the host handles an indefinite matrix */
}

/* L L^T y = b for each right-hand side */
static msim_status solve(void *data, const msim_system *A, const msim_solve_params *params,
                         int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  dense *self = data;
  int bad;
  (void)A, (void)params, (void)info; /* a direct solver needs no tolerance */
  if (nrhs < 1) return refuse(self, "needs at least one right-hand side");
  memcpy(y, b, (size_t)nrhs * (size_t)self->n * sizeof *y);
  dpotrs_("L", &self->n, &nrhs, self->a, &self->n, y, &self->n, &bad, 1);
  return MSIM_OK;
}

static void destroy(void *data) {
  dense *self = data;
  if (!self) return;
  self->host->free(self->host, self->a);
  self->host->free(self->host, self);
}

/* The only symbol that the plugin exports. Members left out are 0: no flags, the order of the
 * host. */
MSIM_BACKEND_ENTRY(dense_lapack) {
  static const msim_backend table = {.abi = MSIM_BACKEND_ABI,
                                     .size = sizeof table,
                                     .name = "dense-lapack",
                                     .library = "LAPACK",
                                     .license = "BSD-3-Clause",
                                     .format = MSIM_FORMAT_UPPER,
                                     .create = create,
                                     .analyze = analyze,
                                     .factor = factor,
                                     .solve = solve,
                                     .destroy = destroy};
  return &table;
}
