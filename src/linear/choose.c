#include "linear/choose.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Iterations that conjugate gradients will need: half the root of the condition number times the
 * digits asked for. kappa <= 1 + h^2 omega^2 + h g, by Gershgorin, whatever the state is. */
static double predict_iterations(const ms_model *model, double h, double rtol) {
  const ms_springs *s = &model->springs;
  double worst = 0;
  for (int32_t e = 0; e < s->n; e++) {
    double stiffness = h * h * s->k[e] + h * s->damping[e];
    double mass = INFINITY;
    if (s->i[e] < model->rows.nfree) mass = fmin(mass, model->mass[s->i[e]]);
    if (s->j[e] < model->rows.nfree) mass = fmin(mass, model->mass[s->j[e]]);
    worst = fmax(worst, stiffness / mass);
  }
  double degree = 2.0 * s->n / fmax(1, model->rows.nfree);
  return 0.5 * sqrt(1 + 2 * degree * worst) * log(2 / rtol);
}

/* Constants of `auto`, in units of a matrix entry's work: an iteration touches every spring twice;
 * a factorisation runs dense kernels at many flops in the same time. */
#define FEW_ITERATIONS   30.0
#define FLOPS_PER_SPRING 300.0

/* Few iterations: pcg, and no library is opened. Else cholmod, where it is there and its flops are
 * fewer than those of the iterations it spares. */
static msim_status estimate(const ms_system *system, const msim_options *opt, double h,
                            ms_choice *choice, msim_error *err) {
  const ms_model *model = system->model;
  double iterations = predict_iterations(model, h, opt->solver_rtol);
  int may_fail = opt->indefinite == MSIM_INDEFINITE_SOLVE;
  if (iterations > FEW_ITERATIONS || may_fail) {
    msim_error why;
    msim_status status = ms_adapter_create(system, "cholmod", opt, &choice->linear, &why);
    if (status == MSIM_ERR_MEMORY || (status && may_fail))
      return ms_fail(err, status, "indefinite = solve needs a solver that can: %s", why.text);
    double spared = iterations * FLOPS_PER_SPRING * model->springs.n;
    if (!status && (may_fail || choice->linear->flops <= spared)) {
      snprintf(choice->reason, sizeof choice->reason,
               "auto: a factor of %.2g flops against about %.0f iterations", choice->linear->flops,
               iterations);
      return MSIM_OK;
    }
    if (!status) choice->linear->ops->destroy(choice->linear);
    snprintf(choice->reason, sizeof choice->reason, "auto: about %.0f iterations, and %s",
             iterations, status ? "cholmod is not there" : "a factor costs more");
  } else {
    snprintf(choice->reason, sizeof choice->reason, "auto: about %.0f iterations", iterations);
  }
  return ms_pcg_create(system, &choice->linear, err);
}

msim_status ms_choose(const ms_system *system, const msim_options *opt, double h, ms_choice *choice,
                      msim_error *err) {
  const ms_model *model = system->model;
  *choice = (ms_choice){0};
  if (!(model->passes & MSIM_SKIP_SPRINGS) || model->rows.nfree == 0) {
    snprintf(choice->reason, sizeof choice->reason,
             "no spring couples two unknowns: A is diagonal");
    return ms_diagonal_create(system, &choice->linear, err);
  }
  if (strcmp(opt->solver, "auto") == 0) return estimate(system, opt, h, choice, err);
  snprintf(choice->reason, sizeof choice->reason, "asked for");
  msim_status status = strcmp(opt->solver, "pcg") == 0
                           ? ms_pcg_create(system, &choice->linear, err)
                           : ms_adapter_create(system, opt->solver, opt, &choice->linear, err);
  if (status || opt->indefinite != MSIM_INDEFINITE_SOLVE || choice->linear->symmetric)
    return status;
  return ms_fail(err, MSIM_ERR_ARG,
                 "solver '%s' cannot solve systems that are not positive definite, as indefinite = "
                 "solve asks; take cholmod, or indefinite = clamp or stop",
                 opt->solver);
}
