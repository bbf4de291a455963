#include "linear/kept.h"

#include <float.h>
#include <math.h>

msim_status ms_kept_create(const ms_system *system, ms_linear *by, ms_kept *kept, msim_error *err) {
  *kept = (ms_kept){.by = by};
  return ms_cg_create(system->model, &kept->cg, err);
}

void ms_kept_destroy(const ms_system *system, ms_kept *kept) {
  ms_cg_destroy(system->model, &kept->cg);
  *kept = (ms_kept){0};
}

/* A bound of the condition number of A scaled to a diagonal of 1, on which the accuracy of a factor
 * depends: twice the largest A_ii/(m_i + h drag), for A - M - h drag positive semidefinite */
static double condition(const ms_system *s) {
  const ms_rows *rows = &s->model->rows;
  double most = 1;
  for (int32_t c = 0; c < s->a.block; c++)
    for (int32_t r = 0; r < rows->nfree; r++)
      most = fmax(most, s->a.diagonal[(size_t)c * (size_t)rows->first_pinned + (size_t)r] /
                            (s->model->mass[r] + s->a.drag));
  return 2 * most;
}

/* In single precision the factor has errors of FLT_EPSILON/2 times the condition number: if LITTLE,
 * conjugate gradients correct them in an iteration or two. */
void ms_kept_renew(ms_kept *kept, const ms_system *system, double limit) {
  const double ROUGH = 1e-3, LITTLE = 0.1;
  kept->age = 1, kept->iterations = 0, kept->limit = limit;
  kept->rtol = FLT_EPSILON / 2 * condition(system) < LITTLE ? ROUGH : DBL_EPSILON;
}

void ms_kept_forget(ms_kept *kept) { kept->age = kept->wait = kept->rest = 0; }

static msim_status by_factor(void *data, const double *r, double *z) {
  ms_kept *kept = data;
  const ms_target target = {.rtol = kept->rtol, .max_iterations = 1};
  int64_t iterations = 0;
  return kept->by->ops->solve(kept->by, &target, r, z, &iterations, NULL);
}

static double limit_of(const ms_kept *kept) {
  if (kept->limit > 0) return kept->limit;
  const double price = kept->by->flops / (MS_FLOPS_PER_FILL * kept->by->fill);
  return (price + (double)kept->iterations) / (double)(kept->age + 1);
}

int ms_kept_is_ready(ms_kept *kept) { return kept->by && kept->age > 0 && kept->rest-- <= 0; }

msim_status ms_kept_solve(ms_kept *kept, const ms_system *system, const ms_target *target,
                          const double *b, double *v, int64_t *iterations, double *residual) {
  const double limit = fmin(fmax(1, limit_of(kept)), target->max_iterations);
  const ms_target bounded = {target->rtol, target->size, (int32_t)limit};
  return ms_cg_solve(&kept->cg, system, by_factor, kept, &bounded, b, v, iterations, residual);
}

void ms_kept_judge(ms_kept *kept, int served, int64_t iterations) {
  enum { LONGEST_WAIT = 63 };
  if (served) {
    kept->age++, kept->iterations += iterations, kept->wait = 0;
    return;
  }
  if (kept->age == 1) kept->wait = kept->wait < LONGEST_WAIT ? 2 * kept->wait + 1 : LONGEST_WAIT;
  kept->rest = kept->wait;
}
