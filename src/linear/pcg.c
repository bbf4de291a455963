#include <float.h>
#include <math.h>

#include "linear/jacobi.h"
#include "linear/linear.h"

typedef struct pcg {
  ms_linear base;
  double *inverse;       /* of the diagonal blocks */
  double *r, *z, *p, *q; /* residual, preconditioned residual, direction, A p */
} pcg;

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
    ms_jacobi_apply(s->model, self->inverse, self->r, self->z);
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
  return ms_jacobi_invert(base->system->model, &base->system->a, self->inverse);
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
  self->inverse = ms_jacobi_create(model);
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
