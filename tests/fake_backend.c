/* A dense solver with the fault that its file name says: msim_backend_wrong_abi.so has a wrong ABI.
 * tests/loading.h copies the file under many names. As `good`, or any name that is no fault, it is
 * a correct backend: Gaussian elimination without pivoting. */
#define _GNU_SOURCE /* dladdr */
#include <dlfcn.h>
#include <math.h>
#include <string.h>

#include "msim/backend.h"

static char name[64]; /* the part of the file name between "msim_backend_" and ".so" */

static int is(const char *vice) { return strcmp(name, vice) == 0; }

/* Writes to a const array, on purpose. */
static void spoil(const double *x) { *(double *)(uintptr_t)x += 1; }

/*------------------------------------- the solver -----------------------------------------------*/

typedef struct dense {
  const msim_host *host;
  double *a;
  int factors;
} dense;

static msim_status complain(const dense *d, msim_status status, const char *what) {
  d->host->fail(d->host, "%s", what);
  return status;
}

static msim_status create(const msim_host *host, void **self) {
  *self = NULL;
  if (is("no_self")) return MSIM_OK;
  dense *d = host->alloc(host, sizeof *d);
  *self = d;
  if (!d) return MSIM_ERR_MEMORY;
  *d = (dense){.host = host};
  return is("create_fails") ? complain(d, MSIM_ERR_BACKEND, "nobody is at home") : MSIM_OK;
}

static msim_status order(void *self, int32_t n, const int32_t *ptr, const int32_t *ind,
                         int32_t *perm) {
  (void)ptr, (void)ind;
  for (int32_t k = 0; k < n; k++) perm[k] = n - 1 - k;
  if (is("row_too_large")) perm[1] = n;
  if (is("row_negative")) perm[n - 1] = -1;
  if (is("row_twice")) perm[0] = perm[n - 1];
  return is("order_fails") ? complain(self, MSIM_ERR_BACKEND, "no order in here") : MSIM_OK;
}

static msim_status analyze(void *self, const msim_system *A, msim_solve_info *info) {
  dense *d = self;
  if (!d || is("silent")) return MSIM_ERR_BACKEND;
  if (A->n < 1 || A->block < 1 || A->block > 3 || A->format != MSIM_FORMAT_FULL)
    return complain(d, MSIM_ERR_ARG, "a full matrix of small blocks, please");
  const size_t n = (size_t)(A->block * A->n);
  d->a = d->host->alloc(d->host, n * n * sizeof *d->a);
  if (!d->a) return MSIM_ERR_MEMORY;
  info->fill = is("nan_in_info") ? NAN : (double)n * (double)n;
  info->flops = is("nan_in_info") ? NAN : 2.0 / 3 * (double)n * (double)n * (double)n;
  if (is("writes_pattern")) ++*(int32_t *)(uintptr_t)&A->colind[1];
  return is("fails") ? complain(d, MSIM_ERR_BACKEND, "the moon is in the wrong house") : MSIM_OK;
}

static msim_status factor(void *self, const msim_system *A, int32_t kind, msim_solve_info *info) {
  dense *d = self;
  const int32_t n = A->block * A->n;
  (void)kind, (void)info;
  if (is("never_spd")) return MSIM_NOT_SPD;
  if (is("once_spd") && d->factors++ > 0) return MSIM_NOT_SPD;
  if (is("stops")) return MSIM_STOPPED;
  if (is("invents_a_status")) return 77;
  if (is("invents_an_error")) return -99;
  memset(d->a, 0, (size_t)n * (size_t)n * sizeof *d->a);
  for (int32_t r = 0; r < n; r++)
    for (int32_t e = A->rowptr[r]; e < A->rowptr[r + 1]; e++)
      d->a[n * r + A->colind[e]] = A->val[e];
  if (is("writes_values")) spoil(&A->val[0]);
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
  (void)params;
  if (nrhs < 1) return complain(d, MSIM_ERR_ARG, "a right side, please");
  for (int32_t k = 0; k < nrhs; k++) solve_one(d, n, b + n * k, y + n * k);
  if (is("nan_answer")) y[n / 2] = NAN;
  if (is("inf_answer")) y[n / 2] = INFINITY;
  for (int32_t r = 0; is("liar") && r < n; r++) y[r] = 1;
  if (is("writes_right_side")) spoil(&b[0]);
  if (is("counts_backwards")) info->iterations = -1000;
  if (is("nan_in_info")) info->residual = NAN;
  return is("never_there") ? MSIM_NOT_CONVERGED : MSIM_OK;
}

static void destroy(void *self) {
  dense *d = self;
  if (!d) return;
  d->host->free(d->host, d->a);
  d->host->free(d->host, d);
}

/*------------------------------------- the table ------------------------------------------------*/

static msim_backend table = {.abi = MSIM_BACKEND_ABI,
                             .size = sizeof table,
                             .name = name,
                             .library = "none",
                             .license = "MIT",
                             .format = MSIM_FORMAT_FULL,
                             .create = create,
                             .order = order,
                             .analyze = analyze,
                             .factor = factor,
                             .solve = solve,
                             .destroy = destroy};

static void learn_name(void) {
  Dl_info file;
  const char *at = dladdr(&table, &file) ? strstr(file.dli_fname, "/msim_backend_") : NULL;
  if (!at) return;
  at += strlen("/msim_backend_");
  const size_t length = strcspn(at, ".");
  if (length < sizeof name) memcpy(name, at, length);
}

MSIM_BACKEND_ENTRY(fake) {
  learn_name();
  if (is("wrong_abi")) table.abi = 99;
  if (is("short_table")) table.size = 16;
  if (is("shorter_by_one")) table.size = MSIM_BACKEND_SIZE_1 - 1;
  if (is("long_table")) table.size = 4096;
  if (is("other_name")) table.name = "somebody-else";
  if (is("no_name")) table.name = NULL;
  if (is("no_library")) table.library = NULL;
  if (is("no_license")) table.license = NULL;
  if (is("no_create")) table.create = NULL;
  if (is("no_order")) table.order = NULL;
  if (is("no_analyze")) table.analyze = NULL;
  if (is("no_factor")) table.factor = NULL;
  if (is("no_solve")) table.solve = NULL;
  if (is("no_destroy")) table.destroy = NULL;
  if (is("format_3")) table.format = 3;
  if (is("format_minus_1")) table.format = -1;
  return is("no_table") ? NULL : &table;
}
