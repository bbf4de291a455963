/* A dense solver with the fault that its file name says: msim_backend_wrong_abi.so has a wrong ABI.
 * tests/faulty_plugins.h copies the file under many names. As `good`, or any name that is no fault,
 * it is a correct backend: Gaussian elimination without pivoting. */
#define _GNU_SOURCE /* dladdr */
#include <dlfcn.h>
#include <math.h>
#include <string.h>

#include "msim/backend.h"

static char name[64]; /* the part of the file name between "msim_backend_" and ".so" */

static int has_fault(const char *vice) { return strcmp(name, vice) == 0; }

/* Writes to a const array, on purpose. */
static void overwrite_const(const double *x) { *(double *)(uintptr_t)x += 1; }

/*------------------------------------- the solver -----------------------------------------------*/

typedef struct dense {
  const msim_host *host;
  double *a;
  int factors;
} dense;

static msim_status report_error(const dense *d, msim_status status, const char *what) {
  d->host->fail(d->host, "%s", what);
  return status;
}

static msim_status fake_create(const msim_host *host, void **self) {
  *self = NULL;
  if (has_fault("no_instance")) return MSIM_OK;
  dense *d = host->alloc(host, sizeof *d);
  *self = d;
  if (!d) return MSIM_ERR_MEMORY;
  *d = (dense){.host = host};
  return has_fault("create_fails") ? report_error(d, MSIM_ERR_BACKEND, "create failed on request")
                                   : MSIM_OK;
}

static msim_status fake_order(void *self, int32_t n, const int32_t *ptr, const int32_t *ind,
                              int32_t *perm) {
  (void)ptr, (void)ind;
  for (int32_t k = 0; k < n; k++) perm[k] = n - 1 - k;
  if (has_fault("row_too_large")) perm[1] = n;
  if (has_fault("row_negative")) perm[n - 1] = -1;
  if (has_fault("row_twice")) perm[0] = perm[n - 1];
  return has_fault("order_fails") ? report_error(self, MSIM_ERR_BACKEND, "order failed on request")
                                  : MSIM_OK;
}

static msim_status fake_analyze(void *self, const msim_system *A, msim_solve_info *info) {
  dense *d = self;
  if (!d || has_fault("silent")) return MSIM_ERR_BACKEND;
  if (A->n < 1 || A->block < 1 || A->block > 3 || A->format != MSIM_FORMAT_FULL)
    return report_error(d, MSIM_ERR_ARG, "needs a FULL matrix of blocks of 1 to 3");
  const size_t n = (size_t)(A->block * A->n);
  d->a = d->host->alloc(d->host, n * n * sizeof *d->a);
  if (!d->a) return MSIM_ERR_MEMORY;
  info->fill = has_fault("nan_in_info") ? NAN : (double)n * (double)n;
  info->flops = has_fault("nan_in_info") ? NAN : 2.0 / 3 * (double)n * (double)n * (double)n;
  if (has_fault("writes_pattern")) ++*(int32_t *)(uintptr_t)&A->colind[1];
  return has_fault("fails") ? report_error(d, MSIM_ERR_BACKEND, "analyze failed on request")
                            : MSIM_OK;
}

static msim_status fake_factor(void *self, const msim_system *A, int32_t kind,
                               msim_solve_info *info) {
  dense *d = self;
  const int32_t n = A->block * A->n;
  (void)kind, (void)info;
  if (has_fault("never_spd")) return MSIM_NOT_SPD;
  if (has_fault("once_spd") && d->factors++ > 0) return MSIM_NOT_SPD;
  if (has_fault("stops")) return MSIM_STOPPED;
  if (has_fault("invents_a_status")) return 77;
  if (has_fault("invents_an_error")) return -99;
  memset(d->a, 0, (size_t)n * (size_t)n * sizeof *d->a);
  for (int32_t r = 0; r < n; r++)
    for (int32_t e = A->rowptr[r]; e < A->rowptr[r + 1]; e++)
      d->a[n * r + A->colind[e]] = A->val[e];
  if (has_fault("writes_values")) overwrite_const(&A->val[0]);
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

static msim_status fake_solve(void *self, const msim_system *A, const msim_solve_params *params,
                              int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  dense *d = self;
  const int32_t n = A->block * A->n;
  (void)params;
  if (nrhs < 1) return report_error(d, MSIM_ERR_ARG, "needs at least one right-hand side");
  for (int32_t k = 0; k < nrhs; k++) solve_one(d, n, b + n * k, y + n * k);
  if (has_fault("nan_answer")) y[n / 2] = NAN;
  if (has_fault("inf_answer")) y[n / 2] = INFINITY;
  for (int32_t r = 0; has_fault("liar") && r < n; r++) y[r] = 1;
  if (has_fault("writes_rhs")) overwrite_const(&b[0]);
  if (has_fault("counts_backwards")) info->iterations = -1000;
  if (has_fault("nan_in_info")) info->residual = NAN;
  return has_fault("never_converges") ? MSIM_NOT_CONVERGED : MSIM_OK;
}

static void fake_destroy(void *self) {
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
                             .create = fake_create,
                             .order = fake_order,
                             .analyze = fake_analyze,
                             .factor = fake_factor,
                             .solve = fake_solve,
                             .destroy = fake_destroy};

static void read_file_name(void) {
  Dl_info file;
  const char *at = dladdr(&table, &file) ? strstr(file.dli_fname, "/msim_backend_") : NULL;
  if (!at) return;
  at += strlen("/msim_backend_");
  const size_t length = strcspn(at, ".");
  if (length < sizeof name) memcpy(name, at, length);
}

static int32_t choose_unknown(void *self) {
  (void)self;
  return 7;
}

MSIM_BACKEND_ENTRY(fake) {
  read_file_name();
  if (has_fault("wrong_abi")) table.abi = 99;
  if (has_fault("short_table")) table.size = 16;
  if (has_fault("shorter_by_one")) table.size = MSIM_BACKEND_SIZE_1 - 1;
  if (has_fault("long_table")) table.size = 4096;
  if (has_fault("other_name")) table.name = "somebody-else";
  if (has_fault("no_name")) table.name = NULL;
  if (has_fault("no_library")) table.library = NULL;
  if (has_fault("no_license")) table.license = NULL;
  if (has_fault("no_create")) table.create = NULL;
  if (has_fault("no_order")) table.order = NULL;
  if (has_fault("no_analyze")) table.analyze = NULL;
  if (has_fault("no_factor")) table.factor = NULL;
  if (has_fault("no_solve")) table.solve = NULL;
  if (has_fault("no_destroy")) table.destroy = NULL;
  if (has_fault("format_3")) table.format = 3;
  if (has_fault("format_minus_1")) table.format = -1;
  if (has_fault("chooses_7")) table.choose_format = choose_unknown;
  return has_fault("no_table") ? NULL : &table;
}
