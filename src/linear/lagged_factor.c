#include "linear/lagged_factor.h"

#include <float.h>
#include <math.h>

#include "linear/jacobi.h"
#include "linear/residual.h"

msim_status ms_lagged_factor_create(const ms_linear_system *system, ms_linear *by,
                                    ms_lagged_factor *kept, msim_error *err) {
  *kept = (ms_lagged_factor){.system = system, .factorizer = by};
  if (MS_NEW_VECTORS(system->model->scene, &system->model->unknowns, &kept->r, &kept->z, &kept->p,
                     &kept->q))
    return MSIM_OK;
  return ms_error_set_memory(err, "conjugate gradients");
}

void ms_lagged_factor_destroy(ms_lagged_factor *kept) {
  if (kept->system) MS_FREE(&kept->system->model->scene->alloc, kept->r, kept->z, kept->p, kept->q);
  *kept = (ms_lagged_factor){0};
}

/* A bound of the condition number of A scaled to a diagonal of 1, on which the accuracy of a factor
 * depends: twice the largest A_ii/(m_i + h drag), for A - M - h drag positive semidefinite */
static double condition_bound(const ms_linear_system *s) {
  const ms_unknowns *rows = &s->model->unknowns;
  double most = 1;
  for (int32_t c = 0; c < s->a.block; c++)
    for (int32_t r = 0; r < rows->nfree; r++)
      most = fmax(most, s->a.diagonal[(size_t)c * (size_t)rows->first_pinned + (size_t)r] /
                            (s->model->mass[r] + s->a.drag));
  return 2 * most;
}

/* In single precision the factor has errors of FLT_EPSILON/2 times the condition number: if LITTLE,
 * conjugate gradients correct them in an iteration or two. */
void ms_lagged_factor_renew(ms_lagged_factor *kept, double limit) {
  const double ROUGH = 1e-3, LITTLE = 0.1;
  kept->age = 1, kept->iterations = 0, kept->limit = limit;
  kept->rtol = FLT_EPSILON / 2 * condition_bound(kept->system) < LITTLE ? ROUGH : DBL_EPSILON;
}

void ms_lagged_factor_discard(ms_lagged_factor *kept) {
  kept->age = kept->skip_length = kept->skips_left = 0;
}

/* z = B r, B ~ A^-1 symmetric positive definite */
static msim_status precondition_by_factor(const ms_lagged_factor *kept, const double *r,
                                          double *z) {
  const ms_linear_target target = {.rtol = kept->rtol, .max_iterations = 1};
  int64_t iterations = 0;
  return kept->factorizer->ops->solve(kept->factorizer, &target, r, z, &iterations, NULL);
}

static double iteration_limit(const ms_lagged_factor *kept) {
  if (kept->limit > 0) return kept->limit;
  const double cost =
      kept->factorizer->flops / (MS_SOLVE_FLOPS_PER_NONZERO * kept->factorizer->fill);
  return (cost + (double)kept->iterations) / (double)(kept->age + 1);
}

/* Iterate from the residual r of y, whose norm is given, until that of the recursively updated r
 * reaches the target. */
static msim_status cg_iterate(const ms_lagged_factor *kept, const ms_linear_target *target,
                              double norm, double *y, int64_t *iterations) {
  const ms_linear_system *s = kept->system;
  const ms_shape shape = s->model->shape;
  double rho = 0;
  for (int first = 1; norm > target->rtol * target->size; first = 0) {
    if (*iterations >= target->max_iterations) return MSIM_NOT_CONVERGED;
    const msim_status status = precondition_by_factor(kept, kept->r, kept->z);
    if (status) return status;
    const double rho_new = ms_vector_dot(shape, kept->r, kept->z);
    if (first) ms_vector_copy(shape, kept->z, kept->p);
    else ms_vector_add_scaled(shape, kept->z, rho_new / rho, kept->p, kept->p);
    rho = rho_new;
    ms_coefficients_apply(s->model, &s->a, kept->p, kept->q);
    const double curvature = ms_vector_dot(shape, kept->p, kept->q);
    if (!(curvature > 0)) return MSIM_NOT_SPD;
    const double alpha = rho / curvature;
    ms_vector_axpy(shape, alpha, kept->p, y);
    ms_vector_axpy(shape, -alpha, kept->q, kept->r);
    norm = ms_jacobi_norm(s->model, &s->a, kept->r);
    ++*iterations;
  }
  return MSIM_OK;
}

int ms_lagged_factor_begin_solve(ms_lagged_factor *kept) {
  return kept->factorizer && kept->age > 0 && kept->skips_left-- <= 0;
}

/* The recursively updated residual drifts from the true one. At the goal the iteration restarts
 * from the true residual, until that reaches the goal or is no longer halved. */
msim_status ms_lagged_factor_solve(ms_lagged_factor *kept, const ms_linear_target *target,
                                   const double *b, double *v, int64_t *iterations,
                                   double *residual) {
  ms_linear_target goal = *target;
  goal.rtol = fmax(target->rtol, DBL_EPSILON / 4);
  goal.max_iterations = (int32_t)fmin(fmax(1, iteration_limit(kept)), target->max_iterations);
  double last = INFINITY;
  int64_t count = 0;
  msim_status status = MSIM_OK;
  *residual = target->size;
  ms_vector_copy(kept->system->model->shape, b, kept->r);
  while (!status && *residual > goal.rtol * goal.size && *residual <= 0.5 * last) {
    last = *residual;
    status = cg_iterate(kept, &goal, last, v, &count);
    if (!status) *residual = ms_residual_compute(kept->system, b, v, kept->r);
  }
  *iterations += count;
  return status;
}

void ms_lagged_factor_record(ms_lagged_factor *kept, int served, int64_t iterations) {
  enum { LONGEST_WAIT = 63 };
  if (served) {
    kept->age++, kept->iterations += iterations, kept->skip_length = 0;
    return;
  }
  if (kept->age == 1)
    kept->skip_length = kept->skip_length < LONGEST_WAIT ? 2 * kept->skip_length + 1 : LONGEST_WAIT;
  kept->skips_left = kept->skip_length;
}
