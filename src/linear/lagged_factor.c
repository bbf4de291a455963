#include "linear/lagged_factor.h"

#include <float.h>
#include <math.h>

msim_status ms_lagged_factor_create(const ms_linear_system *system, ms_linear *by,
                                    ms_lagged_factor *kept, msim_error *err) {
  *kept = (ms_lagged_factor){.factorizer = by};
  return ms_cg_create(system->model, &kept->cg, err);
}

void ms_lagged_factor_destroy(const ms_linear_system *system, ms_lagged_factor *kept) {
  ms_cg_destroy(system->model, &kept->cg);
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
void ms_lagged_factor_renew(ms_lagged_factor *kept, const ms_linear_system *system, double limit) {
  const double ROUGH = 1e-3, LITTLE = 0.1;
  kept->age = 1, kept->iterations = 0, kept->limit = limit;
  kept->rtol = FLT_EPSILON / 2 * condition_bound(system) < LITTLE ? ROUGH : DBL_EPSILON;
}

void ms_lagged_factor_discard(ms_lagged_factor *kept) {
  kept->age = kept->skip_length = kept->skips_left = 0;
}

static msim_status precondition_by_factor(void *data, const double *r, double *z) {
  ms_lagged_factor *kept = data;
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

int ms_lagged_factor_begin_solve(ms_lagged_factor *kept) {
  return kept->factorizer && kept->age > 0 && kept->skips_left-- <= 0;
}

msim_status ms_lagged_factor_solve(ms_lagged_factor *kept, const ms_linear_system *system,
                                   const ms_linear_target *target, const double *b, double *v,
                                   int64_t *iterations, double *residual) {
  const double limit = fmin(fmax(1, iteration_limit(kept)), target->max_iterations);
  const ms_linear_target bounded = {target->rtol, target->size, (int32_t)limit};
  return ms_cg_solve(&kept->cg, system, precondition_by_factor, kept, &bounded, b, v, iterations,
                     residual);
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
