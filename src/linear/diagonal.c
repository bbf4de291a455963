/* diagonal - solves systems with a diagonal matrix, or one of diagonal blocks of particles: scenes
 * without springs */
#include "linear/linear.h"

/* y = D^-1 b for the diagonal block of a row, D = L d L^T, which is positive definite */
static void solve_block(const ms_unknowns *rows, const double *diagonal, int32_t r, const double *b,
                        double *y) {
  const size_t s = (size_t)rows->first_pinned;
  const double *d = diagonal + r, xx = d[0], yy = d[s], zz = d[2 * s];
  const double xy = d[3 * s] / xx, xz = d[4 * s] / xx, pivot = yy - xy * d[3 * s];
  const double yz = (d[5 * s] - xy * d[4 * s]) / pivot, last = zz - xz * d[4 * s] - yz * yz * pivot;
  double z[3];
  ms_unknowns_get(rows, b, r, z);
  z[1] -= xy * z[0], z[2] -= xz * z[0] + yz * z[1];
  z[2] /= last, z[1] = z[1] / pivot - yz * z[2];
  z[0] = z[0] / xx - xy * z[1] - xz * z[2];
  ms_unknowns_set(rows, z, r, y);
}

static msim_status diagonal_solve(ms_linear *self, const ms_linear_target *target, const double *b,
                                  double *y, int64_t *iterations, msim_error *err) {
  (void)target, (void)iterations, (void)err;
  const ms_unknowns *rows = &self->system->model->unknowns;
  if (self->system->a.own) {
    for (int32_t r = 0; r < rows->nfree; r++) solve_block(rows, self->system->a.diagonal, r, b, y);
    return MSIM_OK;
  }
  for (size_t c = 0; c < (size_t)rows->dims; c++) {
    const double *d = self->system->a.diagonal +
                      (self->system->a.block == 1 ? 0 : c) * (size_t)rows->first_pinned;
    const double *bc = b + c * (size_t)rows->stride;
    double *yc = y + c * (size_t)rows->stride;
    for (int32_t r = 0; r < rows->nfree; r++) yc[r] = bc[r] / d[r];
  }
  return MSIM_OK;
}

static void diagonal_destroy(ms_linear *self) {
  if (self) ms_memory_free(&self->system->model->scene->alloc, self);
}

msim_status ms_diagonal_create(const ms_linear_system *system, ms_linear **linear,
                               msim_error *err) {
  static const ms_linear_ops ops = {.solve = diagonal_solve, .destroy = diagonal_destroy};
  *linear = ms_memory_allocate(&system->model->scene->alloc, 1, sizeof **linear);
  if (!*linear) return ms_error_set_memory(err, "the diagonal solver");
  **linear =
      (ms_linear){.ops = &ops, .system = system, .name = "diagonal", .symmetric = 1, .exact = 1};
  return MSIM_OK;
}
