#include "linear/cg.h"

#include <float.h>
#include <math.h>

#include "linear/jacobi.h"
#include "linear/residual.h"

msim_status ms_cg_create(const ms_model *model, ms_cg *cg, msim_error *err) {
  *cg = (ms_cg){0};
  if (MS_NEW_VECTORS(model->scene, &model->unknowns, &cg->r, &cg->z, &cg->p, &cg->q))
    return MSIM_OK;
  return ms_error_set_memory(err, "conjugate gradients");
}

void ms_cg_destroy(const ms_model *model, ms_cg *cg) {
  MS_FREE(&model->scene->alloc, cg->r, cg->z, cg->p, cg->q);
}

/* Iterate from the residual r of y, whose norm is given, until that of the recursively updated r
 * is <= goal. */
static msim_status cg_iterate(const ms_cg *cg, const ms_linear_system *s,
                              ms_cg_preconditioner *precondition, void *data, double norm,
                              double goal, int64_t limit, double *y, int64_t *iterations) {
  const ms_shape shape = s->model->shape;
  double rho = 0;
  for (int first = 1; norm > goal; first = 0) {
    if (*iterations >= limit) return MSIM_NOT_CONVERGED;
    const msim_status status = precondition(data, cg->r, cg->z);
    if (status) return status;
    const double rho_new = ms_vector_dot(shape, cg->r, cg->z);
    if (first) ms_vector_copy(shape, cg->z, cg->p);
    else ms_vector_add_scaled(shape, cg->z, rho_new / rho, cg->p, cg->p);
    rho = rho_new;
    ms_coefficients_apply(s->model, &s->a, cg->p, cg->q);
    const double curvature = ms_vector_dot(shape, cg->p, cg->q);
    if (!(curvature > 0)) return MSIM_NOT_SPD;
    const double alpha = rho / curvature;
    ms_vector_axpy(shape, alpha, cg->p, y);
    ms_vector_axpy(shape, -alpha, cg->q, cg->r);
    norm = ms_jacobi_norm(s->model, &s->a, cg->r);
    ++*iterations;
  }
  return MSIM_OK;
}

/* The recursively updated residual drifts from the true one. At the goal the iteration restarts
 * from the true residual, until that reaches the goal or is no longer halved. */
msim_status ms_cg_solve(const ms_cg *cg, const ms_linear_system *s,
                        ms_cg_preconditioner *precondition, void *data,
                        const ms_linear_target *target, const double *b, double *y,
                        int64_t *iterations, double *residual) {
  const double goal = fmax(target->rtol, DBL_EPSILON / 4) * target->size;
  double last = INFINITY;
  int64_t count = 0;
  msim_status status = MSIM_OK;
  *residual = target->size;
  ms_vector_copy(s->model->shape, b, cg->r);
  while (!status && *residual > goal && *residual <= 0.5 * last) {
    last = *residual;
    status = cg_iterate(cg, s, precondition, data, last, goal, target->max_iterations, y, &count);
    if (!status) *residual = ms_residual_compute(s, b, y, cg->r);
  }
  *iterations += count;
  return status;
}
