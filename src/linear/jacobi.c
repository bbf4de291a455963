#include "linear/jacobi.h"

#include <float.h>
#include <math.h>

msim_status ms_jacobi_create(const ms_model *model, ms_jacobi *jacobi, msim_error *err) {
  const size_t n = 6 * (size_t)model->rows.first_pinned;
  *jacobi = (ms_jacobi){1, ms_new(&model->scene->alloc, n, sizeof *jacobi->inverse)};
  return jacobi->inverse ? MSIM_OK : ms_fail_memory(err, "the preconditioner");
}

void ms_jacobi_destroy(const ms_model *model, ms_jacobi *jacobi) {
  ms_delete(&model->scene->alloc, jacobi->inverse);
  *jacobi = (ms_jacobi){0};
}

static double choose_scale(const ms_model *model, const ms_coefficients *a) {
  const size_t s = (size_t)model->rows.first_pinned;
  double largest = DBL_MIN;
  for (size_t c = 0; c < 3; c++)
    for (size_t r = 0; r < (size_t)model->rows.nfree; r++)
      largest = fmax(largest, a->diagonal[c * s + r]);
  int exponent;
  frexp(largest, &exponent);
  return ldexp(1, 2 * (exponent / 2));
}

/* I / ||B||, Frobenius; I where B = 0 */
static void identity_as_large(const double b[6], double out[6]) {
  const double diagonal = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];
  const double beside = b[3] * b[3] + b[4] * b[4] + b[5] * b[5];
  const double norm = sqrt(diagonal + 2 * beside);
  out[0] = out[1] = out[2] = norm > 0 ? 1 / norm : 1;
  out[3] = out[4] = out[5] = 0;
}

/* xx yy zz xy xz yz, by cofactors; 0 unless positive definite, by Sylvester: all leading minors
 * > 0. */
static int invert(const double b[6], double out[6]) {
  const double xx = b[0], yy = b[1], zz = b[2], xy = b[3], xz = b[4], yz = b[5];
  const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy;
  const double det = xx * cxx + xy * cxy + xz * cxz;
  if (!(xx > 0 && xx * yy - xy * xy > 0 && det > 0)) return 0;
  const double by = 1 / det;
  out[0] = by * cxx, out[1] = by * (xx * zz - xz * xz), out[2] = by * (xx * yy - xy * xy);
  out[3] = by * cxy, out[4] = by * cxz, out[5] = by * (xy * xz - xx * yz);
  return 1;
}

msim_status ms_jacobi_invert(const ms_model *model, const ms_coefficients *a, int32_t kind,
                             ms_jacobi *jacobi) {
  const size_t s = (size_t)model->rows.first_pinned;
  jacobi->scale = choose_scale(model, a);
  const double by = 1 / jacobi->scale;
  for (int32_t r = 0; r < model->rows.nfree; r++) {
    double block[6], inverse[6];
    for (size_t q = 0; q < 6; q++) block[q] = by * a->diagonal[q * s + (size_t)r];
    if (!invert(block, inverse)) {
      if (kind != MSIM_FACTOR_SYMMETRIC) return MSIM_NOT_SPD;
      identity_as_large(block, inverse);
    }
    for (size_t q = 0; q < 6; q++) jacobi->inverse[q * s + (size_t)r] = inverse[q];
  }
  return MSIM_OK;
}

void ms_jacobi_apply(const ms_model *model, const ms_jacobi *jacobi, const double *r, double *z) {
  const size_t s = (size_t)model->rows.first_pinned, t = (size_t)model->rows.stride;
  const double by = 1 / jacobi->scale;
  for (size_t i = 0; i < (size_t)model->rows.nfree; i++) {
    const double *p = jacobi->inverse + i;
    const double x = by * r[i], y = by * r[t + i], w = by * r[2 * t + i];
    z[i] = p[0] * x + p[3 * s] * y + p[4 * s] * w;
    z[t + i] = p[3 * s] * x + p[s] * y + p[5 * s] * w;
    z[2 * t + i] = p[4 * s] * x + p[5 * s] * y + p[2 * s] * w;
  }
}
