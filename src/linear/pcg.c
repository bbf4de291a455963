#include <float.h>
#include <math.h>

#include "linear/linear.h"

typedef struct pcg {
  ms_linear base;
  double *inverse;       /* 6 first_pinned: inverses of the diagonal blocks, xx yy zz xy xz yz */
  double *r, *z, *p, *q; /* residual, preconditioned residual, direction, A p */
} pcg;

/*------------------------------------- block Jacobi ---------------------------------------------*/

/* The inverse of each 3x3 diagonal block by cofactors. A block that is not positive definite says
 * that A is not: by Sylvester, one of its leading minors is <= 0. */
static msim_status invert_blocks(const ms_rows *rows, const double *diagonal, double *inverse) {
  const size_t s = (size_t)rows->first_pinned;
  for (int32_t r = 0; r < rows->nfree; r++) {
    const double *d = diagonal + r;
    double *out = inverse + r;
    const double xx = d[0], yy = d[s], zz = d[2 * s], xy = d[3 * s], xz = d[4 * s], yz = d[5 * s];
    const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy;
    const double det = xx * cxx + xy * cxy + xz * cxz;
    if (!(xx > 0 && xx * yy - xy * xy > 0 && det > 0)) return MSIM_NOT_SPD;
    out[0] = cxx / det;
    out[s] = (xx * zz - xz * xz) / det;
    out[2 * s] = (xx * yy - xy * xy) / det;
    out[3 * s] = cxy / det;
    out[4 * s] = cxz / det;
    out[5 * s] = (xy * xz - xx * yz) / det;
  }
  return MSIM_OK;
}

/* z = P r, P the inverses of the diagonal blocks */
static void precondition(const ms_rows *rows, const double *inverse, const double *r, double *z) {
  const size_t s = (size_t)rows->first_pinned, t = (size_t)rows->stride;
  for (size_t i = 0; i < (size_t)rows->nfree; i++) {
    const double *p = inverse + i;
    const double x = r[i], y = r[t + i], w = r[2 * t + i];
    z[i] = p[0] * x + p[3 * s] * y + p[4 * s] * w;
    z[t + i] = p[3 * s] * x + p[s] * y + p[5 * s] * w;
    z[2 * t + i] = p[4 * s] * x + p[5 * s] * y + p[2 * s] * w;
  }
}

/*------------------------------------- the method -----------------------------------------------*/

static void residual(const ms_system *s, const double *b, const double *y, double *r) {
  ms_coefficients_apply(s->model, &s->a, y, r);
  ms_combine(s->model->shape, b, -1, r, r);
}

/* From the residual of y in self->r until ||r|| <= goal, by the recurrence of r. */
static msim_status iterate(pcg *self, double goal, int64_t limit, double *y, int64_t *iterations) {
  const ms_system *s = self->base.system;
  const ms_shape shape = s->model->shape;
  double rho = 0;
  for (int first = 1;; first = 0) {
    if (sqrt(ms_dot(shape, self->r, self->r)) <= goal) return MSIM_OK;
    if (*iterations >= limit) return MSIM_NOT_CONVERGED;
    precondition(&s->model->rows, self->inverse, self->r, self->z);
    const double rho_new = ms_dot(shape, self->r, self->z);
    if (first) ms_copy(shape, self->z, self->p);
    else ms_combine(shape, self->z, rho_new / rho, self->p, self->p);
    rho = rho_new;
    ms_coefficients_apply(s->model, &s->a, self->p, self->q);
    const double curvature = ms_dot(shape, self->p, self->q);
    if (!(curvature > 0)) return MSIM_NOT_SPD;
    const double alpha = rho / curvature;
    ms_axpy(shape, alpha, self->p, y);
    ms_axpy(shape, -alpha, self->q, self->r);
    ++*iterations;
  }
}

static msim_status factor(ms_linear *base, int32_t kind, msim_error *err) {
  (void)kind, (void)err;
  pcg *self = (pcg *)base;
  return invert_blocks(&base->system->model->rows, base->system->a.diagonal, self->inverse);
}

/* The recurrence drifts from the true residual: where it claims success, start again from the
 * truth, until that holds too or gets no better. What is left is for the policy to judge. */
static msim_status solve(ms_linear *base, const ms_target *target, const double *b, double *y,
                         int64_t *iterations, msim_error *err) {
  (void)err;
  pcg *self = (pcg *)base;
  const ms_system *s = base->system;
  const ms_shape shape = s->model->shape;
  const double goal = fmax(target->rtol, DBL_EPSILON / 4) * sqrt(ms_dot(shape, b, b));
  double last = INFINITY;
  int64_t count = 0;
  msim_status status = MSIM_OK;
  while (!status) {
    residual(s, b, y, self->r);
    const double norm = sqrt(ms_dot(shape, self->r, self->r));
    if (norm <= goal || norm > 0.5 * last) break;
    last = norm;
    status = iterate(self, goal, target->max_iterations, y, &count);
  }
  *iterations += count;
  return status;
}

static void destroy(ms_linear *base) {
  if (!base) return;
  pcg *self = (pcg *)base;
  const msim_allocator *alloc = &base->system->model->scene->alloc;
  double *arrays[] = {self->inverse, self->r, self->z, self->p, self->q};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) ms_delete(alloc, arrays[i]);
  ms_delete(alloc, self);
}

msim_status ms_pcg_create(const ms_system *system, ms_linear **linear, msim_error *err) {
  static const ms_linear_ops ops = {NULL, factor, solve, destroy};
  const ms_model *model = system->model;
  *linear = NULL;
  pcg *self = ms_new(&model->scene->alloc, 1, sizeof *self);
  if (!self) return ms_fail_memory(err, "conjugate gradients");
  self->base = (ms_linear){.ops = &ops, .system = system, .name = "pcg"};
  self->inverse =
      ms_new(&model->scene->alloc, 6 * (size_t)model->rows.first_pinned, sizeof *self->inverse);
  self->r = ms_rows_vector(model->scene, &model->rows);
  self->z = ms_rows_vector(model->scene, &model->rows);
  self->p = ms_rows_vector(model->scene, &model->rows);
  self->q = ms_rows_vector(model->scene, &model->rows);
  if (!self->inverse || !self->r || !self->z || !self->p || !self->q) {
    destroy(&self->base);
    return ms_fail_memory(err, "conjugate gradients");
  }
  *linear = &self->base;
  return MSIM_OK;
}
