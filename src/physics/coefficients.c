#include <math.h>

#include "physics/kernels.h"

msim_status ms_coefficients_create(const ms_model *model, ms_coefficients *a, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = MS_GROUP * (size_t)model->halves.nslots;
  const int alike = !(model->passes & MSIM_SKIP_ZERO_REST_LENGTH);
  const size_t block = alike ? 1 : (size_t)model->rows.dims;
  const size_t diagonal = ms_diagonal_size(block) * (size_t)model->rows.first_pinned;
  *a = (ms_coefficients){.block = (int32_t)block,
                         .t = ms_new(alloc, n, sizeof(double)),
                         .diagonal = ms_new(alloc, diagonal, sizeof(double))};
  int whole = a->t && a->diagonal;
  for (size_t c = 0; c < block && whole && !alike; c++)
    whole = (a->w[c] = ms_new(alloc, n, sizeof(double))) != NULL;
  return whole ? MSIM_OK : ms_fail_memory(err, "the matrix coefficients");
}

void ms_coefficients_destroy(const ms_model *model, ms_coefficients *a) {
  double *arrays[] = {a->t, a->w[0], a->w[1], a->w[2], a->diagonal};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
    ms_delete(&model->scene->alloc, arrays[i]);
  *a = (ms_coefficients){0};
}

/* t = h^2 k, and m + h b + the sum of t on the diagonal */
static void compute_alike(const ms_model *model, double h, ms_coefficients *a) {
  const ms_halves *halves = &model->halves;
  for (int32_t at = 0; at < MS_GROUP * halves->nslots; at++) a->t[at] = h * h * halves->k[at];
  for (int32_t r = 0; r < model->rows.first_pinned; r++) {
    const ms_span span = ms_halves_of(halves, r);
    a->diagonal[r] = model->mass[r] + a->drag;
    for (int32_t at = span.begin; at < span.end; at += span.step) a->diagonal[r] += a->t[at];
  }
}

void ms_coefficients_compute(const ms_model *model, const double *x, double h, int clamp,
                             ms_coefficients *a) {
  a->drag = model->passes & MSIM_SKIP_DRAG ? h * model->scene->drag : 0;
  if (a->block == 1) compute_alike(model, h, a);
  else model->kernels->coefficients(model, x, h, clamp, a);
}

void ms_coefficients_apply(const ms_model *model, const ms_coefficients *a, const double *x,
                           double *y) {
  if (a->block == 1) model->kernels->apply_alike(model, a, model->rows.dims, x, y);
  else model->kernels->apply(model, a, x, y);
}

void ms_coefficients_apply_one(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y) {
  model->kernels->apply_alike(model, a, 1, x, y);
}

/* The same of magnitudes, for one row. */
static void apply_abs_row(const ms_model *model, const ms_coefficients *a, const double *x,
                          size_t row, double *y) {
  const size_t stride = (size_t)model->rows.stride, sd = (size_t)model->rows.first_pinned;
  const size_t dims = (size_t)model->rows.dims;
  const int alike = a->block == 1;
  for (size_t c = 0; c < dims; c++) {
    y[c * stride + row] = alike ? fabs(a->diagonal[row] * x[c * stride + row]) : 0;
    for (size_t b = 0; b < dims && !alike; b++)
      y[c * stride + row] +=
          fabs(a->diagonal[ms_diagonal_entry(dims, c, b) * sd + row] * x[b * stride + row]);
  }
  const ms_span span = ms_halves_of(&model->halves, (int32_t)row);
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const double *xj = x + model->halves.neighbour[at];
    double along = 0;
    for (size_t c = 0; c < dims && !alike; c++) along += fabs(a->w[c][at] * xj[c * stride]);
    for (size_t c = 0; c < dims; c++)
      y[c * stride + row] +=
          fabs(a->t[at] * xj[c * stride]) + (alike ? 0 : along * fabs(a->w[c][at]));
  }
}

void ms_coefficients_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y) {
  for (size_t row = 0; row < (size_t)model->rows.nfree; row++) apply_abs_row(model, a, x, row, y);
}
