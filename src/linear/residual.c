#include "linear/residual.h"

#include <float.h>
#include <math.h>

#include "base/ranks.h"
#include "linear/jacobi.h"

void ms_residual_compute_change_rhs(const ms_linear_system *s, const double *b, const double *base,
                                    double *to) {
  ms_coefficients_apply_massless(s->model, &s->a, base, to);
  ms_vector_add_scaled(s->model->shape, b, -1, to, to);
}

double ms_residual_compute(const ms_linear_system *s, const double *b, const double *y, double *r) {
  ms_linear_system_apply(s, y, r);
  ms_vector_add_scaled(s->model->shape, b, -1, r, r);
  return ms_jacobi_norm(s->model, &s->a, r);
}

const double *ms_residual_subtract_guess(const ms_linear_system *s, const double *b,
                                         const double *guess, ms_linear_target *target,
                                         double *work, double *to) {
  const double left = ms_residual_compute(s, b, guess, work);
  ms_vector_copy(s->model->shape, work, to);
  if (left > 0) target->rtol = fmin(target->rtol * target->size / left, 1);
  target->size = left;
  return to;
}

double ms_residual_compute_rounding_level(const ms_linear_system *s, const double *b,
                                          const double *y, double *work1, double *work2) {
  const ms_shape shape = s->model->shape;
  double sum = 0;
  ms_coefficients_apply_abs(s->model, &s->a, y, work1);
  for (int32_t c = 0; c < shape.dims; c++) {
    const size_t at = (size_t)c * (size_t)shape.stride;
    ms_vector_clear_all(shape, work2);
    for (size_t i = at; i < at + (size_t)shape.n; i++) work2[i] = work1[i] + fabs(b[i]);
    sum += ms_jacobi_norm(s->model, &s->a, work2);
  }
  return 8 * DBL_EPSILON * sum;
}

double ms_residual_compute_curvature(const ms_linear_system *s, const double *b, const double *v) {
  const ms_shape shape = s->model->shape;
  double product[] = {0, 0};
  for (size_t c = 0; c < (size_t)shape.dims; c++)
    for (int32_t r = 0; r < shape.n; r++) {
      const size_t at = c * (size_t)shape.stride + (size_t)r;
      product[0] += v[at] * b[at];
      product[1] += v[at] * s->model->mass[r] * v[at];
    }
  ms_ranks_sum(shape.ranks, 2, product);
  return product[0] / product[1];
}
