#include "linear/elimination.h"

#include <math.h>
#include <string.h>

msim_status ms_elimination_create(const ms_model *model, ms_elimination *e, msim_error *err) {
  const size_t n = (size_t)model->unknowns.dims * (size_t)model->unknowns.nfree;
  if (n > MS_ELIMINATION_MAX_UNKNOWNS || model->shape.ranks) return MSIM_OK;
  ms_sparse_graph graph;
  msim_status status = ms_sparse_matrix_create_graph(model, &graph, err);
  if (!status)
    status = ms_sparse_matrix_create(
        model, &graph, (ms_sparse_layout){MSIM_FORMAT_FULL, model->unknowns.dims, NULL}, &e->matrix,
        err);
  ms_sparse_matrix_destroy_graph(model, &graph);
  if (status) return status;
  const int fits =
      MS_NEW(&model->scene->alloc, e->a, n * (n + 1)) && MS_NEW(&model->scene->alloc, e->packed, n);
  return fits ? MSIM_OK : ms_error_set_memory(err, "Gaussian elimination");
}

void ms_elimination_destroy(const ms_model *model, ms_elimination *e) {
  MS_FREE(&model->scene->alloc, e->packed, e->a);
  ms_sparse_matrix_destroy(model, &e->matrix);
  *e = (ms_elimination){0};
}

/* [A | b] */
static void fill_augmented_matrix(const ms_elimination *e, size_t n) {
  const ms_sparse_matrix *m = &e->matrix;
  memset(e->a, 0, n * (n + 1) * sizeof *e->a);
  for (size_t row = 0; row < n; row++) {
    double *to = e->a + row * (n + 1);
    for (int32_t at = m->rowptr[row]; at < m->rowptr[row + 1]; at++) to[m->colind[at]] = m->val[at];
    to[n] = e->packed[row];
  }
}

/* Partial pivoting: the row at or below `top` with the largest entry of that column goes there. */
static void swap_pivot_row(double *a, size_t n, size_t top) {
  size_t best = top;
  for (size_t row = top + 1; row < n; row++)
    if (fabs(a[row * (n + 1) + top]) > fabs(a[best * (n + 1) + top])) best = row;
  for (size_t c = top; c <= n && best > top; c++) {
    const double kept = a[top * (n + 1) + c];
    a[top * (n + 1) + c] = a[best * (n + 1) + c];
    a[best * (n + 1) + c] = kept;
  }
}

/* [A | b] becomes [U | c], where U y = c, and U has ones on its diagonal, which are not stored.
 * Returns 0 if A is singular. */
static int eliminate_columns(double *a, size_t n) {
  for (size_t k = 0; k < n; k++) {
    swap_pivot_row(a, n, k);
    double *from = a + k * (n + 1);
    if (from[k] == 0) return 0;
    const double by = 1 / from[k];
    for (size_t c = k + 1; c <= n; c++) from[c] *= by;
    for (size_t row = k + 1; row < n; row++) {
      double *to = a + row * (n + 1);
      for (size_t c = k + 1; c <= n && to[k] != 0; c++) to[c] -= to[k] * from[c];
    }
  }
  return 1;
}

msim_status ms_elimination_solve(ms_elimination *e, const ms_linear_system *system, const double *b,
                                 double *y) {
  const ms_model *model = system->model;
  const size_t n = (size_t)model->unknowns.dims * (size_t)model->unknowns.nfree;
  ms_sparse_matrix_assemble(model, &system->a, &e->matrix);
  ms_sparse_matrix_add_damping_derivative(model, &system->damping_derivative, &e->matrix);
  ms_sparse_matrix_pack(model, &e->matrix, b, e->packed);
  fill_augmented_matrix(e, n);
  if (!eliminate_columns(e->a, n)) return MSIM_NOT_CONVERGED;
  for (size_t row = n; row-- > 0;) {
    const double *from = e->a + row * (n + 1);
    e->packed[row] = from[n];
    for (size_t c = row + 1; c < n; c++) e->packed[row] -= from[c] * e->packed[c];
  }
  ms_sparse_matrix_unpack(model, &e->matrix, e->packed, y);
  return MSIM_OK;
}
