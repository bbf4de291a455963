#include "linear/jacobi.h"

#include <float.h>
#include <math.h>

msim_status ms_jacobi_create(const ms_model *model, const ms_coefficients *a, ms_jacobi *jacobi,
                             msim_error *err) {
  const size_t n = ms_diagonal_size((size_t)a->block) * (size_t)model->rows.first_pinned;
  *jacobi = (ms_jacobi){a->block, 1, ms_new(&model->scene->alloc, n, sizeof *jacobi->inverse)};
  return jacobi->inverse ? MSIM_OK : ms_fail_memory(err, "the preconditioner");
}

void ms_jacobi_destroy(const ms_model *model, ms_jacobi *jacobi) {
  ms_delete(&model->scene->alloc, jacobi->inverse);
  *jacobi = (ms_jacobi){0};
}

static double choose_scale(const ms_model *model, const ms_coefficients *a) {
  const size_t s = (size_t)model->rows.first_pinned;
  double largest = DBL_MIN;
  for (size_t c = 0; c < (size_t)a->block; c++)
    for (size_t r = 0; r < (size_t)model->rows.nfree; r++)
      largest = fmax(largest, a->diagonal[c * s + r]);
  int exponent;
  frexp(largest, &exponent);
  return ldexp(1, 2 * (exponent / 2));
}

/* What makes a row's block positive definite: t = h^2 k s of compressed springs is < 0, and the
 * rest of their blocks is not. */
static double brace(const ms_model *model, const ms_coefficients *a, int32_t row) {
  const ms_span span = ms_halves_of(&model->halves, row);
  double sum = 0;
  for (int32_t at = span.begin; at < span.end; at += span.step) sum += fmax(0, -a->t[at]);
  return sum;
}

/* By cofactors; 0 unless positive definite, by Sylvester: all leading minors > 0. */
static int invert3(const double *b, double *out) {
  const double xx = b[0], yy = b[1], zz = b[2], xy = b[3], xz = b[4], yz = b[5];
  const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy;
  const double det = xx * cxx + xy * cxy + xz * cxz;
  if (!(xx > 0 && xx * yy - xy * xy > 0 && det > 0)) return 0;
  const double by = 1 / det;
  out[0] = by * cxx, out[1] = by * (xx * zz - xz * xz), out[2] = by * (xx * yy - xy * xy);
  out[3] = by * cxy, out[4] = by * cxz, out[5] = by * (xy * xz - xx * yz);
  return 1;
}

static int invert2(const double *b, double *out) {
  const double xx = b[0], yy = b[1], xy = b[2], det = xx * yy - xy * xy;
  if (!(xx > 0 && det > 0)) return 0;
  out[0] = yy / det, out[1] = xx / det, out[2] = -xy / det;
  return 1;
}

static int invert1(const double *b, double *out) {
  *out = 1 / *b;
  return *b > 0;
}

msim_status ms_jacobi_invert(const ms_model *model, const ms_coefficients *a, int32_t kind,
                             ms_jacobi *jacobi) {
  static int (*const invert[])(const double *, double *) = {NULL, invert1, invert2, invert3};
  const size_t s = (size_t)model->rows.first_pinned, block = (size_t)a->block;
  const size_t size = ms_diagonal_size(block);
  jacobi->scale = choose_scale(model, a);
  const double by = 1 / jacobi->scale;
  const int braced = kind != MSIM_FACTOR_SPD;
  for (int32_t r = 0; r < model->rows.nfree; r++) {
    const double more = braced ? brace(model, a, r) : 0;
    double in[6], out[6];
    for (size_t q = 0; q < size; q++)
      in[q] = by * (a->diagonal[q * s + (size_t)r] + (q < block ? more : 0));
    if (!invert[block](in, out)) return MSIM_NOT_SPD;
    for (size_t q = 0; q < size; q++) jacobi->inverse[q * s + (size_t)r] = out[q];
  }
  return MSIM_OK;
}

void ms_jacobi_apply(const ms_model *model, const ms_jacobi *jacobi, int32_t components,
                     const double *r, double *z) {
  const size_t s = (size_t)model->rows.first_pinned, t = (size_t)model->rows.stride;
  const size_t dims = (size_t)components, alike = jacobi->block == 1;
  const double by = 1 / jacobi->scale;
  for (size_t i = 0; i < (size_t)model->rows.nfree; i++) {
    double in[3];
    for (size_t c = 0; c < dims; c++) in[c] = by * r[c * t + i];
    for (size_t b = 0; b < dims; b++) {
      double sum = alike ? jacobi->inverse[i] * in[b] : 0;
      for (size_t c = 0; c < dims && !alike; c++)
        sum += jacobi->inverse[ms_diagonal_entry(dims, b, c) * s + i] * in[c];
      z[b * t + i] = sum;
    }
  }
}

/*------------------------------------- the norm -------------------------------------------------*/

/* r.B^-1 r = |L^-1 r|^2, B = L L^T; -1 where a pivot is not above the rounding errors of its
 * diagonal entry, unless `floor` puts it there. */
static double square_by_block(size_t dims, const double *b, const double r[3], int floor) {
  double l[3][3], y[3], sum = 0;
  for (size_t i = 0; i < dims; i++) {
    const double least = DBL_EPSILON * b[i];
    double pivot = b[i];
    y[i] = r[i];
    for (size_t k = 0; k < i; k++) {
      double entry = b[ms_diagonal_entry(dims, k, i)];
      for (size_t q = 0; q < k; q++) entry -= l[i][q] * l[k][q];
      l[i][k] = entry / l[k][k];
      pivot -= l[i][k] * l[i][k];
      y[i] -= l[i][k] * y[k];
    }
    if (!(pivot > least) && !floor) return -1;
    l[i][i] = sqrt(fmax(pivot, least));
    y[i] /= l[i][i];
    sum += y[i] * y[i];
  }
  return sum;
}

/* Where compressed springs leave a block without a root it is braced, as in the preconditioner. */
static double square_of_row(const ms_model *model, const ms_coefficients *a, const double *r,
                            int32_t row) {
  const size_t s = (size_t)model->rows.first_pinned, t = (size_t)model->rows.stride;
  const size_t dims = (size_t)a->block, size = ms_diagonal_size(dims);
  double block[6], own[3];
  for (size_t q = 0; q < size; q++) block[q] = a->diagonal[q * s + (size_t)row];
  for (size_t c = 0; c < dims; c++) own[c] = r[c * t + (size_t)row];
  const double square = square_by_block(dims, block, own, 0);
  if (square >= 0) return square;
  const double more = brace(model, a, row);
  for (size_t c = 0; c < dims; c++) block[c] += more;
  return square_by_block(dims, block, own, 1);
}

double ms_jacobi_norm(const ms_model *model, const ms_coefficients *a, const double *r) {
  const size_t apart = (size_t)a->block * (size_t)model->rows.stride;
  double sum = 0;
  for (int32_t c = 0; c < model->rows.dims; c += a->block)
    for (int32_t row = 0; row < model->rows.nfree; row++)
      sum += square_of_row(model, a, r + (size_t)(c / a->block) * apart, row);
  return sqrt(sum);
}
