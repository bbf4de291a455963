#include "linear/solver.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "linear/solver_choice.h"
#include "linear/jacobi.h"
#include "linear/refinement.h"
#include "linear/residual.h"
#include "physics/offender.h"
#include "physics/rank_model.h"
#include "scene/options.h"

/*------------------------------------- creation and destruction ---------------------------------*/

static int may_lag_factor(const ms_solver *s) {
  return ms_solver_choice_is_auto(s->opt) && s->system.a.block > 1 &&
         !(s->opt->skip_off & MSIM_SKIP_KEPT_FACTOR);
}

int ms_solver_may_have_constraints(const ms_solver *s) {
  return ms_scene_constrains(s->system.model->scene, s->opt->collision);
}

/* Memory for a point, unless the matrix is constant. */
static msim_status create_linearization_point(ms_solver *s, ms_linearization_point *point,
                                              msim_error *err) {
  const ms_model *model = s->system.model;
  if (s->system.a.block == 1 || point->x) return MSIM_OK;
  if (MS_NEW_VECTORS(model->scene, &model->unknowns, &point->x) &&
      (!ms_solver_may_have_constraints(s) ||
       MS_NEW(&model->scene->alloc, point->constraint, model->unknowns.nfree)))
    return MSIM_OK;
  return ms_error_set_memory(err, "the linear solver");
}

static void destroy_linearization_point(const ms_solver *s, ms_linearization_point *point) {
  MS_FREE(&s->system.model->scene->alloc, point->x, point->constraint);
  *point = (ms_linearization_point){0};
}

static msim_status start_lagging(ms_solver *s, ms_linear *by, msim_error *err) {
  const msim_status status = create_linearization_point(s, &s->lagged_point, err);
  return status ? status : ms_lagged_factor_create(&s->system, by, &s->lagged_factor, err);
}

/* Take the work vectors of the linear solver, which idles while they are used, or new ones; on
 * failure they stay as they are. */
static msim_status create_work_vectors(ms_solver *s, const ms_linear *linear, msim_error *err) {
  const ms_model *model = s->system.model;
  double *work[3] = {linear->work[0], linear->work[1], linear->work[2]};
  if (!work[0] && !MS_NEW_VECTORS(model->scene, &model->unknowns, &work[0], &work[1], &work[2])) {
    MS_FREE(&model->scene->alloc, work[0], work[1], work[2]);
    return ms_error_set_memory(err, "the linear solver");
  }
  s->residual = work[0], s->correction = work[1], s->magnitude = work[2];
  return MSIM_OK;
}

static void destroy_work_vectors(const ms_solver *s) {
  if (s->linear && !s->linear->work[0])
    MS_FREE(&s->system.model->scene->alloc, s->residual, s->correction, s->magnitude);
}

static msim_status take_choice(ms_solver *s, const ms_solver_choice *choice, msim_error *err) {
  s->linear = choice->linear;
  s->stats->analyses += s->linear->analyses;
  snprintf(s->reason, sizeof s->reason, "%s", choice->reason);
  s->amortization.allowed = may_lag_factor(s) && s->linear->aggregates > 0;
  msim_status status = MSIM_OK;
  if (s->linear->aggregates && !(s->opt->skip_off & MSIM_SKIP_KEPT_FACTOR))
    status = create_linearization_point(s, &s->coarse_point, err);
  const int lags = may_lag_factor(s) && s->linear->factorizes && s->linear->fill > 0;
  return status || !lags ? status : start_lagging(s, s->linear, err);
}

void ms_solver_drop_lagged_factor(ms_solver *s) {
  if (s->amortization.cholmod) s->amortization.cholmod->ops->destroy(s->amortization.cholmod);
  ms_lagged_factor_destroy(&s->lagged_factor);
  destroy_linearization_point(s, &s->lagged_point);
  s->amortization = (ms_amortization){0};
}

static msim_status solver_set_up(ms_solver *s, double h, msim_error *err) {
  const ms_model *model = s->system.model;
  msim_status status = ms_coefficients_create(model, &s->system.a, err);
  if (!status) status = ms_momentum_create_components(model, &s->components, err);
  if (status) return status;
  if (!MS_NEW_VECTORS(model->scene, &model->unknowns, &s->b))
    return ms_error_set_memory(err, "the linear solver");
  ms_solver_choice choice;
  status = ms_solver_choice_make(&s->system, s->opt, h, &choice, err);
  s->linear = choice.linear;
  if (!status) status = create_work_vectors(s, s->linear, err);
  if (status) return status;
  s->may_switch = strcmp(s->opt->solver, "auto") == 0 && strcmp(s->linear->name, "pcg") == 0;
  return take_choice(s, &choice, err);
}

msim_status ms_solver_create_unsymmetric(ms_solver *s, msim_error *err) {
  const ms_model *model = s->system.model;
  if (!ms_solver_choice_depends_on_springs(s->opt) || s->linear->exact || s->linear->unsymmetric)
    return MSIM_OK;
  if (s->system.a.block == 1 || !(model->features & MS_HAS_DAMPING)) return MSIM_OK;
  const msim_status status = ms_elimination_create(model, &s->elimination, err);
  return status ? status : ms_bicgstab_create(model, &s->bicgstab, err);
}

msim_status ms_solver_create(const ms_model *model, const msim_options *opt, double h,
                             msim_stats *stats, ms_solver **solver, msim_error *err) {
  ms_solver *s = ms_memory_allocate(&model->scene->alloc, 1, sizeof *s);
  *solver = NULL;
  if (!s) return ms_error_set_memory(err, "the linear solver");
  s->system.model = model;
  s->opt = opt;
  s->stats = stats;
  s->creation_h = h;
  const msim_status status = solver_set_up(s, h, err);
  if (status) ms_solver_destroy(s);
  else *solver = s;
  return status;
}

void ms_solver_destroy(ms_solver *s) {
  if (!s) return;
  const ms_model *model = s->system.model;
  destroy_work_vectors(s);
  if (s->linear) s->linear->ops->destroy(s->linear);
  ms_solver_drop_lagged_factor(s);
  destroy_linearization_point(s, &s->coarse_point);
  ms_coefficients_destroy(model, &s->system.a);
  ms_momentum_destroy_components(model, &s->components);
  ms_elimination_destroy(model, &s->elimination);
  ms_bicgstab_destroy(model, &s->bicgstab);
  MS_FREE(&model->scene->alloc, s->b, s);
}

void ms_solver_discard_factors(ms_solver *s) {
  ms_lagged_factor_discard(&s->lagged_factor);
  s->amortization.flops = 0, s->amortization.solves = 0;
  if (s->linear->ops->restart) s->linear->ops->restart(s->linear);
}

void ms_solver_update_springs(ms_solver *s) {
  ms_solver_discard_factors(s);
  s->constant_h = 0;
}

/*------------------------------------- one solve ------------------------------------------------*/

/* MSIM_NOT_FINITE, on all ranks, if a number of x is not finite on one of them */
static msim_status check_finite(ms_solver *s, ms_shape shape, const double *x) {
  s->offender = ms_vector_find_invalid(shape, x);
  return ms_ranks_agree(s->system.model->shape.ranks, s->offender < 0 ? MSIM_OK : MSIM_NOT_FINITE,
                        NULL);
}

/* 1: only the constraints differ from those of the last matrix. */
static int continues_last_solve(const ms_solver *s, const ms_linear_system_spec *r) {
  return r->continues && s->system.a.x && r->h == s->h &&
         ms_vector_is_equal(s->system.model->shape, r->x, s->system.a.x);
}

static msim_status solver_assemble(ms_solver *s, const ms_linear_system_spec *r, int clamp) {
  double start = ms_clock_now();
  const ms_unknowns *rows = &s->system.model->unknowns;
  const ms_shape blocks = {
      .n = rows->nfree, .stride = rows->first_pinned, .dims = s->system.a.block};
  s->constant_h = 0;
  s->system.continues = continues_last_solve(s, r) && clamp == s->system.clamped;
  ms_coefficients_compute(s->system.model, r->x, r->h, clamp, &s->system.a);
  ms_coefficients_add_constraints(s->system.model, r->constraint, r->nconstraints, &s->system.a);
  s->system.damping_derivative = (ms_damping_derivative){r->x, r->v, r->h};
  s->system.clamped = clamp;
  s->h = r->h;
  const msim_status status = check_finite(s, blocks, s->system.a.diagonal);
  s->stats->assemblies++;
  s->stats->assemble_s += ms_clock_now() - start;
  return status;
}

/* Record the linearization point of the present matrix; if no factor is kept, it has no memory. */
static void record_linearization_point(const ms_solver *s, int32_t kind,
                                       ms_linearization_point *origin) {
  const ms_coefficients *a = &s->system.a;
  origin->h = s->h, origin->clamped = s->system.clamped, origin->kind = kind;
  if (origin->x) ms_vector_copy_all(s->system.model->shape, a->x, origin->x);
  origin->nconstraints = origin->constraint ? a->nconstraints : 0;
  for (int32_t i = 0; i < origin->nconstraints; i++) origin->constraint[i] = a->constraint[i];
}

static msim_status solver_factor(ms_solver *s, ms_linear *linear, int32_t kind, msim_error *err) {
  if (!linear->ops->factor) return MSIM_OK;
  const double begin = ms_clock_now();
  if (linear->ops->expand) linear->ops->expand(linear);
  const double start = ms_clock_now();
  s->stats->assemble_s += start - begin;
  const int64_t made = linear->coarse_factors, kept = linear->reused_coarse_factors;
  msim_status status = linear->ops->factor(linear, kind, err);
  s->stats->factorizations += linear->factorizes;
  s->stats->coarse_factors += linear->coarse_factors - made;
  s->stats->kept_factors += linear->reused_coarse_factors - kept;
  s->stats->factor_s += ms_clock_now() - start;
  if (linear->coarse_factors > made) record_linearization_point(s, kind, &s->coarse_point);
  if (linear == s->lagged_factor.factorizer)
    s->lagged_factor.age = 0, record_linearization_point(s, kind, &s->lagged_point);
  return status;
}

msim_status ms_solver_factor_at(ms_solver *s, ms_linear *by, const ms_linearization_point *origin,
                                msim_error *err) {
  const ms_linear_system_spec spec = {.x = origin->x,
                                      .h = origin->h,
                                      .constraint = origin->constraint,
                                      .nconstraints = origin->nconstraints};
  const msim_status status = solver_assemble(s, &spec, origin->clamped);
  return status ? status : solver_factor(s, by, origin->kind, err);
}

/* Set *b to the right-hand side for the present matrix, and target.size to its norm. */
static msim_status form_right_hand_side(ms_solver *s, const ms_linear_system_spec *r,
                                        const double **b) {
  s->target.rtol = r->rtol;
  if (r->base) {
    ms_residual_compute_change_rhs(&s->system, *b, r->base, s->b);
    *b = s->b;
    const msim_status status = check_finite(s, s->system.model->shape, s->b);
    if (status) return status;
  }
  s->target.size = ms_jacobi_norm(s->system.model, &s->system.a, *b);
  if (r->guess)
    *b = ms_residual_subtract_guess(&s->system, *b, r->guess, &s->target, s->magnitude, s->b);
  return MSIM_OK;
}

static msim_status factor_and_solve(ms_solver *s, int32_t kind, const double *b, double *v,
                                    msim_error *err) {
  msim_status status = solver_factor(s, s->linear, kind, err);
  if (!status) status = ms_refinement_solve(s, b, v, err);
  if (!status && kind == MSIM_FACTOR_SPD && s->lagged_factor.factorizer == s->linear)
    ms_lagged_factor_renew(&s->lagged_factor, 0);
  return status;
}

/*------------------------------------- lagged factors -------------------------------------------*/

static msim_status try_lagged_factor(ms_solver *s, const double *b, double *v) {
  if (!ms_lagged_factor_begin_solve(&s->lagged_factor)) return MSIM_NOT_CONVERGED;
  const double start = ms_clock_now();
  int64_t iterations = 0;
  double residual_norm = NAN;
  ms_vector_clear_all(s->system.model->shape, v);
  msim_status status =
      ms_lagged_factor_solve(&s->lagged_factor, &s->target, b, v, &iterations, &residual_norm);
  if (!status && !ms_refinement_is_accurate(s, b, v, residual_norm)) status = MSIM_NOT_CONVERGED;
  ms_lagged_factor_record(&s->lagged_factor, !status, iterations);
  if (status && s->lagged_factor.factorizer != s->linear)
    s->lagged_factor.age = 0; /* pcg has to amortize a new one */
  s->stats->kept_factors += !status;
  s->stats->iterations += iterations;
  s->stats->solve_s += ms_clock_now() - start;
  return status;
}

/* The mean cost of a solve by pcg, in iterations preconditioned by cholmod's factor. */
static double pcg_cost_in_iterations(const ms_amortization *amortization) {
  return amortization->flops / (double)amortization->solves /
         (MS_SOLVE_FLOPS_PER_NONZERO * amortization->cholmod->fill);
}

msim_status ms_solver_add_cholmod(ms_solver *s, msim_error *err) {
  ms_linear **cholmod = &s->amortization.cholmod;
  const msim_status status = ms_adapter_create(&s->system, "cholmod", s->opt, cholmod, err);
  if (status) return status;
  s->stats->analyses++;
  return start_lagging(s, *cholmod, err);
}

/* Open cholmod beside pcg. Returns 0, and drops it for good, if it is not available, or its factor
 * is too large to store, or to apply FEW times for the cost of a solve by pcg. */
static int open_cholmod(ms_solver *s) {
  const double LARGEST_FILL = 1 << 26, FEW = 2; /* 0.8 GB, with a copy in single precision */
  ms_amortization *amortization = &s->amortization;
  if (amortization->cholmod) return 1;
  if (!ms_solver_add_cholmod(s, NULL)) {
    const double fill = amortization->cholmod->fill;
    if (fill > 0 && fill <= LARGEST_FILL && pcg_cost_in_iterations(amortization) >= FEW) return 1;
  }
  ms_solver_drop_lagged_factor(s);
  return 0;
}

/* Count the flops of a solve by pcg, and let cholmod compute a factor once they reach its cost.
 * changed: 1 if the matrix has changed, so that the count starts again. */
static void amortize_factor(ms_solver *s, int64_t iterations, int changed) {
  enum { ENOUGH_TO_LOOK = 8 };
  ms_amortization *amortization = &s->amortization;
  if (!amortization->allowed) return;
  if (changed) amortization->flops = 0, amortization->solves = 0;
  amortization->flops += (double)iterations * ms_lagged_factor_iteration_flops(s->system.model);
  if (++amortization->solves < ENOUGH_TO_LOOK || !open_cholmod(s)) return;
  if (amortization->flops < amortization->cholmod->flops) return;
  if (!solver_factor(s, amortization->cholmod, MSIM_FACTOR_SPD, NULL))
    ms_lagged_factor_renew(&s->lagged_factor, pcg_cost_in_iterations(amortization));
  amortization->flops = 0, amortization->solves = 0;
}

/*------------------------------------- one system -----------------------------------------------*/

static msim_status handle_indefinite(ms_solver *s, const ms_linear_system_spec *r, const double *b,
                                     double *v, msim_error *err) {
  const int clamps = r->indefinite == MSIM_INDEFINITE_CLAMP;
  s->stats->indefinite_steps++;
  if (!clamps && r->indefinite != MSIM_INDEFINITE_SOLVE) {
    s->offender = ms_offender_find_compressed(s->system.model, &s->system.a);
    return ms_error_set(err, MSIM_NOT_SPD,
                        "the matrix M - h D - h^2 J is not positive definite: h = %g s is too "
                        "long for the compressed springs; use a shorter h, or indefinite = clamp",
                        r->h);
  }
  msim_status status = clamps ? solver_assemble(s, r, 1) : MSIM_OK;
  if (!status) status = form_right_hand_side(s, r, &b);
  const int32_t kind = clamps ? MSIM_FACTOR_SPD : MSIM_FACTOR_SYMMETRIC;
  return status ? status : factor_and_solve(s, kind, b, v, err);
}

msim_status ms_solver_switch_to_cholmod(ms_solver *s, msim_error *err) {
  ms_solver_choice choice = {.reason = "auto: replaced pcg, which did not converge"};
  s->may_switch = 0;
  msim_status status = ms_adapter_create(&s->system, "cholmod", s->opt, &choice.linear, err);
  if (status) return status;
  status = create_work_vectors(s, choice.linear, err);
  if (status) {
    choice.linear->ops->destroy(choice.linear);
    return status;
  }
  s->linear->ops->destroy(s->linear);
  ms_solver_drop_lagged_factor(s);
  s->stats->fallbacks++;
  s->constant_h = 0;
  return take_choice(s, &choice, err);
}

/* A does not depend on x: one factor serves all systems of this h. */
static msim_status solve_constant(ms_solver *s, const ms_linear_system_spec *r, const double *b,
                                  double *v, msim_error *err) {
  if (s->constant_h != r->h) {
    msim_status status = solver_assemble(s, r, r->clamp);
    if (!status) status = solver_factor(s, s->linear, MSIM_FACTOR_SPD, err);
    if (status) return status;
    s->constant_h = r->h;
  }
  const msim_status status = form_right_hand_side(s, r, &b);
  return status ? status : ms_refinement_solve(s, b, v, err);
}

/* Prepare A without the damping derivative as a preconditioner, positive definite or not. */
static msim_status factor_symmetric_part(ms_solver *s, msim_error *err) {
  const ms_damping_derivative all = s->system.damping_derivative;
  const int may_be_definite = s->linear->factorizes;
  s->system.damping_derivative.v = NULL;
  msim_status status =
      solver_factor(s, s->linear, may_be_definite ? MSIM_FACTOR_SPD : MSIM_FACTOR_SYMMETRIC, err);
  if (status == MSIM_NOT_SPD && may_be_definite && s->linear->symmetric)
    status = solver_factor(s, s->linear, MSIM_FACTOR_SYMMETRIC, err);
  s->system.damping_derivative = all;
  return status;
}

/* A with the damping derivative: by a linear solver for such matrices, elimination, or BiCGStab. */
static msim_status solve_unsymmetric(ms_solver *s, int direct, const double *b, double *v,
                                     msim_error *err) {
  if (s->linear->unsymmetric) return factor_and_solve(s, MSIM_FACTOR_UNSYMMETRIC, b, v, err);
  const int eliminates = direct && s->elimination.a;
  msim_status status = eliminates ? MSIM_OK : factor_symmetric_part(s, err);
  if (status) return status;
  const double start = ms_clock_now();
  int64_t *count = &s->stats->iterations;
  ms_vector_clear_all(s->system.model->shape, v);
  if (eliminates) status = ms_elimination_solve(&s->elimination, &s->system, b, v);
  else status = ms_bicgstab_solve(&s->bicgstab, s->linear, &s->target, b, v, count);
  if (!status && !ms_refinement_is_accurate(s, b, v, NAN)) status = MSIM_NOT_CONVERGED;
  s->stats->solve_s += ms_clock_now() - start;
  return status;
}

/* Conjugate gradients may miss that A is hardly definite, or not: they find far too large a v. */
static int is_nearly_singular(const ms_solver *s, const double *b, const double *v) {
  return !s->linear->factorizes && ms_residual_compute_curvature(&s->system, b, v) < 0.01;
}

static msim_status solve_variable(ms_solver *s, const ms_linear_system_spec *r, const double *b,
                                  double *v, msim_error *err) {
  const int clamp = r->clamp || (s->system.clamped && continues_last_solve(s, r));
  msim_status status = solver_assemble(s, r, clamp);
  if (!status) status = form_right_hand_side(s, r, &b);
  if (status) return status;
  if (r->v) return solve_unsymmetric(s, r->use_elimination, b, v, err);
  status = try_lagged_factor(s, b, v);
  if (!status || status == MSIM_NOT_SPD) return status;
  const int64_t before = s->stats->iterations, made = s->linear->coarse_factors;
  status = factor_and_solve(s, MSIM_FACTOR_SPD, b, v, err);
  if (!status) amortize_factor(s, s->stats->iterations - before, s->linear->coarse_factors > made);
  const int may_clamp = !status && !clamp && r->indefinite == MSIM_INDEFINITE_CLAMP;
  return may_clamp && is_nearly_singular(s, b, v) ? MSIM_NOT_SPD : status;
}

static msim_status solve_once(ms_solver *s, const ms_linear_system_spec *r, const double *b,
                              double *v, msim_error *err) {
  msim_status status =
      s->system.a.block == 1 ? solve_constant(s, r, b, v, err) : solve_variable(s, r, b, v, err);
  if (status == MSIM_NOT_SPD && !r->clamp && r->indefinite >= 0)
    status = handle_indefinite(s, r, b, v, err);
  return status;
}

static msim_status begin_solve(ms_solver *s, const ms_linear_system_spec *r, const double *b) {
  const int32_t most = r->max_iterations, usual = s->opt->solver_max_iterations;
  s->target = (ms_linear_target){.rtol = r->rtol, .max_iterations = most ? most : usual};
  return check_finite(s, s->system.model->shape, b);
}

/* b: the right-hand side of the system that was solved */
static msim_status end_solve(ms_solver *s, const ms_linear_system_spec *r, const double *b,
                             double *v) {
  const ms_shape shape = s->system.model->shape;
  if (!s->linear->exact) ms_momentum_balance(s->system.model, &s->system.a, &s->components, b, v);
  if (r->guess) ms_vector_axpy(shape, 1, r->guess, v);
  return check_finite(s, shape, v);
}

msim_status ms_solver_solve(ms_solver *solver, const ms_linear_system_spec *spec, const double *b,
                            double *v, msim_error *err) {
  msim_status status = begin_solve(solver, spec, b);
  if (status) return status;
  solver->stats->solves++;
  status = solve_once(solver, spec, b, v, err);
  const int at_limit = status == MSIM_NOT_CONVERGED && !spec->v;
  solver->incomplete =
      at_limit && !solver->linear->factorizes && ms_options_accept_incomplete(solver->opt);
  if (at_limit && !solver->incomplete && solver->may_switch &&
      !ms_solver_switch_to_cholmod(solver, NULL))
    status = solve_once(solver, spec, b, v, err);
  if (status && !solver->incomplete) return status;
  return end_solve(solver, spec, spec->base || spec->guess ? solver->b : b, v);
}

msim_status ms_solver_solve_again(ms_solver *s, double rtol, const double *b, double *v,
                                  msim_error *err) {
  const ms_linear_system_spec spec = {.rtol = rtol};
  msim_status status = begin_solve(s, &spec, b);
  if (status) return status;
  s->stats->solves++;
  status = form_right_hand_side(s, &spec, &b);
  if (!status) status = ms_refinement_solve(s, b, v, err);
  return status ? status : end_solve(s, &spec, b, v);
}

msim_status ms_solver_solve_several(ms_solver *s, double rtol, int32_t n, double *const *b,
                                    double *const *v, double *room, msim_error *err) {
  const int substitutes = s->linear->substitutes;
  msim_status status =
      substitutes ? s->linear->ops->substitute(s->linear, n, b, v, room, err) : MSIM_OK;
  for (int32_t i = 0; i < n && !status; i++) {
    if (substitutes) status = check_finite(s, s->system.model->shape, v[i]);
    else status = ms_solver_solve_again(s, rtol, b[i], v[i], err);
  }
  if (substitutes) s->stats->solves += n;
  return status;
}

/*------------------------------------- descent directions ---------------------------------------*/

int ms_solver_supports_damping_derivative(const ms_solver *s) {
  return (s->linear->unsymmetric || s->bicgstab.roots) && s->system.a.block > 1 &&
         s->system.model->features & MS_HAS_DAMPING;
}

int ms_solver_can_descend(const ms_solver *s) {
  return s->linear->ops->descend != NULL && s->system.a.block > 1;
}

msim_status ms_solver_descend(ms_solver *s, const ms_linear_system_spec *r, const double *b,
                              double *v, msim_error *err) {
  const ms_shape shape = s->system.model->shape;
  msim_status status = check_finite(s, shape, b);
  s->incomplete = 0;
  if (status) return status;
  s->stats->solves++;
  status = solver_assemble(s, r, r->clamp);
  if (!status) status = solver_factor(s, s->linear, MSIM_FACTOR_SYMMETRIC, err);
  if (status) return status;
  const double start = ms_clock_now();
  const ms_descent_target d = {r->rtol, s->opt->solver_max_iterations};
  s->linear->ops->descend(s->linear, &d, b, v, &s->stats->iterations);
  s->stats->solve_s += ms_clock_now() - start;
  return check_finite(s, shape, v);
}
