#include "linear/solver.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "linear/choose.h"
#include "linear/jacobi.h"
#include "linear/residual.h"
#include "physics/culprit.h"

/*------------------------------------- creation and destruction ---------------------------------*/

static int may_keep(const ms_solver *s) {
  return strcmp(s->opt->solver, "auto") == 0 && s->system.a.block > 1 &&
         !(s->opt->skip_off & MSIM_SKIP_KEPT_FACTOR);
}

int ms_solver_may_hold(const ms_solver *s) {
  return s->opt->collision == MSIM_COLLISION_EVENT && s->system.model->passes & MSIM_SKIP_PLANES;
}

static msim_status origin_create(ms_solver *s, ms_origin *origin, msim_error *err) {
  const ms_model *model = s->system.model;
  if (s->system.a.block == 1 || origin->x) return MSIM_OK;
  const int holds = ms_solver_may_hold(s);
  origin->x = ms_rows_vector(model->scene, &model->rows);
  if (holds)
    origin->hold = ms_new(&model->scene->alloc, (size_t)model->rows.nfree, sizeof *origin->hold);
  if (origin->x && (origin->hold || !holds)) return MSIM_OK;
  return ms_fail_memory(err, "the linear solver");
}

static void origin_destroy(ms_solver *s, ms_origin *origin) {
  ms_delete(&s->system.model->scene->alloc, origin->x);
  ms_delete(&s->system.model->scene->alloc, origin->hold);
  *origin = (ms_origin){0};
}

static msim_status keep_by(ms_solver *s, ms_linear *by, msim_error *err) {
  const msim_status status = origin_create(s, &s->by_kept, err);
  return status ? status : ms_kept_create(&s->system, by, &s->kept, err);
}

static msim_status take(ms_solver *s, const ms_choice *choice, msim_error *err) {
  s->linear = choice->linear;
  s->stats->analyses += s->linear->analyses;
  snprintf(s->reason, sizeof s->reason, "%s", choice->reason);
  s->savings.allowed = may_keep(s) && s->linear->aggregates > 0;
  if (s->linear->aggregates && !(s->opt->skip_off & MSIM_SKIP_KEPT_FACTOR)) {
    const msim_status status = origin_create(s, &s->by_coarse, err);
    if (status) return status;
  }
  if (!may_keep(s) || !s->linear->factorises || !(s->linear->fill > 0)) return MSIM_OK;
  return keep_by(s, s->linear, err);
}

void ms_solver_drop_kept(ms_solver *s) {
  if (s->savings.cholmod) s->savings.cholmod->ops->destroy(s->savings.cholmod);
  ms_kept_destroy(&s->system, &s->kept);
  origin_destroy(s, &s->by_kept);
  s->savings = (ms_savings){0};
}

static msim_status set_up(ms_solver *s, double h, msim_error *err) {
  const ms_model *model = s->system.model;
  msim_status status = ms_coefficients_create(model, &s->system.a, err);
  if (!status) status = ms_free_components_create(model, &s->components, err);
  if (status) return status;
  double **work[] = {&s->b, &s->residual, &s->correction, &s->magnitude};
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

/* With solver = auto or pcg: solvers for the damping derivative, unless that selected takes it. */
static msim_status set_up_unsymmetric(ms_solver *s, msim_error *err) {
  const ms_model *model = s->system.model;
  if (!ms_solver_is_chosen(s) || s->linear->exact || s->linear->unsymmetric) return MSIM_OK;
  if (s->system.a.block == 1 || !(model->passes & MSIM_SKIP_DAMPING)) return MSIM_OK;
  const msim_status status = ms_elimination_create(model, &s->elimination, err);
  return status ? status : ms_bicgstab_create(model, &s->bicgstab, err);
}

msim_status ms_solver_create(const ms_model *model, const msim_options *opt, double h,
                             int nonlinear, msim_stats *stats, ms_solver **solver,
                             msim_error *err) {
  ms_solver *s = ms_new(&model->scene->alloc, 1, sizeof *s);
  *solver = NULL;
  if (!s) return ms_fail_memory(err, "the linear solver");
  s->system.model = model;
  s->opt = opt;
  s->stats = stats;
  s->planned = h;
  msim_status status = set_up(s, h, err);
  if (!status && nonlinear) status = set_up_unsymmetric(s, err);
  if (status) ms_solver_destroy(s);
  else *solver = s;
  return status;
}

void ms_solver_destroy(ms_solver *s) {
  if (!s) return;
  const ms_model *model = s->system.model;
  if (s->linear) s->linear->ops->destroy(s->linear);
  ms_solver_drop_kept(s);
  origin_destroy(s, &s->by_coarse);
  ms_coefficients_destroy(model, &s->system.a);
  ms_free_components_destroy(model, &s->components);
  ms_elimination_destroy(model, &s->elimination);
  ms_bicgstab_destroy(model, &s->bicgstab);
  double *work[] = {s->b, s->residual, s->correction, s->magnitude};
  for (size_t i = 0; i < sizeof work / sizeof *work; i++) ms_delete(&model->scene->alloc, work[i]);
  ms_delete(&model->scene->alloc, s);
}

void ms_solver_restart(ms_solver *s) {
  ms_kept_forget(&s->kept);
  s->savings.flops = 0, s->savings.steps = 0;
  if (s->linear->ops->restart) s->linear->ops->restart(s->linear);
}

void ms_solver_renew(ms_solver *s) {
  ms_solver_restart(s);
  s->made_for = 0;
}

/*------------------------------------- one solve ------------------------------------------------*/

/* The first unknown whose diagonal block is not finite; -1: none. */
static int32_t bad_coefficients(const ms_system *s) {
  const ms_rows *rows = &s->model->rows;
  const ms_shape shape = {.n = rows->nfree, .stride = rows->first_pinned, .dims = s->a.block};
  return ms_find_bad(shape, s->a.diagonal);
}

static msim_status assemble(ms_solver *s, const ms_request *r, int clamp) {
  double start = ms_clock();
  s->made_for = 0;
  ms_coefficients_compute(s->system.model, r->x, r->h, clamp, &s->system.a);
  ms_coefficients_hold(s->system.model, r->hold, r->nholds, &s->system.a);
  s->system.turning = (ms_turning){r->x, r->v, r->h};
  s->system.clamped = clamp;
  s->h = r->h;
  s->culprit = bad_coefficients(&s->system);
  s->stats->assemblies++;
  s->stats->assemble_s += ms_clock() - start;
  return s->culprit < 0 ? MSIM_OK : MSIM_NOT_FINITE;
}

static void expand(ms_solver *s, ms_linear *linear) {
  if (!linear->ops->expand) return;
  double start = ms_clock();
  linear->ops->expand(linear);
  s->stats->assemble_s += ms_clock() - start;
}

/* Record the linearization point of the present matrix. */
static void remember(const ms_solver *s, int32_t kind, ms_origin *origin) {
  const ms_rows *rows = &s->system.model->rows;
  const ms_coefficients *a = &s->system.a;
  const size_t bytes = (size_t)rows->dims * (size_t)rows->stride * sizeof(double);
  origin->h = s->h, origin->clamped = s->system.clamped, origin->kind = kind;
  if (origin->x) memcpy(origin->x, a->x, bytes);
  origin->nholds = a->nholds;
  for (int32_t i = 0; i < a->nholds; i++) origin->hold[i] = a->hold[i];
}

static msim_status factor(ms_solver *s, ms_linear *linear, int32_t kind, msim_error *err) {
  if (!linear->ops->factor) return MSIM_OK;
  expand(s, linear);
  double start = ms_clock();
  const int64_t made = linear->coarse_factors, kept = linear->kept_coarse_factors;
  msim_status status = linear->ops->factor(linear, kind, err);
  s->stats->factorizations += linear->factorises;
  s->stats->coarse_factors += linear->coarse_factors - made;
  s->stats->kept_factors += linear->kept_coarse_factors - kept;
  s->stats->factor_s += ms_clock() - start;
  if (linear->coarse_factors > made) remember(s, kind, &s->by_coarse);
  if (linear == s->kept.by) s->kept.age = 0, remember(s, kind, &s->by_kept);
  return status;
}

msim_status ms_solver_make(ms_solver *s, ms_linear *by, const ms_origin *origin, msim_error *err) {
  const ms_request request = {
      .x = origin->x, .h = origin->h, .hold = origin->hold, .nholds = origin->nholds};
  const msim_status status = assemble(s, &request, origin->clamped);
  if (status) return status;
  return factor(s, by, origin->kind, err);
}

/* Set *b to the right-hand side for the present matrix, and target.size to its norm. */
static msim_status form_right_hand_side(ms_solver *s, const ms_request *r, const double **b) {
  if (r->base) {
    ms_change_right_hand_side(&s->system, *b, r->base, s->b);
    *b = s->b;
    s->culprit = ms_find_bad(s->system.model->shape, s->b);
    if (s->culprit >= 0) return MSIM_NOT_FINITE;
  }
  s->target.size = ms_jacobi_norm(s->system.model, &s->system.a, *b);
  return MSIM_OK;
}

/* 1 if v is accurate enough, or accurate to rounding. left: ||b - A v||; NAN: to be computed. */
static int is_good(ms_solver *s, const double *b, const double *v, double left) {
  const ms_system *system = &s->system;
  const double size = s->target.size;
  if (isnan(left)) left = ms_true_residual(system, b, v, s->residual);
  s->reached = size > 0 ? left / size : left;
  return left <= s->target.rtol * size ||
         left <= ms_rounding_level(system, b, v, s->magnitude, s->correction);
}

/* With rtol >= 1e-4 a backend may solve in single precision (backend.h), which is for
 * preconditioners only. */
static ms_target target_of(const ms_solver *s) {
  const double FINE = 1e-5;
  ms_target target = s->target;
  if (s->linear->factorises) target.rtol = fmin(target.rtol, FINE);
  return target;
}

static void clear(const ms_solver *s, double *v) {
  const ms_shape shape = s->system.model->shape;
  memset(v, 0, (size_t)shape.dims * (size_t)shape.stride * sizeof *v);
}

/* Accept v, or refine it iteratively with the present factor. */
static msim_status check(ms_solver *s, const double *b, double *v, msim_error *err) {
  enum { REFINEMENTS = 3 };
  const ms_shape shape = s->system.model->shape;
  const ms_target target = target_of(s);
  double left = s->linear->met ? s->linear->residual : NAN;
  for (int round = 0; !is_good(s, b, v, left); round++) {
    s->culprit = isfinite(s->reached) ? ms_find_largest(shape, s->residual) : ms_find_bad(shape, v);
    if (!isfinite(s->reached))
      return ms_fail(err, MSIM_NOT_CONVERGED, "solver %s gave an answer that is not finite",
                     s->linear->name);
    if (round == REFINEMENTS || !s->linear->factorises)
      return ms_fail(
          err, MSIM_NOT_CONVERGED,
          "solver %s left a residual of %.3g of the right side; solver.rtol asks for %.3g",
          s->linear->name, s->reached, s->target.rtol);
    clear(s, s->correction);
    int64_t iterations = 0;
    msim_status status =
        s->linear->ops->solve(s->linear, &target, s->residual, s->correction, &iterations, err);
    if (status) return status;
    ms_axpy(shape, 1, s->correction, v);
    left = NAN;
    s->stats->refinements++;
  }
  return MSIM_OK;
}

static msim_status solve(ms_solver *s, const double *b, double *v, msim_error *err) {
  double start = ms_clock();
  clear(s, v);
  const ms_target target = target_of(s);
  msim_status status = s->linear->ops->solve(s->linear, &target, b, v, &s->stats->iterations, err);
  /* after max_iterations the residual may still be at rounding level */
  if ((status == MSIM_OK && !s->linear->exact) || status == MSIM_NOT_CONVERGED)
    status = check(s, b, v, err);
  s->stats->solve_s += ms_clock() - start;
  return status;
}

static msim_status factor_and_solve(ms_solver *s, int32_t kind, const double *b, double *v,
                                    msim_error *err) {
  msim_status status = factor(s, s->linear, kind, err);
  if (!status) status = solve(s, b, v, err);
  if (!status && kind == MSIM_FACTOR_SPD && s->kept.by == s->linear)
    ms_kept_renew(&s->kept, &s->system, 0);
  return status;
}

/*------------------------------------- lagged factors -------------------------------------------*/

static msim_status try_kept(ms_solver *s, const double *b, double *v) {
  if (!ms_kept_is_ready(&s->kept)) return MSIM_NOT_CONVERGED;
  const double start = ms_clock();
  int64_t iterations = 0;
  double left = NAN;
  clear(s, v);
  msim_status status = ms_kept_solve(&s->kept, &s->system, &s->target, b, v, &iterations, &left);
  if (!status && !is_good(s, b, v, left)) status = MSIM_NOT_CONVERGED;
  ms_kept_judge(&s->kept, !status, iterations);
  if (status && s->kept.by != s->linear) s->kept.age = 0; /* pcg has to amortize a new one */
  s->stats->kept_factors += !status;
  s->stats->iterations += iterations;
  s->stats->solve_s += ms_clock() - start;
  return status;
}

/* The mean cost of a solve by pcg, in iterations preconditioned by cholmod's factor. */
static double worth(const ms_savings *savings) {
  return savings->flops / (double)savings->steps / (MS_FLOPS_PER_FILL * savings->cholmod->fill);
}

msim_status ms_solver_add_cholmod(ms_solver *s, msim_error *err) {
  ms_linear **cholmod = &s->savings.cholmod;
  const msim_status status = ms_adapter_create(&s->system, "cholmod", s->opt, cholmod, err);
  if (status) return status;
  s->stats->analyses++;
  return keep_by(s, *cholmod, err);
}

/* Open cholmod beside pcg. Returns 0, and drops it for good, if it is not available, or its factor
 * is too large to store, or to apply FEW times for the cost of a solve by pcg. */
static int open_cholmod(ms_solver *s) {
  const double LARGEST_FILL = 1 << 26, FEW = 2; /* 0.8 GB, with a copy in single precision */
  ms_savings *savings = &s->savings;
  if (savings->cholmod) return 1;
  if (!ms_solver_add_cholmod(s, NULL)) {
    const double fill = savings->cholmod->fill;
    if (fill > 0 && fill <= LARGEST_FILL && worth(savings) >= FEW) return 1;
  }
  ms_solver_drop_kept(s);
  return 0;
}

/* Count the flops of a solve by pcg, and let cholmod compute a factor once they reach its cost.
 * changed: 1 if the matrix has changed, so that the count starts again. */
static void save(ms_solver *s, int64_t iterations, int changed) {
  enum { ENOUGH_TO_LOOK = 8 };
  ms_savings *savings = &s->savings;
  if (!savings->allowed) return;
  if (changed) savings->flops = 0, savings->steps = 0;
  savings->flops += (double)iterations * MS_FLOPS_PER_HALF * 2 * (double)s->system.model->springs.n;
  if (++savings->steps < ENOUGH_TO_LOOK || !open_cholmod(s)) return;
  if (savings->flops < savings->cholmod->flops) return;
  if (!factor(s, savings->cholmod, MSIM_FACTOR_SPD, NULL))
    ms_kept_renew(&s->kept, &s->system, worth(savings));
  savings->flops = 0, savings->steps = 0;
}

/*------------------------------------- one system -----------------------------------------------*/

static msim_status not_positive_definite(ms_solver *s, const ms_request *r, const double *b,
                                         double *v, msim_error *err) {
  msim_status status;
  s->stats->indefinite_steps++;
  switch (r->indefinite) {
    case MSIM_INDEFINITE_SOLVE:
      status = form_right_hand_side(s, r, &b);
      return status ? status : factor_and_solve(s, MSIM_FACTOR_SYMMETRIC, b, v, err);
    case MSIM_INDEFINITE_CLAMP:
      status = assemble(s, r, 1);
      if (!status) status = form_right_hand_side(s, r, &b);
      return status ? status : factor_and_solve(s, MSIM_FACTOR_SPD, b, v, err);
    default:
      s->culprit = ms_find_most_compressed(s->system.model, &s->system.a);
      return ms_fail(
          err, MSIM_NOT_SPD,
          "the matrix M - h D - h^2 J is not positive definite (h = %g s is too long for "
          "the compressed springs; indefinite = clamp goes on)",
          r->h);
  }
}

msim_status ms_solver_switch(ms_solver *s, msim_error *err) {
  ms_choice choice = {.reason = "auto: pcg did not converge"};
  s->may_switch = 0;
  msim_status status = ms_adapter_create(&s->system, "cholmod", s->opt, &choice.linear, err);
  if (status) return status;
  s->linear->ops->destroy(s->linear);
  ms_solver_drop_kept(s);
  s->stats->fallbacks++;
  s->made_for = 0;
  return take(s, &choice, err);
}

/* A does not depend on x: one factor serves all systems of this h. */
static msim_status solve_constant(ms_solver *s, const ms_request *r, const double *b, double *v,
                                  msim_error *err) {
  if (s->made_for != r->h) {
    msim_status status = assemble(s, r, r->clamp);
    if (!status) status = factor(s, s->linear, MSIM_FACTOR_SPD, err);
    if (status) return status;
    s->made_for = r->h;
  }
  const msim_status status = form_right_hand_side(s, r, &b);
  return status ? status : solve(s, b, v, err);
}

/* Prepare A without the damping derivative as a preconditioner, positive definite or not. */
static msim_status factor_symmetric_part(ms_solver *s, msim_error *err) {
  const ms_turning all = s->system.turning;
  const int may_be_definite = s->linear->factorises;
  s->system.turning.v = NULL;
  msim_status status =
      factor(s, s->linear, may_be_definite ? MSIM_FACTOR_SPD : MSIM_FACTOR_SYMMETRIC, err);
  if (status == MSIM_NOT_SPD && may_be_definite && s->linear->symmetric)
    status = factor(s, s->linear, MSIM_FACTOR_SYMMETRIC, err);
  s->system.turning = all;
  return status;
}

/* A with the damping derivative: by a linear solver for such matrices, elimination, or BiCGStab. */
static msim_status solve_unsymmetric(ms_solver *s, int direct, const double *b, double *v,
                                     msim_error *err) {
  if (s->linear->unsymmetric) return factor_and_solve(s, MSIM_FACTOR_UNSYMMETRIC, b, v, err);
  const int eliminates = direct && s->elimination.a;
  msim_status status = eliminates ? MSIM_OK : factor_symmetric_part(s, err);
  if (status) return status;
  const double start = ms_clock();
  int64_t *count = &s->stats->iterations;
  clear(s, v);
  if (eliminates) status = ms_elimination_solve(&s->elimination, &s->system, b, v);
  else status = ms_bicgstab_solve(&s->bicgstab, s->linear, &s->target, b, v, count);
  if (!status && !is_good(s, b, v, NAN)) status = MSIM_NOT_CONVERGED;
  s->stats->solve_s += ms_clock() - start;
  return status;
}

static msim_status solve_variable(ms_solver *s, const ms_request *r, const double *b, double *v,
                                  msim_error *err) {
  msim_status status = assemble(s, r, r->clamp);
  if (!status) status = form_right_hand_side(s, r, &b);
  if (status) return status;
  if (r->v) return solve_unsymmetric(s, r->direct, b, v, err);
  status = try_kept(s, b, v);
  if (!status || status == MSIM_NOT_SPD) return status;
  const int64_t before = s->stats->iterations, made = s->linear->coarse_factors;
  status = factor_and_solve(s, MSIM_FACTOR_SPD, b, v, err);
  if (!status) save(s, s->stats->iterations - before, s->linear->coarse_factors > made);
  return status;
}

static msim_status solve_once(ms_solver *s, const ms_request *r, const double *b, double *v,
                              msim_error *err) {
  msim_status status =
      s->system.a.block == 1 ? solve_constant(s, r, b, v, err) : solve_variable(s, r, b, v, err);
  if (status == MSIM_NOT_SPD && !r->clamp && r->indefinite >= 0)
    status = not_positive_definite(s, r, b, v, err);
  return status;
}

msim_status ms_solver_solve(ms_solver *solver, const ms_request *request, const double *b,
                            double *v, msim_error *err) {
  const ms_shape shape = solver->system.model->shape;
  solver->culprit = ms_find_bad(shape, b); /* -1: none */
  if (solver->culprit >= 0) return MSIM_NOT_FINITE;
  solver->target =
      (ms_target){.rtol = request->rtol, .max_iterations = solver->opt->solver_max_iterations};
  solver->stats->solves++;
  msim_status status = solve_once(solver, request, b, v, err);
  if (status == MSIM_NOT_CONVERGED && !request->v && solver->may_switch &&
      !ms_solver_switch(solver, NULL))
    status = solve_once(solver, request, b, v, err);
  if (status) return status;
  if (!solver->linear->exact)
    ms_balance_momentum(solver->system.model, &solver->system.a, &solver->components,
                        request->base ? solver->b : b, v);
  solver->culprit = ms_find_bad(shape, v);
  return solver->culprit < 0 ? MSIM_OK : MSIM_NOT_FINITE;
}

/*------------------------------------- descent directions ---------------------------------------*/

int ms_solver_takes_turning(const ms_solver *s) {
  return (s->linear->unsymmetric || s->bicgstab.roots) && s->system.a.block > 1 &&
         s->system.model->passes & MSIM_SKIP_DAMPING;
}

int ms_solver_descends(const ms_solver *s) {
  return s->linear->ops->descend != NULL && s->system.a.block > 1;
}

msim_status ms_solver_descend(ms_solver *s, const ms_request *r, const double *b, double *v,
                              msim_error *err) {
  const ms_shape shape = s->system.model->shape;
  s->culprit = ms_find_bad(shape, b);
  if (s->culprit >= 0) return MSIM_NOT_FINITE;
  s->stats->solves++;
  msim_status status = assemble(s, r, r->clamp);
  if (!status) status = factor(s, s->linear, MSIM_FACTOR_SYMMETRIC, err);
  if (status) return status;
  const double start = ms_clock();
  const ms_descent d = {r->rtol, s->opt->solver_max_iterations};
  s->linear->ops->descend(s->linear, &d, b, v, &s->stats->iterations);
  s->stats->solve_s += ms_clock() - start;
  s->culprit = ms_find_bad(shape, v);
  return s->culprit < 0 ? MSIM_OK : MSIM_NOT_FINITE;
}
