/* CHOLMOD with default settings, called as in the introduction of its user guide: start, analyze,
 * factorize, solve. */
#include <cholmod.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "solver.h"

#define STRING_(x) #x
#define STRING(x)  STRING_(x)

static cholmod_common common;
static cholmod_sparse *matrix;
static cholmod_factor *factor;
static cholmod_dense *right;

static void free_cholmod_objects(void) {
  cholmod_free_sparse(&matrix, &common);
  cholmod_free_factor(&factor, &common);
  cholmod_free_dense(&right, &common);
}

/* Copies the upper triangle in the order of the particles, the least expensive form that a user may
 * pass. Column i of A is its row i. */
static int copy_upper(const csr_system *s) {
  const size_t n = (size_t)s->n;
  size_t count = 0;
  for (int32_t i = 0; i < s->n; i++)
    for (int32_t e = s->rowptr[i]; e < s->rowptr[i + 1]; e++) count += s->colind[e] <= i;
  matrix = cholmod_allocate_sparse(n, n, count, 1, 1, 1, CHOLMOD_REAL, &common);
  right = cholmod_allocate_dense(n, 1, n, CHOLMOD_REAL, &common);
  if (!matrix || !right) return 0;
  int *p = matrix->p, *row = matrix->i, at = 0;
  double *x = matrix->x;
  for (int32_t i = 0; i < s->n; i++) {
    p[i] = at;
    for (int32_t e = s->rowptr[i]; e < s->rowptr[i + 1]; e++)
      if (s->colind[e] <= i) row[at] = s->colind[e], x[at++] = s->val[e];
  }
  p[n] = at;
  memcpy(right->x, s->b, n * sizeof *s->b);
  return 1;
}

static int cholmod_reference_prepare(const csr_system *system) {
  static int started;
  if (!started) started = cholmod_start(&common);
  free_cholmod_objects();
  if (!copy_upper(system)) return 0;
  factor = cholmod_analyze(matrix, &common);
  return factor != NULL;
}

static int cholmod_reference_solve(int variant, double *x, reference_reply *reply) {
  (void)variant;
  double start = clock_seconds();
  cholmod_factorize(matrix, factor, &common);
  double factored = clock_seconds();
  cholmod_dense *solution = cholmod_solve(CHOLMOD_A, factor, right, &common);
  reply->factor_s = factored - start;
  reply->solve_s = clock_seconds() - factored;
  int good = solution && common.status == CHOLMOD_OK;
  if (good) memcpy(x, solution->x, matrix->nrow * sizeof *x);
  else
    snprintf(reply->reason, sizeof reply->reason, "CHOLMOD failed with status %d", common.status);
  cholmod_free_dense(&solution, &common);
  return good;
}

const reference_solver solver = {
    .hello = {.library = "CHOLMOD " STRING(CHOLMOD_MAIN_VERSION) "." STRING(
                  CHOLMOD_SUB_VERSION) "." STRING(CHOLMOD_SUBSUB_VERSION),
              .nvariants = 1,
              .variants = {"default cholmod"},
              .rest_s = 0.05},
    .prepare = cholmod_reference_prepare,
    .solve = cholmod_reference_solve};
