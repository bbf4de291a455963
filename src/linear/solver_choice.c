#include "linear/solver_choice.h"

#include <stdio.h>
#include <string.h>

#include "linear/lagged_factor.h"
#include "linear/iteration_estimate.h"

/* Up to so many iterations cholmod is not opened to estimate the cost of its factor. */
#define FEW_ITERATIONS 150.0

static msim_status choose_pcg(const ms_linear_system *system, const msim_options *opt,
                              const ms_iteration_estimate *p, const char *but,
                              ms_solver_choice *choice, msim_error *err) {
  msim_status status =
      ms_pcg_create(system, opt, (ms_coarse_size){.aggregate = p->aggregate}, &choice->linear, err);
  if (status) return status;
  const char *by = strcmp(opt->solver, "auto") == 0 ? "auto" : "selected by option solver";
  if (choice->linear->aggregates)
    snprintf(choice->reason, sizeof choice->reason,
             "%s: about %.0f iterations with a coarse space, %.0f without%s", by, p->two_level,
             p->one_level, but);
  else
    snprintf(choice->reason, sizeof choice->reason,
             "%s: about %.0f iterations; a coarse space would not be cost-effective%s", by,
             p->one_level, but);
  return MSIM_OK;
}

/* The cost of a step by a direct solver, in flops of a factorization. A scalar matrix is factored
 * once for all steps. */
static double cost_of_step(const ms_linear *linear) {
  const ms_linear_system *s = linear->system;
  return s->a.block == 1 ? MS_SOLVE_FLOPS_PER_NONZERO * linear->fill * s->model->unknowns.dims
                         : linear->flops;
}

/* solver = auto: cholmod where A need not be positive definite (an error if it is not available),
 * or where its factor costs fewer flops than the estimated iterations; else pcg. */
static msim_status choose_by_cost(const ms_linear_system *system, const msim_options *opt,
                                  const ms_iteration_estimate *p, ms_solver_choice *choice,
                                  msim_error *err) {
  const double iterations = p->aggregate ? p->two_level : p->one_level;
  const int constant = system->a.block == 1;
  const int may_fail = opt->indefinite == MSIM_INDEFINITE_SOLVE && !constant;
  if (iterations <= FEW_ITERATIONS && !may_fail && !constant)
    return choose_pcg(system, opt, p, "", choice, err);
  msim_error why;
  msim_status status = ms_adapter_create(system, "cholmod", opt, &choice->linear, &why);
  if (status == MSIM_ERR_MEMORY) return ms_error_set(err, status, "%s", why.text);
  if (status && may_fail)
    return ms_error_set(err, status,
                        "indefinite = solve requires cholmod, which is not available (%s); install "
                        "it, or use indefinite = clamp or stop",
                        why.text);
  if (status) return choose_pcg(system, opt, p, "; cholmod is not available", choice, err);
  const double spared = iterations * ms_lagged_factor_iteration_flops(system->model);
  if (may_fail) {
    snprintf(choice->reason, sizeof choice->reason,
             "auto: indefinite = solve requires a direct solver");
    return MSIM_OK;
  }
  if (cost_of_step(choice->linear) <= spared) {
    snprintf(
        choice->reason, sizeof choice->reason,
        "auto: a factorization of %.2g flops is estimated to cost less than %.0f iterations of pcg",
        choice->linear->flops, iterations);
    return MSIM_OK;
  }
  choice->linear->ops->destroy(choice->linear);
  choice->linear = NULL;
  return choose_pcg(system, opt, p, "; a factorization would cost more", choice, err);
}

msim_status ms_solver_choice_make(const ms_linear_system *system, const msim_options *opt, double h,
                                  ms_solver_choice *choice, msim_error *err) {
  const ms_model *model = system->model;
  *choice = (ms_solver_choice){0};
  const int is_empty = model->unknowns.nfree == 0 && !model->shape.ranks;
  if (!(model->features & MS_HAS_SPRINGS) || is_empty) {
    snprintf(choice->reason, sizeof choice->reason,
             "no springs or no free particles: the matrix is diagonal");
    return ms_diagonal_create(system, &choice->linear, err);
  }
  const ms_iteration_estimate p = ms_iteration_estimate_compute(model, h, opt->solver_rtol);
  if (strcmp(opt->solver, "auto") == 0) return choose_by_cost(system, opt, &p, choice, err);
  snprintf(choice->reason, sizeof choice->reason, "selected by option solver");
  msim_status status = strcmp(opt->solver, "pcg") == 0
                           ? choose_pcg(system, opt, &p, "", choice, err)
                           : ms_adapter_create(system, opt->solver, opt, &choice->linear, err);
  if (status || opt->indefinite != MSIM_INDEFINITE_SOLVE || choice->linear->symmetric)
    return status;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "solver '%s' cannot solve indefinite systems, which indefinite = solve "
                      "requires; use solver = cholmod, or indefinite = clamp or stop",
                      opt->solver);
}

int ms_solver_choice_is_auto(const msim_options *opt) { return strcmp(opt->solver, "auto") == 0; }

int ms_solver_choice_depends_on_springs(const msim_options *opt) {
  return ms_solver_choice_is_auto(opt) || strcmp(opt->solver, "pcg") == 0;
}
