/* Backends that do what no backend should, one a definition of FAKE: tests/test_plugins.c loads
 * them. Without FAKE a correct one: dense Gaussian elimination without pivoting. */
#include <math.h>
#include <string.h>

#include "msim/backend.h"

#define GOOD        0
#define WRONG_ABI   1
#define SHORT_TABLE 2
#define OTHER_NAME  3
#define NO_TABLE    4
#define NO_ENTRY    5
#define LIAR        6
#define NAN_ANSWER  7
#define FAILS       8
#define SILENT      9
#ifndef FAKE
#  define FAKE GOOD
#endif
#define TEXT_(x) #x
#define TEXT(x)  TEXT_(x)

typedef struct dense {
  const msim_host *host;
  double *a;
} dense;

static msim_status create(const msim_host *host, void **self) {
  dense *d = host->alloc(host, sizeof *d);
  *self = d;
  if (!d) return MSIM_ERR_MEMORY;
  *d = (dense){host, NULL};
  return MSIM_OK;
}

static msim_status refuse(dense *d, const char *why) {
  d->host->fail(d->host, "%s", why);
  return MSIM_ERR_ARG;
}

static msim_status analyze(void *self, const msim_system *A, msim_solve_info *info) {
  dense *d = self;
  if (A->n < 1 || A->block < 1 || A->block > 3 || A->format != MSIM_FORMAT_FULL)
    return refuse(d, "a full matrix of small blocks, please");
  const size_t n = (size_t)(A->block * A->n);
#if FAKE == FAILS
  d->host->fail(d->host, "the moon is in the wrong house for %d unknowns", A->block * A->n);
  return MSIM_ERR_BACKEND;
#elif FAKE == SILENT
  return MSIM_ERR_BACKEND;
#endif
  d->a = d->host->alloc(d->host, n * n * sizeof *d->a);
  info->fill = (double)n * (double)n;
  info->flops = 2.0 / 3 * (double)n * (double)n * (double)n;
  return d->a ? MSIM_OK : MSIM_ERR_MEMORY;
}

static msim_status factor(void *self, const msim_system *A, int32_t kind, msim_solve_info *info) {
  dense *d = self;
  int32_t n = A->block * A->n;
  (void)kind, (void)info;
  memset(d->a, 0, (size_t)n * (size_t)n * sizeof *d->a);
  for (int32_t r = 0; r < n; r++)
    for (int32_t e = A->rowptr[r]; e < A->rowptr[r + 1]; e++)
      d->a[n * r + A->colind[e]] = A->val[e];
  for (int32_t k = 0; k < n; k++) {
    if (!(d->a[n * k + k] > 0)) return MSIM_NOT_SPD;
    for (int32_t r = k + 1; r < n; r++) {
      double q = d->a[n * r + k] /= d->a[n * k + k];
      for (int32_t c = k + 1; c < n; c++) d->a[n * r + c] -= q * d->a[n * k + c];
    }
  }
  return MSIM_OK;
}

static void solve_one(const dense *d, int32_t n, const double *b, double *y) {
  for (int32_t r = 0; r < n; r++) {
    y[r] = b[r];
    for (int32_t c = 0; c < r; c++) y[r] -= d->a[n * r + c] * y[c];
  }
  for (int32_t r = n - 1; r >= 0; r--) {
    for (int32_t c = r + 1; c < n; c++) y[r] -= d->a[n * r + c] * y[c];
    y[r] /= d->a[n * r + r];
  }
}

static msim_status solve(void *self, const msim_system *A, const msim_solve_params *params,
                         int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  dense *d = self;
  const int32_t n = A->block * A->n;
  (void)params, (void)info;
  if (nrhs < 1) return refuse(d, "a right side, please");
  for (int32_t k = 0; k < nrhs; k++) solve_one(d, n, b + n * k, y + n * k);
#if FAKE == LIAR
  for (int32_t r = 0; r < n; r++) y[r] = 1;
#elif FAKE == NAN_ANSWER
  y[n / 2] = NAN;
#endif
  return MSIM_OK;
}

static void destroy(void *self) {
  dense *d = self;
  if (!d) return;
  d->host->free(d->host, d->a);
  d->host->free(d->host, d);
}

static const msim_backend table = {
    .abi = FAKE == WRONG_ABI ? 99 : MSIM_BACKEND_ABI,
    .size = FAKE == SHORT_TABLE ? 16 : sizeof(msim_backend),
    .name = FAKE == OTHER_NAME ? "somebody-else" : TEXT(NAME),
    .library = "none",
    .license = "MIT",
    .format = MSIM_FORMAT_FULL,
    .create = create,
    .analyze = analyze,
    .factor = factor,
    .solve = solve,
    .destroy = destroy,
};

#if FAKE != NO_ENTRY
MSIM_BACKEND_ENTRY(fake) { return FAKE == NO_TABLE ? NULL : &table; }
#else
const msim_backend *something_else(void);
const msim_backend *something_else(void) { return &table; }
#endif
