#include "linear/solver.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "linear/registry.h"

/*------------------------------------- choice ---------------------------------------------------*/

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
static msim_status choose(ms_solver *s, const msim_options *opt, double h, msim_error *err) {
  const ms_model *model = s->system.model;
  double iterations = predict_iterations(model, h, opt->solver_rtol);
  int may_fail = opt->indefinite == MSIM_INDEFINITE_SOLVE;
  if (iterations > FEW_ITERATIONS || may_fail) {
    msim_error why;
    msim_status status = ms_adapter_create(&s->system, "cholmod", opt, &s->linear, &why);
    if (status == MSIM_ERR_MEMORY || (status && may_fail))
      return ms_fail(err, status, "indefinite = solve needs a solver that can: %s", why.text);
    double spared = iterations * FLOPS_PER_SPRING * model->springs.n;
    if (!status && (may_fail || s->linear->flops <= spared)) {
      snprintf(s->reason, sizeof s->reason,
               "auto: a factor of %.2g flops against about %.0f iterations", s->linear->flops,
               iterations);
      return MSIM_OK;
    }
    if (!status) s->linear->ops->destroy(s->linear);
    snprintf(s->reason, sizeof s->reason, "auto: about %.0f iterations, and %s", iterations,
             status ? "cholmod is not there" : "a factor costs more");
  } else {
    snprintf(s->reason, sizeof s->reason, "auto: about %.0f iterations", iterations);
  }
  return ms_pcg_create(&s->system, &s->linear, err);
}

static msim_status pick(ms_solver *s, const msim_options *opt, double h, msim_error *err) {
  const ms_model *model = s->system.model;
  if (!(model->passes & MSIM_SKIP_SPRINGS) || model->rows.nfree == 0) {
    snprintf(s->reason, sizeof s->reason, "no spring couples two unknowns: A is diagonal");
    return ms_diagonal_create(&s->system, &s->linear, err);
  }
  if (strcmp(opt->solver, "auto") == 0) return choose(s, opt, h, err);
  snprintf(s->reason, sizeof s->reason, "asked for");
  msim_status status = strcmp(opt->solver, "pcg") == 0
                           ? ms_pcg_create(&s->system, &s->linear, err)
                           : ms_adapter_create(&s->system, opt->solver, opt, &s->linear, err);
  if (status || s->indefinite != MSIM_INDEFINITE_SOLVE || s->linear->symmetric) return status;
  return ms_fail(err, MSIM_ERR_ARG,
                 "solver '%s' cannot solve systems that are not positive definite, as indefinite = "
                 "solve asks; take cholmod, or indefinite = clamp or stop",
                 opt->solver);
}

/*------------------------------------- life -----------------------------------------------------*/

static msim_status set_up(ms_solver *s, const msim_options *opt, double h, msim_error *err) {
  const ms_model *model = s->system.model;
  msim_status status = ms_coefficients_create(model, &s->system.a, err);
  if (status) return status;
  double **work[] = {&s->guess, &s->residual, &s->correction, &s->magnitude};
  for (size_t i = 0; i < sizeof work / sizeof *work; i++) {
    *work[i] = ms_rows_vector(model->scene, &model->rows);
    if (!*work[i]) return ms_fail_memory(err, "the linear solver");
  }
  status = pick(s, opt, h, err);
  if (!status) s->stats->analyses += s->linear->analyses;
  return status;
}

msim_status ms_solver_create(const ms_model *model, const msim_options *opt, double h,
                             msim_stats *stats, ms_solver **solver, msim_error *err) {
  ms_solver *s = ms_new(&model->scene->alloc, 1, sizeof *s);
  *solver = NULL;
  if (!s) return ms_fail_memory(err, "the linear solver");
  s->system.model = model;
  s->target = (ms_target){opt->solver_rtol, opt->solver_max_iterations};
  s->clamp = opt->jacobian == MSIM_JACOBIAN_CLAMP;
  s->indefinite = opt->indefinite;
  s->stats = stats;
  msim_status status = set_up(s, opt, h, err);
  if (status) ms_solver_destroy(s);
  else *solver = s;
  return status;
}

void ms_solver_destroy(ms_solver *s) {
  if (!s) return;
  const ms_model *model = s->system.model;
  if (s->linear) s->linear->ops->destroy(s->linear);
  ms_coefficients_destroy(model, &s->system.a);
  double *work[] = {s->guess, s->residual, s->correction, s->magnitude};
  for (size_t i = 0; i < sizeof work / sizeof *work; i++) ms_delete(&model->scene->alloc, work[i]);
  ms_delete(&model->scene->alloc, s);
}

/*------------------------------------- one solve ------------------------------------------------*/

/* The row on which a spring's NaN or Inf ended up, in the diagonal block; -1: none. */
static int32_t bad_coefficients(const ms_system *s) {
  const ms_shape shape = {s->model->rows.nfree, s->model->rows.first_pinned};
  return ms_find_bad(shape, s->a.diagonal);
}

static msim_status assemble(ms_solver *s, const double *x, double h, int clamp) {
  double start = ms_clock();
  ms_coefficients_compute(s->system.model, x, h, clamp, &s->system.a);
  s->culprit = bad_coefficients(&s->system);
  int finite = s->culprit < 0;
  if (finite && s->linear->ops->expand) s->linear->ops->expand(s->linear);
  s->stats->assemblies++;
  s->stats->assemble_s += ms_clock() - start;
  return finite ? MSIM_OK : MSIM_NOT_FINITE;
}

static msim_status factor(ms_solver *s, int32_t kind, msim_error *err) {
  if (!s->linear->ops->factor) return MSIM_OK;
  double start = ms_clock();
  msim_status status = s->linear->ops->factor(s->linear, kind, err);
  s->stats->factorizations += s->linear->factorises;
  s->stats->factor_s += ms_clock() - start;
  return status;
}

/* ||b - A v||, and the residual itself in s->residual */
static double true_residual(ms_solver *s, const double *b, const double *v) {
  const ms_shape shape = s->system.model->shape;
  ms_coefficients_apply(s->system.model, &s->system.a, v, s->residual);
  ms_combine(shape, b, -1, s->residual, s->residual);
  return sqrt(ms_dot(shape, s->residual, s->residual));
}

/* 8 eps || |A| |v| + |b| ||: no solver gets below a small multiple of eps times this */
static double rounding_level(ms_solver *s, const double *b, const double *v) {
  const ms_shape shape = s->system.model->shape;
  ms_coefficients_apply_abs(s->system.model, &s->system.a, v, s->magnitude);
  double sum = ms_dot(shape, s->magnitude, s->magnitude);
  return 8 * DBL_EPSILON * (sqrt(sum) + sqrt(ms_dot(shape, b, b)));
}

static int32_t largest_row(ms_shape shape, const double *r) {
  int32_t row = 0;
  double largest = -1;
  for (int32_t i = 0; i < shape.n; i++)
    for (int32_t c = 0; c < 3; c++)
      if (fabs(r[c * shape.stride + i]) > largest) largest = fabs(r[c * shape.stride + i]), row = i;
  return row;
}

/* Accept v, or refine it with the factor at hand. */
static msim_status check(ms_solver *s, const double *b, double *v, msim_error *err) {
  enum { REFINEMENTS = 3 };
  const ms_shape shape = s->system.model->shape;
  const double size = sqrt(ms_dot(shape, b, b));
  for (int round = 0;; round++) {
    double norm = true_residual(s, b, v);
    s->reached = size > 0 ? norm / size : norm;
    if (norm <= s->target.rtol * size || norm <= rounding_level(s, b, v)) return MSIM_OK;
    if (round == REFINEMENTS || !s->linear->factorises || !isfinite(norm)) break;
    memset(s->correction, 0, 3 * (size_t)shape.stride * sizeof *s->correction);
    int64_t iterations = 0;
    msim_status status =
        s->linear->ops->solve(s->linear, &s->target, s->residual, s->correction, &iterations, err);
    if (status) return status;
    ms_axpy(shape, 1, s->correction, v);
  }
  s->culprit = largest_row(shape, s->residual);
  return ms_fail(err, MSIM_NOT_CONVERGED,
                 "solver %s left a residual of %.3g of the right side; solver.rtol asks for %.3g",
                 s->linear->name, s->reached, s->target.rtol);
}

static msim_status solve(ms_solver *s, const double *b, double *v, msim_error *err) {
  const ms_shape shape = s->system.model->shape;
  double start = ms_clock();
  ms_copy(shape, s->guess, v);
  s->stats->solves++;
  msim_status status =
      s->linear->ops->solve(s->linear, &s->target, b, v, &s->stats->iterations, err);
  /* an iteration that ran out may still stand at rounding level */
  if (status == MSIM_OK || status == MSIM_NOT_CONVERGED) status = check(s, b, v, err);
  s->stats->solve_s += ms_clock() - start;
  return status;
}

static msim_status factor_and_solve(ms_solver *s, int32_t kind, const double *b, double *v,
                                    msim_error *err) {
  msim_status status = factor(s, kind, err);
  return status ? status : solve(s, b, v, err);
}

/* The row whose springs push hardest sideways for its mass: sum of -t over the mass. */
static int32_t most_compressed(ms_solver *s) {
  const ms_model *model = s->system.model;
  const ms_springs *springs = &model->springs;
  double *push = s->residual;
  memset(push, 0, 3 * (size_t)model->rows.stride * sizeof *push);
  for (int32_t e = 0; e < springs->n; e++) {
    double t = fmax(0, -s->system.a.t[e]);
    push[springs->i[e]] += t, push[springs->j[e]] += t;
  }
  for (int32_t r = 0; r < model->rows.nfree; r++) push[r] *= model->inv_mass[r];
  return largest_row(model->shape, push);
}

static msim_status not_positive_definite(ms_solver *s, const double *x, double h, const double *b,
                                         double *v, msim_error *err) {
  s->stats->indefinite_steps++;
  switch (s->indefinite) {
    case MSIM_INDEFINITE_SOLVE:
      return factor_and_solve(s, MSIM_FACTOR_SYMMETRIC, b, v, err);
    case MSIM_INDEFINITE_CLAMP: {
      msim_status status = assemble(s, x, h, 1);
      return status ? status : factor_and_solve(s, MSIM_FACTOR_SPD, b, v, err);
    }
    default:
      s->culprit = most_compressed(s);
      return ms_fail(
          err, MSIM_NOT_SPD,
          "the matrix M - h D - h^2 J is not positive definite (h = %g s is too long for "
          "the compressed springs; indefinite = clamp goes on)",
          h);
  }
}

msim_status ms_solver_solve(ms_solver *solver, const double *x, double h, const double *b,
                            double *v, msim_error *err) {
  const ms_shape shape = solver->system.model->shape;
  ms_copy(shape, v, solver->guess);
  solver->culprit = ms_find_bad(shape, b); /* -1: none */
  if (solver->culprit >= 0) return MSIM_NOT_FINITE;
  msim_status status = assemble(solver, x, h, solver->clamp);
  if (!status) status = factor_and_solve(solver, MSIM_FACTOR_SPD, b, v, err);
  if (status == MSIM_NOT_SPD && !solver->clamp)
    status = not_positive_definite(solver, x, h, b, v, err);
  if (!status) {
    solver->culprit = ms_find_bad(shape, v);
    if (solver->culprit >= 0) status = MSIM_NOT_FINITE;
  }
  return status;
}
