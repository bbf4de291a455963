#include "linear/cg.h"
#include "linear/jacobi.h"

typedef struct pcg {
  ms_linear base;
  double *inverse; /* of the diagonal blocks */
  ms_cg cg;
} pcg;

static msim_status precondition(void *data, const double *r, double *z) {
  const pcg *self = data;
  ms_jacobi_apply(self->base.system->model, self->inverse, r, z);
  return MSIM_OK;
}

static msim_status factor(ms_linear *base, int32_t kind, msim_error *err) {
  (void)err;
  pcg *self = (pcg *)base;
  return ms_jacobi_invert(base->system->model, &base->system->a, kind, self->inverse);
}

static msim_status solve(ms_linear *base, const ms_target *target, const double *b, double *y,
                         int64_t *iterations, msim_error *err) {
  (void)err;
  pcg *self = (pcg *)base;
  return ms_cg_solve(&self->cg, base->system, precondition, self, target, b, y, iterations);
}

static void destroy(ms_linear *base) {
  if (!base) return;
  pcg *self = (pcg *)base;
  const ms_model *model = base->system->model;
  ms_delete(&model->scene->alloc, self->inverse);
  ms_cg_destroy(model, &self->cg);
  ms_delete(&model->scene->alloc, self);
}

msim_status ms_pcg_create(const ms_system *system, ms_linear **linear, msim_error *err) {
  static const ms_linear_ops ops = {NULL, factor, solve, destroy};
  const ms_model *model = system->model;
  *linear = NULL;
  pcg *self = ms_new(&model->scene->alloc, 1, sizeof *self);
  if (!self) return ms_fail_memory(err, "conjugate gradients");
  self->base = (ms_linear){.ops = &ops, .system = system, .name = "pcg"};
  self->inverse = ms_jacobi_create(model);
  msim_status status = ms_cg_create(model, &self->cg, err);
  if (!status && !self->inverse) status = ms_fail_memory(err, "conjugate gradients");
  if (status) destroy(&self->base);
  else *linear = &self->base;
  return status;
}
