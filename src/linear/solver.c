#include "linear/solver.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "linear/choose.h"

/*------------------------------------- life -----------------------------------------------------*/

/* The kernels of a factorisation run about 4 times as fast as two triangular solves, which read the
 * factor twice: flops / (4 * 4 fill). */
static msim_status take(ms_solver *s, const ms_choice *choice, msim_error *err) {
  s->linear = choice->linear;
  s->stats->analyses += s->linear->analyses;
  snprintf(s->reason, sizeof s->reason, "%s", choice->reason);
  s->kept = (ms_kept){.allowed = strcmp(s->opt->solver, "auto") == 0 && s->linear->factorises &&
                                 s->linear->fill > 0 && s->system.a.block > 1 &&
                                 !(s->opt->skip_off & MSIM_SKIP_KEPT_FACTOR)};
  if (!s->kept.allowed) return MSIM_OK;
  s->kept.price = s->linear->flops / (16 * s->linear->fill);
  return ms_cg_create(s->system.model, &s->cg, err);
}

static msim_status set_up(ms_solver *s, double h, msim_error *err) {
  const ms_model *model = s->system.model;
  msim_status status = ms_coefficients_create(model, &s->system.a, err);
  if (status) return status;
  double **work[] = {&s->guess, &s->residual, &s->correction, &s->magnitude};
  for (size_t i = 0; i < sizeof work / sizeof *work; i++) {
    *work[i] = ms_rows_vector(model->scene, &model->rows);
    if (!*work[i]) return ms_fail_memory(err, "the linear solver");
  }
  ms_choice choice;
  status = ms_choose(&s->system, s->opt, h, &choice, err);
  s->linear = choice.linear;
  if (status) return status;
  s->may_switch = strcmp(s->opt->solver, "auto") == 0 && strcmp(s->linear->name, "pcg") == 0;
  return take(s, &choice, err);
}

msim_status ms_solver_create(const ms_model *model, const msim_options *opt, double h,
                             msim_stats *stats, ms_solver **solver, msim_error *err) {
  ms_solver *s = ms_new(&model->scene->alloc, 1, sizeof *s);
  *solver = NULL;
  if (!s) return ms_fail_memory(err, "the linear solver");
  s->system.model = model;
  s->opt = opt;
  s->target = (ms_target){opt->solver_rtol, opt->solver_max_iterations};
  s->clamp = opt->jacobian == MSIM_JACOBIAN_CLAMP;
  s->stats = stats;
  msim_status status = set_up(s, h, err);
  if (status) ms_solver_destroy(s);
  else *solver = s;
  return status;
}

void ms_solver_destroy(ms_solver *s) {
  if (!s) return;
  const ms_model *model = s->system.model;
  if (s->linear) s->linear->ops->destroy(s->linear);
  ms_coefficients_destroy(model, &s->system.a);
  ms_cg_destroy(model, &s->cg);
  double *work[] = {s->guess, s->residual, s->correction, s->magnitude};
  for (size_t i = 0; i < sizeof work / sizeof *work; i++) ms_delete(&model->scene->alloc, work[i]);
  ms_delete(&model->scene->alloc, s);
}

void ms_solver_restart(ms_solver *s) {
  s->kept.age = s->kept.wait = s->kept.rest = 0;
  if (s->linear->ops->restart) s->linear->ops->restart(s->linear);
}

void ms_solver_renew(ms_solver *s) {
  ms_solver_restart(s);
  s->made_for = 0;
}

/*------------------------------------- one solve ------------------------------------------------*/

/* The row on which a spring's NaN or Inf ended up, in the diagonal block; -1: none. */
static int32_t bad_coefficients(const ms_system *s) {
  const ms_shape shape = {s->model->rows.nfree, s->model->rows.first_pinned, s->a.block};
  return ms_find_bad(shape, s->a.diagonal);
}

static msim_status assemble(ms_solver *s, const double *x, double h, int clamp) {
  double start = ms_clock();
  s->made_for = 0;
  ms_coefficients_compute(s->system.model, x, h, clamp, &s->system.a);
  s->system.clamped = clamp;
  s->culprit = bad_coefficients(&s->system);
  s->stats->assemblies++;
  s->stats->assemble_s += ms_clock() - start;
  return s->culprit < 0 ? MSIM_OK : MSIM_NOT_FINITE;
}

static void expand(ms_solver *s) {
  if (!s->linear->ops->expand) return;
  double start = ms_clock();
  s->linear->ops->expand(s->linear);
  s->stats->assemble_s += ms_clock() - start;
}

static msim_status factor(ms_solver *s, int32_t kind, msim_error *err) {
  if (!s->linear->ops->factor) return MSIM_OK;
  expand(s);
  double start = ms_clock();
  const int64_t made = s->linear->coarse_factors, kept = s->linear->kept_coarse_factors;
  msim_status status = s->linear->ops->factor(s->linear, kind, err);
  s->stats->factorizations += s->linear->factorises;
  s->stats->coarse_factors += s->linear->coarse_factors - made;
  s->stats->kept_factors += s->linear->kept_coarse_factors - kept;
  s->stats->factor_s += ms_clock() - start;
  s->kept.age = s->kept.iterations = 0;
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
    for (int32_t c = 0; c < shape.dims; c++)
      if (fabs(r[c * shape.stride + i]) > largest) largest = fabs(r[c * shape.stride + i]), row = i;
  return row;
}

static int is_good(ms_solver *s, const double *b, const double *v) {
  const ms_shape shape = s->system.model->shape;
  const double size = sqrt(ms_dot(shape, b, b));
  const double norm = s->linear->met ? s->linear->residual : true_residual(s, b, v);
  s->reached = size > 0 ? norm / size : norm;
  return norm <= s->target.rtol * size || norm <= rounding_level(s, b, v);
}

/* Accept v, or refine it with the factor at hand. */
static msim_status check(ms_solver *s, const double *b, double *v, msim_error *err) {
  enum { REFINEMENTS = 3 };
  const ms_shape shape = s->system.model->shape;
  for (int round = 0; !is_good(s, b, v); round++) {
    s->culprit = isfinite(s->reached) ? largest_row(shape, s->residual) : ms_find_bad(shape, v);
    if (!isfinite(s->reached))
      return ms_fail(err, MSIM_NOT_CONVERGED, "solver %s gave an answer that is not finite",
                     s->linear->name);
    if (round == REFINEMENTS || !s->linear->factorises)
      return ms_fail(
          err, MSIM_NOT_CONVERGED,
          "solver %s left a residual of %.3g of the right side; solver.rtol asks for %.3g",
          s->linear->name, s->reached, s->target.rtol);
    memset(s->correction, 0, (size_t)shape.dims * (size_t)shape.stride * sizeof *s->correction);
    int64_t iterations = 0;
    msim_status status =
        s->linear->ops->solve(s->linear, &s->target, s->residual, s->correction, &iterations, err);
    if (status) return status;
    ms_axpy(shape, 1, s->correction, v);
    s->stats->refinements++;
  }
  return MSIM_OK;
}

/* Factors need none; conjugate gradients by a kept one do. */
static int uses_guess(const ms_linear *linear) { return !linear->exact && !linear->factorises; }

static msim_status solve(ms_solver *s, const double *b, double *v, msim_error *err) {
  double start = ms_clock();
  if (uses_guess(s->linear)) ms_copy(s->system.model->shape, s->guess, v);
  msim_status status =
      s->linear->ops->solve(s->linear, &s->target, b, v, &s->stats->iterations, err);
  /* an iteration that ran out may still stand at rounding level */
  if ((status == MSIM_OK && !s->linear->exact) || status == MSIM_NOT_CONVERGED)
    status = check(s, b, v, err);
  s->stats->solve_s += ms_clock() - start;
  return status;
}

static msim_status factor_and_solve(ms_solver *s, int32_t kind, const double *b, double *v,
                                    msim_error *err) {
  msim_status status = factor(s, kind, err);
  if (!status) status = solve(s, b, v, err);
  s->kept.age = !status && kind == MSIM_FACTOR_SPD;
  return status;
}

/*------------------------------------- a kept factor --------------------------------------------*/

static msim_status by_factor(void *data, const double *r, double *z) {
  ms_solver *s = data;
  int64_t iterations = 0;
  return s->linear->ops->solve(s->linear, &s->target, r, z, &iterations, NULL);
}

/* This step may cost what steps cost on average, the factor's making included. A factor that was no
 * help in the very next step is a sign: the next tries come after 1, 3, 7, ... 63 steps. */
static msim_status try_kept(ms_solver *s, const double *b, double *v) {
  enum { LONGEST_WAIT = 63 };
  ms_kept *k = &s->kept;
  if (!k->allowed || k->age == 0 || k->rest-- > 0) return MSIM_NOT_CONVERGED;
  const double start = ms_clock();
  const double limit = (k->price + (double)k->iterations) / (double)(k->age + 1);
  const ms_target target = {s->target.rtol,
                            (int32_t)fmin(fmax(1, limit), s->target.max_iterations)};
  int64_t iterations = 0;
  ms_copy(s->system.model->shape, s->guess, v);
  msim_status status = ms_cg_solve(&s->cg, &s->system, by_factor, s, &target, b, v, &iterations);
  if (!status && !is_good(s, b, v)) status = MSIM_NOT_CONVERGED;
  if (!status) {
    k->age++, k->iterations += iterations, k->wait = 0;
    s->stats->kept_factors++;
  } else {
    if (k->age == 1) k->wait = k->wait < LONGEST_WAIT ? 2 * k->wait + 1 : LONGEST_WAIT;
    k->rest = k->wait;
  }
  s->stats->iterations += iterations;
  s->stats->solve_s += ms_clock() - start;
  return status;
}

/*------------------------------------- what else may happen -------------------------------------*/

/* The row whose springs push hardest sideways for its mass: sum of -t over the mass. */
static int32_t most_compressed(const ms_solver *s) {
  const ms_model *model = s->system.model;
  const ms_coefficients *a = &s->system.a;
  int32_t worst = 0;
  double largest = -1;
  for (int32_t r = 0; r < model->rows.nfree; r++) {
    const ms_span span = ms_halves_of(&model->halves, r);
    double push = 0;
    for (int32_t at = span.begin; at < span.end; at += span.step) push += fmax(0, -a->t[at]);
    push *= model->inv_mass[r];
    if (push > largest) largest = push, worst = r;
  }
  return worst;
}

static msim_status not_positive_definite(ms_solver *s, const double *x, double h, const double *b,
                                         double *v, msim_error *err) {
  s->stats->indefinite_steps++;
  switch (s->opt->indefinite) {
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

/* pcg did not converge: `auto` takes cholmod from here on. */
static msim_status switch_to_cholmod(ms_solver *s, msim_error *err) {
  ms_choice choice = {.reason = "auto: pcg did not converge"};
  s->may_switch = 0;
  msim_status status = ms_adapter_create(&s->system, "cholmod", s->opt, &choice.linear, err);
  if (status) return status;
  s->linear->ops->destroy(s->linear);
  s->stats->fallbacks++;
  s->made_for = 0;
  return take(s, &choice, err);
}

/* A does not depend on x: one factor for all steps of this h. */
static msim_status solve_constant(ms_solver *s, const double *x, double h, const double *b,
                                  double *v, msim_error *err) {
  if (s->made_for != h) {
    msim_status status = assemble(s, x, h, s->clamp);
    if (!status) status = factor(s, MSIM_FACTOR_SPD, err);
    if (status) return status;
    s->made_for = h;
  }
  return solve(s, b, v, err);
}

static msim_status solve_variable(ms_solver *s, const double *x, double h, const double *b,
                                  double *v, msim_error *err) {
  msim_status status = assemble(s, x, h, s->clamp);
  if (status) return status;
  status = try_kept(s, b, v);
  if (status && status != MSIM_NOT_SPD) status = factor_and_solve(s, MSIM_FACTOR_SPD, b, v, err);
  return status;
}

static msim_status solve_once(ms_solver *s, const double *x, double h, const double *b, double *v,
                              msim_error *err) {
  msim_status status = s->system.a.block == 1 ? solve_constant(s, x, h, b, v, err)
                                              : solve_variable(s, x, h, b, v, err);
  if (status == MSIM_NOT_SPD && !s->clamp) status = not_positive_definite(s, x, h, b, v, err);
  return status;
}

msim_status ms_solver_solve(ms_solver *solver, const double *x, double h, const double *b,
                            double *v, msim_error *err) {
  const ms_shape shape = solver->system.model->shape;
  if (uses_guess(solver->linear) || solver->kept.allowed) ms_copy(shape, v, solver->guess);
  solver->culprit = ms_find_bad(shape, b); /* -1: none */
  if (solver->culprit >= 0) return MSIM_NOT_FINITE;
  solver->stats->solves++;
  msim_status status = solve_once(solver, x, h, b, v, err);
  if (status == MSIM_NOT_CONVERGED && solver->may_switch && !switch_to_cholmod(solver, NULL))
    status = solve_once(solver, x, h, b, v, err);
  if (!status) {
    solver->culprit = ms_find_bad(shape, v);
    if (solver->culprit >= 0) status = MSIM_NOT_FINITE;
  }
  return status;
}
