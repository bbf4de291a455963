#include <math.h>
#include <string.h>

#include "physics/force.h"

msim_status ms_coefficients_create(const ms_model *model, ms_coefficients *a, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  size_t n = (size_t)model->springs.n;
  *a = (ms_coefficients){
      .t = ms_new(alloc, n, sizeof(double)),
      .wx = ms_new(alloc, n, sizeof(double)),
      .wy = ms_new(alloc, n, sizeof(double)),
      .wz = ms_new(alloc, n, sizeof(double)),
      .diagonal = ms_new(alloc, 6 * (size_t)model->rows.first_pinned, sizeof(double))};
  if (a->t && a->wx && a->wy && a->wz && a->diagonal) return MSIM_OK;
  return ms_fail_memory(err, "the matrix coefficients");
}

void ms_coefficients_destroy(const ms_model *model, ms_coefficients *a) {
  double *arrays[] = {a->t, a->wx, a->wy, a->wz, a->diagonal};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
    ms_delete(&model->scene->alloc, arrays[i]);
  *a = (ms_coefficients){0};
}

static void spring_coefficients(const ms_model *m, const double *x, double h, int clamp,
                                ms_coefficients *a) {
  const ms_springs *s = &m->springs;
  size_t stride = (size_t)m->rows.stride;
  const double *y = x + stride, *z = y + stride;
  for (int32_t e = 0; e < s->n; e++) {
    int32_t i = s->i[e], j = s->j[e];
    double dx = x[j] - x[i], dy = y[j] - y[i], dz = z[j] - z[i];
    double l2 = dx * dx + dy * dy + dz * dz, hhk = h * h * s->k[e];
    if (!(l2 > MS_ZERO_LENGTH2 || l2 != l2)) {
      a->t[e] = hhk;
      a->wx[e] = a->wy[e] = a->wz[e] = 0;
      continue;
    }
    double l = sqrt(l2), ratio = s->rest[e] / l;
    if (clamp && ratio > 1) ratio = 1;
    double w = sqrt(hhk * ratio + h * s->damping[e]) / l;
    a->t[e] = hhk * (1 - ratio);
    a->wx[e] = w * dx, a->wy[e] = w * dy, a->wz[e] = w * dz;
  }
}

static inline void add_block(double *d, size_t stride, int32_t r, double t, double wx, double wy,
                             double wz) {
  d += r;
  d[0] += t + wx * wx;
  d[stride] += t + wy * wy;
  d[2 * stride] += t + wz * wz;
  d[3 * stride] += wx * wy;
  d[4 * stride] += wx * wz;
  d[5 * stride] += wy * wz;
}

/* m + h b on the diagonal, then every spring's block on both of its ends */
static void diagonal_blocks(const ms_model *m, double h, ms_coefficients *a) {
  size_t stride = (size_t)m->rows.first_pinned;
  double drag = m->passes & MSIM_SKIP_DRAG ? h * m->scene->drag : 0;
  memset(a->diagonal, 0, 6 * stride * sizeof *a->diagonal);
  for (int c = 0; c < 3; c++)
    for (size_t r = 0; r < stride; r++) a->diagonal[(size_t)c * stride + r] = m->mass[r] + drag;
  const ms_springs *s = &m->springs;
  int32_t nfree = m->rows.nfree;
  for (int32_t e = 0; e < s->n; e++) {
    double t = a->t[e], wx = a->wx[e], wy = a->wy[e], wz = a->wz[e];
    if (s->i[e] < nfree) add_block(a->diagonal, stride, s->i[e], t, wx, wy, wz);
    if (s->j[e] < nfree) add_block(a->diagonal, stride, s->j[e], t, wx, wy, wz);
  }
}

void ms_coefficients_compute(const ms_model *model, const double *x, double h, int clamp,
                             ms_coefficients *a) {
  spring_coefficients(model, x, h, clamp, a);
  diagonal_blocks(model, h, a);
}

/* y_i = D_i x_i - sum over springs of (t x_j + (w.x_j) w); magnitudes throughout if `absolute`. */
static inline void apply(const ms_model *m, const ms_coefficients *a, const double *x, double *y,
                         int absolute) {
  size_t sx = (size_t)m->rows.stride, sd = (size_t)m->rows.first_pinned;
#define MAGNITUDE(q) (absolute ? fabs(q) : (q))
  for (int32_t r = 0; r < m->rows.nfree; r++) {
    const double *d = a->diagonal + r;
    double xx = MAGNITUDE(x[r]), xy = MAGNITUDE(x[sx + (size_t)r]);
    double xz = MAGNITUDE(x[2 * sx + (size_t)r]);
    double dxy = MAGNITUDE(d[3 * sd]), dxz = MAGNITUDE(d[4 * sd]), dyz = MAGNITUDE(d[5 * sd]);
    y[r] = MAGNITUDE(d[0]) * xx + dxy * xy + dxz * xz;
    y[sx + (size_t)r] = dxy * xx + MAGNITUDE(d[sd]) * xy + dyz * xz;
    y[2 * sx + (size_t)r] = dxz * xx + dyz * xy + MAGNITUDE(d[2 * sd]) * xz;
  }
  for (size_t c = 0; c < 3; c++)
    memset(y + c * sx + m->rows.nfree, 0, (sx - (size_t)m->rows.nfree) * sizeof *y);
  const ms_springs *s = &m->springs;
  const double sign = absolute ? -1.0 : 1.0;
  for (int32_t e = 0; e < s->n; e++) {
    int32_t ends[2] = {s->i[e], s->j[e]};
    double t = MAGNITUDE(a->t[e]);
    double wx = MAGNITUDE(a->wx[e]), wy = MAGNITUDE(a->wy[e]), wz = MAGNITUDE(a->wz[e]);
    for (int to = 0; to < 2; to++) {
      const double *xj = x + ends[1 - to];
      double *yi = y + ends[to];
      double xx = MAGNITUDE(xj[0]), xy = MAGNITUDE(xj[sx]), xz = MAGNITUDE(xj[2 * sx]);
      double wdot = wx * xx + wy * xy + wz * xz;
      yi[0] -= sign * (t * xx + wdot * wx);
      yi[sx] -= sign * (t * xy + wdot * wy);
      yi[2 * sx] -= sign * (t * xz + wdot * wz);
    }
  }
#undef MAGNITUDE
}

void ms_coefficients_apply(const ms_model *model, const ms_coefficients *a, const double *x,
                           double *y) {
  apply(model, a, x, y, 0);
}

void ms_coefficients_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y) {
  apply(model, a, x, y, 1);
}
