#include "linear/jacobi.h"

#include <math.h>

double *ms_jacobi_create(const ms_model *model) {
  return ms_new(&model->scene->alloc, 6 * (size_t)model->rows.first_pinned, sizeof(double));
}

/* I / ||B||, Frobenius; I where B = 0 */
static void identity_as_large(const double *d, size_t s, double *out) {
  const double diagonal = d[0] * d[0] + d[s] * d[s] + d[2 * s] * d[2 * s];
  const double beside = d[3 * s] * d[3 * s] + d[4 * s] * d[4 * s] + d[5 * s] * d[5 * s];
  const double norm = sqrt(diagonal + 2 * beside);
  out[0] = out[s] = out[2 * s] = norm > 0 ? 1 / norm : 1;
  out[3 * s] = out[4 * s] = out[5 * s] = 0;
}

/* By cofactors; positive definite by Sylvester, where all leading minors are > 0. */
msim_status ms_jacobi_invert(const ms_model *model, const ms_coefficients *a, int32_t kind,
                             double *inverse) {
  const size_t s = (size_t)model->rows.first_pinned;
  for (int32_t r = 0; r < model->rows.nfree; r++) {
    const double *d = a->diagonal + r;
    double *out = inverse + r;
    const double xx = d[0], yy = d[s], zz = d[2 * s], xy = d[3 * s], xz = d[4 * s], yz = d[5 * s];
    const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy;
    const double det = xx * cxx + xy * cxy + xz * cxz;
    if (!(xx > 0 && xx * yy - xy * xy > 0 && det > 0)) {
      if (kind != MSIM_FACTOR_SYMMETRIC) return MSIM_NOT_SPD;
      identity_as_large(d, s, out);
      continue;
    }
    out[0] = cxx / det;
    out[s] = (xx * zz - xz * xz) / det;
    out[2 * s] = (xx * yy - xy * xy) / det;
    out[3 * s] = cxy / det;
    out[4 * s] = cxz / det;
    out[5 * s] = (xy * xz - xx * yz) / det;
  }
  return MSIM_OK;
}

void ms_jacobi_apply(const ms_model *model, const double *inverse, const double *r, double *z) {
  const size_t s = (size_t)model->rows.first_pinned, t = (size_t)model->rows.stride;
  for (size_t i = 0; i < (size_t)model->rows.nfree; i++) {
    const double *p = inverse + i;
    const double x = r[i], y = r[t + i], w = r[2 * t + i];
    z[i] = p[0] * x + p[3 * s] * y + p[4 * s] * w;
    z[t + i] = p[3 * s] * x + p[s] * y + p[5 * s] * w;
    z[2 * t + i] = p[4 * s] * x + p[5 * s] * y + p[2 * s] * w;
  }
}
