#include "linear/refinement.h"

#include <math.h>

#include "base/clock.h"
#include "linear/jacobi.h"
#include "linear/residual.h"

int ms_refinement_is_accurate(ms_solver *s, const double *b, const double *v,
                              double residual_norm) {
  const ms_linear_system *system = &s->system;
  const double size = s->target.size;
  if (isnan(residual_norm)) residual_norm = ms_residual_compute(system, b, v, s->residual);
  s->relative_residual = size > 0 ? residual_norm / size : residual_norm;
  return residual_norm <= s->target.rtol * size ||
         residual_norm <=
             ms_residual_compute_rounding_level(system, b, v, s->magnitude, s->correction);
}

/* With rtol >= 1e-4 a backend may solve in single precision (backend.h), which is for
 * preconditioners only. */
static ms_linear_target factor_target(const ms_solver *s) {
  const double FINE = 1e-5;
  ms_linear_target target = s->target;
  if (s->linear->factorizes) target.rtol = fmin(target.rtol, FINE);
  return target;
}

/* Accept v, or refine it iteratively with the present factor, or by an iterative solver that has
 * converged, as residuals that it updates recursively drift from the true ones. */
static msim_status check_and_refine(ms_solver *s, int has_converged, const double *b, double *v,
                                    msim_error *err) {
  enum { REFINEMENTS = 3 };
  const ms_shape shape = s->system.model->shape;
  const ms_linear_target target = factor_target(s);
  double residual_norm = s->linear->is_verified ? s->linear->residual : NAN;
  for (int round = 0; !ms_refinement_is_accurate(s, b, v, residual_norm); round++) {
    s->offender = isfinite(s->relative_residual) ? ms_vector_find_largest(shape, s->residual)
                                                 : ms_vector_find_invalid(shape, v);
    if (!isfinite(s->relative_residual))
      return ms_error_set(err, MSIM_NOT_CONVERGED, "the solution of solver %s is not finite",
                          s->linear->name);
    if (round == REFINEMENTS || !has_converged)
      return ms_error_set(
          err, MSIM_NOT_CONVERGED,
          "solver %s reached a relative residual of %.3g, not %.3g; raise solver.rtol%s",
          s->linear->name, s->relative_residual, s->target.rtol,
          s->linear->factorizes ? "" : " or solver.max_iterations, or use solver = cholmod");
    ms_vector_clear_all(shape, s->correction);
    msim_status status = s->linear->ops->solve(s->linear, &target, s->residual, s->correction,
                                               &s->stats->iterations, err);
    if (status) return status;
    ms_vector_axpy(shape, 1, s->correction, v);
    residual_norm = NAN;
    s->stats->refinements++;
  }
  return MSIM_OK;
}

msim_status ms_refinement_solve(ms_solver *s, const double *b, double *v, msim_error *err) {
  double start = ms_clock_now();
  ms_vector_clear_all(s->system.model->shape, v);
  const ms_linear_target target = factor_target(s);
  msim_status status = s->linear->ops->solve(s->linear, &target, b, v, &s->stats->iterations, err);
  /* after max_iterations the residual may still be at rounding level */
  if ((status == MSIM_OK && !s->linear->exact) || status == MSIM_NOT_CONVERGED)
    status = check_and_refine(s, status == MSIM_OK, b, v, err);
  s->stats->solve_s += ms_clock_now() - start;
  return status;
}
