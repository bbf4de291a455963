/* diagonal - solves systems with a diagonal matrix: scenes without springs */
#include "linear/linear.h"

static msim_status diagonal_solve(ms_linear *self, const ms_linear_target *target, const double *b,
                                  double *y, int64_t *iterations, msim_error *err) {
  (void)target, (void)iterations, (void)err;
  const ms_unknowns *rows = &self->system->model->unknowns;
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
