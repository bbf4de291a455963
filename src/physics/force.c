#include "physics/force.h"

#include <math.h>
#include <string.h>

/* m g - b v */
static void external(const ms_model *m, const double *v, double *f) {
  const double *g = m->scene->gravity;
  size_t stride = (size_t)m->rows.stride;
  int gravity = (m->passes & MSIM_SKIP_GRAVITY) != 0;
  for (int c = 0; c < 3; c++) {
    double *fc = f + (size_t)c * stride;
    if (gravity)
      for (int32_t r = 0; r < m->rows.nfree; r++) fc[r] = m->mass[r] * g[c];
    else memset(fc, 0, (size_t)m->rows.nfree * sizeof *fc);
    memset(fc + m->rows.nfree, 0, (stride - (size_t)m->rows.nfree) * sizeof *fc);
  }
  if (v && (m->passes & MSIM_SKIP_DRAG)) ms_axpy(m->shape, -m->scene->drag, v, f);
}

/* F = (k (l - L)/l + c (d.dv)/l^2) d. One branch a phase: `damped` is a constant where inlined. */
static inline void springs(const ms_model *m, const double *x, const double *v, double *f,
                           int damped) {
  const ms_springs *s = &m->springs;
  size_t stride = (size_t)m->rows.stride;
  const double *y = x + stride, *z = y + stride;
  double *fx = f, *fy = f + stride, *fz = fy + stride;
  for (int32_t e = 0; e < s->n; e++) {
    int32_t i = s->i[e], j = s->j[e];
    double dx = x[j] - x[i], dy = y[j] - y[i], dz = z[j] - z[i];
    double l2 = dx * dx + dy * dy + dz * dz;
    if (!(l2 > MS_ZERO_LENGTH2 || l2 != l2)) continue; /* NaN must go on to be seen */
    double l = sqrt(l2);
    double scale = s->k[e] * ((l - s->rest[e]) / l);
    if (damped) {
      const double *vy = v + stride, *vz = vy + stride;
      double ux = dx / l, uy = dy / l, uz = dz / l;
      double rate = ux * (v[j] - v[i]) + uy * (vy[j] - vy[i]) + uz * (vz[j] - vz[i]);
      scale += s->damping[e] * rate / l;
    }
    fx[i] += scale * dx, fy[i] += scale * dy, fz[i] += scale * dz;
    fx[j] -= scale * dx, fy[j] -= scale * dy, fz[j] -= scale * dz;
  }
}

void ms_force(const ms_model *model, const double *x, const double *v, double *f) {
  external(model, v, f);
  if (!(model->passes & MSIM_SKIP_SPRINGS)) return;
  if (v && (model->passes & MSIM_SKIP_DAMPING)) springs(model, x, v, f, 1);
  else springs(model, x, NULL, f, 0);
}
