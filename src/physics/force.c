#include "physics/force.h"

#include <string.h>

#include "physics/kernels.h"

/* m g - b v */
static void external(const ms_model *m, const double *v, double *f) {
  const double *g = m->scene->gravity;
  size_t stride = (size_t)m->rows.stride;
  int gravity = (m->passes & MSIM_SKIP_GRAVITY) != 0;
  for (int32_t c = 0; c < m->rows.dims; c++) {
    const double gc = g[m->rows.axis[c]];
    double *fc = f + (size_t)c * stride;
    if (gravity)
      for (int32_t r = 0; r < m->rows.nfree; r++) fc[r] = m->mass[r] * gc;
    else memset(fc, 0, (size_t)m->rows.nfree * sizeof *fc);
    memset(fc + m->rows.nfree, 0, (stride - (size_t)m->rows.nfree) * sizeof *fc);
  }
  if (v && (m->passes & MSIM_SKIP_DRAG)) ms_axpy(m->shape, -m->scene->drag, v, f);
}

void ms_force(const ms_model *model, const double *x, const double *v, double *f) {
  external(model, v, f);
  if (!(model->passes & MSIM_SKIP_SPRINGS)) return;
  if (!(model->passes & MSIM_SKIP_ZERO_REST_LENGTH)) {
    model->kernels->linear_springs(model, x, f);
    return;
  }
  const int damped = v && (model->passes & MSIM_SKIP_DAMPING);
  model->kernels->springs(model, x, damped ? v : NULL, f);
}
