#include "integrate/newton.h"

#include <float.h>
#include <math.h>

#include "integrate/damper_strength.h"
#include "linear/jacobi.h"
#include "physics/external_force.h"
#include "physics/nonlinearity.h"
#include "physics/rank_model.h"
#include "scene/options.h"

/* The matrix of d, and the line search */
typedef enum search {
  REDUCE_POTENTIAL, /* symmetric matrix: the incremental potential, or, without one, its slope */
  REDUCE_RESIDUAL,  /* full matrix, with the non-symmetric damping term: the residual */
  LIMIT_ROTATION    /* the same, not clamped: no spring turns much */
} search;

/* b = R, and rho = M^-1 R, the residual in units of velocity. Norms are those of M. The trust
 * radius and the length of d, for solvers without descend(), are in the norm of the matrix. */
typedef struct newton {
  ms_stepper *s;
  const ms_newton_stage *stage;
  ms_shape shape;
  int32_t count; /* iterations made */
  int linear;    /* the matrix is constant */
  double *rho, *b, *d, *from;
  double residual, failed;            /* ||rho||; after the last of `failures` */
  double eta;                         /* relative residual of the last linear solve */
  double radius;                      /* trust radius: the largest length of d */
  double length, predicted_reduction; /* of d: its length, and the predicted reduction of E */
  int is_truncated, is_clamped;       /* d was truncated at the radius; its matrix was clamped */
  search search;                      /* of this d; between iterations, that to try next */
  ms_damper_strength dampers;         /* in this stage */
  int is_stuck; /* REDUCE_RESIDUAL did not reduce the residual, or by less than a tenth */
  int failures; /* solves and searches with the full matrix that failed */
  double moved; /* ||lambda d|| of the last iteration */
  double correction, previous; /* ||d|| of this iteration and of the last; 0: none, or shortened */
} newton;

static double newton_norm(const newton *n, const double *v) {
  ms_vector_scale_rows(n->shape, n->s->model->mass, v, n->s->scratch);
  return sqrt(ms_vector_dot(n->shape, v, n->s->scratch));
}

/* x, rho and b at the v of the stage. The large weights of contacts would keep any residual in the
 * directions that they constrain, and each solve would end when it has solved for this alone. */
static void evaluate_residual(newton *n) {
  const ms_newton_stage *g = n->stage;
  ms_vector_add_scaled(n->shape, g->x0, g->ah, g->v, g->x);
  ms_stepper_acceleration(n->s, g->x, g->v, n->rho);
  ms_vector_add_scaled(n->shape, g->w, g->ah, n->rho, n->rho);
  ms_vector_axpy(n->shape, -1, g->v, n->rho);
  ms_stepper_remove_constrained(n->s, n->rho);
  ms_vector_scale_rows(n->shape, n->s->model->mass, n->rho, n->b);
  n->residual = sqrt(ms_vector_dot(n->shape, n->b, n->rho));
}

/* The change of v to which errors are relative: from the present state, or that by external forces
 * alone, if larger, as forces may be nearly balanced. A common velocity has no effect on it. */
static double velocity_change(const newton *n) {
  const ms_model *model = n->s->model;
  const double *m = model->mass;
  double sum[2] = {0}; /* of m and |F|^2/m, of constant forces F */
  for (int32_t row = 0; row < n->shape.n; row++) sum[0] += m[row];
  for (int32_t row = 0; row < n->shape.n && model->force; row++) {
    const double a = ms_model_force_acceleration(model, row);
    sum[1] += m[row] * a * a;
  }
  ms_ranks_sum(n->shape.ranks, 2, sum);
  ms_vector_add_scaled(n->shape, n->stage->v, -1, n->s->v, n->from);
  return fmax(
      newton_norm(n, n->from),
      n->stage->ah * (sqrt(sum[0]) * ms_external_acceleration(&model->external) + sqrt(sum[1])));
}

/* The error of v allowed. Error control may require less than newton.rtol, relative to v itself. */
static double velocity_tolerance(const newton *n) {
  const double size = velocity_change(n), asked = n->s->opt->newton_rtol * size;
  if (!(n->s->solve_tolerance > 0)) return asked;
  return fmin(asked, n->s->solve_tolerance * fmax(size, newton_norm(n, n->stage->v)));
}

static msim_status solve_newton_system(newton *n, const ms_linear_system_spec *spec,
                                       msim_error *err) {
  return ms_solver_solve(n->s->solver, spec, n->b, n->d, err);
}

/* d = A^-1 R, truncated at the trust radius; A is clamped if it is not positive definite. */
static msim_status solve_within(newton *n, ms_linear_system_spec *spec, msim_error *err) {
  msim_status status = solve_newton_system(n, spec, err);
  if (status == MSIM_NOT_SPD && !spec->clamp) {
    spec->clamp = 1;
    status = solve_newton_system(n, spec, err);
  }
  if (status) return status;
  const double drop = ms_vector_dot(n->shape, n->b, n->d), part = n->radius / sqrt(drop);
  if (n->s->solver->incomplete && !(drop > 0)) return MSIM_NOT_CONVERGED; /* no descent */
  n->is_truncated = part < 1;
  if (n->is_truncated) ms_vector_scale(n->shape, part, n->d);
  n->length = fmin(sqrt(drop), n->radius);
  n->predicted_reduction = n->is_truncated ? part * (1 - part / 2) * drop : drop / 2;
  return MSIM_OK;
}

/* d = A^-1 R with the full matrix: a descent direction of the residual norm, not of the energy */
static msim_status solve_full(newton *n, ms_linear_system_spec *spec, msim_error *err) {
  spec->v = n->stage->v;
  const msim_status status = solve_newton_system(n, spec, err);
  spec->v = NULL;
  n->is_truncated = 0;
  if (status) n->failures++, n->failed = n->residual;
  return status;
}

/* d of the exact full matrix, by elimination if possible, to a relative residual that keeps the
 * convergence quadratic although terms along strong dampers are 1e6 times those across. The line
 * search REDUCE_RESIDUAL uses BiCGStab: it fails if the matrix is nearly singular, and the
 * symmetric matrix follows (damping 10, h 0.1: 13 iterations a step; 41 by elimination). */
static msim_status solve_exact_full(newton *n, ms_linear_system_spec *spec, msim_error *err) {
  const double FINE = 1e-3;
  spec->clamp = 0, spec->use_elimination = 1;
  spec->rtol = fmin(n->eta, FINE);
  const msim_status status = solve_full(n, spec, err);
  if (!status) n->eta = spec->rtol;
  return status;
}

/* After three failures in a stage the full matrix is tried again at a tenth of the residual: it
 * converges quadratically near the solution, the symmetric one linearly. */
static int may_use_full(const newton *n) {
  return n->dampers && (n->failures < 3 || n->residual < 0.1 * n->failed);
}

/* 1: the exact full matrix is next. BiCGStab takes up to 10 times as long as conjugate gradients,
 * so that these try to find the solution first. */
static int may_solve_exactly(const newton *n) {
  enum { PATIENCE = 15 };
  const ms_solver *solver = n->s->solver;
  const int must_wait = n->count < PATIENCE && ms_solver_needs_bicgstab(solver);
  return n->dampers == MS_DAMPERS_DOMINANT && may_use_full(n) && !must_wait &&
         ms_solver_supports_damping_derivative(solver) &&
         n->s->opt->jacobian != MSIM_JACOBIAN_CLAMP;
}

/* d to the relative residual eta, by the first of these that is allowed and does not fail: the
 * exact full matrix, the full matrix, the symmetric one. Sets n->search. */
static msim_status find_direction(newton *n, int clamp, msim_error *err) {
  ms_solver *solver = n->s->solver;
  ms_linear_system_spec spec = {
      .x = n->stage->x, .h = n->stage->ah, .clamp = clamp, .indefinite = -1, .rtol = n->eta};
  ms_stepper_add_constraints(n->s, &spec);
  ms_stepper_linearize(n->s, n->stage->x, n->stage->v);
  const int descends = ms_solver_can_descend(solver);
  const int whole = n->search != REDUCE_POTENTIAL || (!clamp && !descends);
  n->search = LIMIT_ROTATION, n->is_clamped = clamp;
  if (may_solve_exactly(n) && !solve_exact_full(n, &spec, err)) return MSIM_OK;
  spec.clamp = clamp, spec.use_elimination = 0, spec.rtol = n->eta;
  n->search = REDUCE_RESIDUAL;
  if (whole && ms_solver_supports_damping_derivative(solver)) {
    spec.clamp = n->s->opt->jacobian == MSIM_JACOBIAN_CLAMP;
    if (!solve_full(n, &spec, err)) return MSIM_OK;
    spec.clamp = clamp;
  }
  n->search = REDUCE_POTENTIAL;
  if (!descends) return solve_within(n, &spec, err);
  return ms_solver_descend(solver, &spec, n->b, n->d, err);
}

/* Updates the trust radius by the ratio of the reduction of E to the predicted one. */
static void update_trust_radius(newton *n, double lambda, double reduced) {
  if (ms_solver_can_descend(n->s->solver)) return;
  const double ratio = reduced / n->predicted_reduction;
  if (lambda < 1) n->radius = lambda * n->length;
  else if (ratio < 0.25) n->radius = 0.5 * n->length;
  else if (ratio > 0.75 && n->is_truncated) n->radius = fmax(n->radius, 2 * n->length);
}

/* E(v) - E(v + lambda d), E = |v - w|_M^2/2 + U(x0 + ah v) + ah b |v|^2/2, the incremental
 * potential with drag b, whose gradient is -R. slope: R.d; square: |d|_M^2 + ah b |d|^2 */
static double reduction(const newton *n, double lambda, double slope, double square) {
  const ms_newton_stage *g = n->stage;
  return lambda * (slope - lambda * square / 2) -
         ms_nonlinearity_compute(n->s->model, g->x, g->ah, n->d, lambda, n->s->scratch);
}

/* E(v) - E(v + at d) */
typedef struct sample {
  double at, reduced;
} sample;

/* The maximum, at most `limit`, of s l - c l^2/2 - q l^4 through both samples, s the slope: a
 * rotation by l stretches a spring by l^2. q = 0 if the fit would have q < 0. With one sample
 * (b.at = 0) q = 0, or c = 0 if E rises. */
static double maximize_quartic(double slope, sample a, sample b, double limit) {
  const double of_a = (slope * a.at - a.reduced) / (a.at * a.at); /* c/2 + q at^2 */
  const double of_b = (slope * b.at - b.reduced) / (b.at * b.at);
  double q = a.reduced < 0 ? of_a / (a.at * a.at) : 0, low = 0, high = limit;
  if (b.at > 0) q = fmax((of_a - of_b) / (a.at * a.at - b.at * b.at), 0);
  const double c = 2 * (of_a - q * a.at * a.at);
  if (slope - c * limit - 4 * q * limit * limit * limit > 0) return limit;
  while (high - low > 1e-3 * high) {
    const double middle = (low + high) / 2;
    if (slope - c * middle - 4 * q * middle * middle * middle > 0) low = middle;
    else high = middle;
  }
  return low;
}

/* v += lambda d, with lambda near the minimum of E on the line: the first of 1, ... that reduces E
 * enough (Armijo 1966), then up to 3 better ones, unless E drops by half of lambda R.d, as at the
 * minimum of a parabola. Buckling cloth moves in directions in which A has hardly any curvature, so
 * that the quadratic model does not predict lambda; and E is far less expensive than another d.
 * Solvers without descend() use the trust radius instead. full: lambda = 1. Returns lambda. */
static double search_energy(newton *n, int full) {
  enum { MOST = 30, BETTER = 3 };
  const double NEAR = 0.1, CLOSE = 0.2, FAR = 4;
  const ms_model *m = n->s->model;
  const double slope = ms_vector_dot(n->shape, n->b, n->d), size = newton_norm(n, n->d);
  const double drag = ms_external_matrix(&m->external, n->stage->ah);
  const double square = size * size + drag * ms_vector_dot(n->shape, n->d, n->d);
  ms_rank_model_refresh(m, n->d, NULL);
  sample best = {1, reduction(n, 1, slope, square)}, other = {0};
  int left = ms_solver_can_descend(n->s->solver) ? BETTER : 0;
  for (int i = 0; i < MOST && !full; i++) {
    const double share = best.reduced / (best.at * slope);
    const int reduces = share >= 1e-4;
    double at = maximize_quartic(slope, best, other, FAR * fmax(best.at, other.at));
    if (reduces && (fabs(share - 0.5) <= NEAR || fabs(at - best.at) < CLOSE * best.at || !left--))
      break;
    if (!reduces) at = fmin(fmax(at, 0.1 * best.at), 0.5 * best.at);
    const sample next = {at, reduction(n, at, slope, square)};
    const int is_better = !reduces || next.reduced > best.reduced;
    other = is_better ? best : next;
    if (is_better) best = next;
  }
  ms_vector_axpy(n->shape, best.at, n->d, n->stage->v);
  evaluate_residual(n);
  update_trust_radius(n, best.at, best.reduced);
  return best.at;
}

/* v += lambda d, with the first lambda of 1, ... that does not pass the minimum along d by much:
 * d.R(v + lambda d) >= -d.R(v)/2 (Matthies and Strang 1979). For damping or contacts, with which R
 * has no potential. full: lambda = 1. Returns lambda. */
static double search_slope(newton *n, int full) {
  enum { MOST = 30 };
  const double start = ms_vector_dot(n->shape, n->b, n->d);
  double lambda = 1;
  ms_vector_copy(n->shape, n->stage->v, n->from);
  for (int i = 0;; i++) {
    ms_vector_add_scaled(n->shape, n->from, lambda, n->d, n->stage->v);
    evaluate_residual(n);
    const double slope = ms_vector_dot(n->shape, n->b, n->d);
    if (slope >= -0.5 * start || i == MOST || full) {
      update_trust_radius(n, lambda, (start + slope) / 2);
      return lambda;
    }
    const double zero = start / (start - slope); /* of the secant; NaN far outside */
    lambda *= zero > 0.1 ? zero : 0.1;
  }
}

/* ||R|| in the norm of the last solve (jacobi.h). The norm of M^-1 weights errors along a stiff
 * spring by its stiffness over the mass, and the search then follows a narrow curved valley: a step
 * with h c/m = 3500 takes 86 iterations with that norm, and 15 with this one. */
static double residual_level(const newton *n) {
  return ms_jacobi_norm(n->s->model, &n->s->solver->system.a, n->b);
}

/* v += lambda d, with the first lambda of 1, ... that reduces the residual enough (Armijo 1966);
 * the next one is the minimum of a parabola. If none does, the clamped matrix makes the next d.
 * full: lambda = 1. Returns lambda. */
static double search_residual(newton *n, int full) {
  enum { MOST = 10 };
  const double SLOW = 0.9;
  const double first = residual_level(n), start = first * first;
  double lambda = 1;
  ms_vector_copy(n->shape, n->stage->v, n->from);
  for (int i = 0;; i++) {
    ms_vector_add_scaled(n->shape, n->from, lambda, n->d, n->stage->v);
    evaluate_residual(n);
    const double level = residual_level(n), end = level * level;
    n->is_stuck = !(end <= SLOW * SLOW * start);
    if (end <= (1 - 1e-4 * lambda) * start || i == MOST || full) return lambda;
    const double least = lambda * start / (end - start + 2 * lambda * start);
    lambda *= least > 0.1 ? fmin(least, 0.5) : 0.1;
  }
}

/* The relative displacement of the ends of a spring by d, over its length at the start of the step,
 * which dampers keep, or at rest, if larger. The present length may pass through 0. */
static double relative_motion(const newton *n, int32_t e) {
  const ms_springs *s = &n->s->model->springs;
  const size_t stride = (size_t)n->shape.stride;
  const int32_t i = s->i[e], j = s->j[e];
  const double rest = n->s->model->scene->rest[ms_springs_number(s, e)];
  double length2 = rest * rest, apart2 = 0, motion2 = 0;
  for (size_t c = 0; c < (size_t)n->shape.dims; c++) {
    const double *x = n->s->x + c * stride, *d = n->d + c * stride;
    const double motion = n->stage->ah * (d[j] - d[i]);
    apart2 += (x[j] - x[i]) * (x[j] - x[i]);
    motion2 += motion * motion;
  }
  length2 = fmax(length2, apart2);
  return length2 > MS_MIN_LENGTH2 ? sqrt(motion2 / length2) : 0;
}

/* v += lambda d, lambda = 1 or less, so that no relative_motion() exceeds 1/4; full: lambda = 1.
 * Returns lambda. The residual may rise. Strong dampers keep lengths, so that states with a small
 * residual form a narrow curved valley: a straight step leaves it by the square of its length, and
 * turns springs by a thousandth if shortened until the residual falls. The next step corrects the
 * lengths, as the matrix is exact: the relaxed steps of the watchdog technique (Chamberlain et al.
 * 1982), without its check. */
static double limit_rotation(newton *n, int full) {
  const double MOST = 0.25;
  double largest = 0;
  ms_rank_model_refresh(n->s->model, n->s->x, n->d);
  for (int32_t e = 0; e < n->s->model->springs.n && !full; e++)
    largest = fmax(largest, relative_motion(n, e));
  ms_ranks_maximum(n->shape.ranks, 1, &largest);
  const double lambda = largest > MOST ? MOST / largest : 1;
  ms_vector_axpy(n->shape, lambda, n->d, n->stage->v);
  evaluate_residual(n);
  return lambda;
}

/* The symmetric matrix makes faster and more robust iterations, unless one with lambda = 1, or of a
 * matrix that is not clamped, leaves more than MUCH of the residual: then the full one is used as
 * long as the residual falls. A solve with that takes several times as long. */
static search find_next_search(newton *n, double before, double lambda) {
  const double MUCH = 0.6;
  const int is_slow = (lambda == 1 || !n->is_clamped) && n->residual > MUCH * before;
  if (n->is_stuck) n->failures++, n->failed = n->residual;
  if (n->search != REDUCE_POTENTIAL) return n->is_stuck ? REDUCE_POTENTIAL : REDUCE_RESIDUAL;
  return is_slow && may_use_full(n) && !n->is_truncated ? REDUCE_RESIDUAL : REDUCE_POTENTIAL;
}

/* The bound on the estimated error after the last correction; errors of many steps add up. */
static double final_tolerance(const newton *n) { return 0.1 * velocity_tolerance(n); }

/* The relative tolerance of the linear solve, 0.9 (||rho||/||rho before||)^2 (Eisenstat and Walker
 * 1996, choice 2), at most 0.1. A tenth of the error that ends Newton's method is sufficient, if
 * corrections decrease as the residual does. */
static double forcing_tolerance(const newton *n, double before) {
  if (n->linear) return fmin(n->s->opt->solver_rtol, n->s->opt->newton_rtol);
  const double ratio = before > 0 ? n->residual / before : 1, expected = ratio * n->correction;
  const double enough = expected > 0 ? 0.1 * final_tolerance(n) / expected : 0;
  return fmax(fmin(fmax(0.9 * ratio * ratio, enough), 0.1), n->s->opt->solver_rtol);
}

/* 4 eps (|v| + min(1, (ah omega)^2) |x|/ah): corrections by rounding, that of x in stiff steps */
static double rounding_level(const newton *n) {
  const double ah = n->stage->ah, z = ah * n->s->bounds.omega, kept = fmin(1, z * z) / ah;
  return 4 * DBL_EPSILON * (newton_norm(n, n->stage->v) + kept * newton_norm(n, n->stage->x));
}

/* 1: with `more` further corrections, each theta times the one before, the error is small:
 *   theta^more theta/(1 - theta) |d| <= final_tolerance() */
static int converges_within(const newton *n, double theta, int more) {
  return n->correction > 0 && theta < 1 &&
         pow(theta, more) * theta / (1 - theta) * n->correction <= final_tolerance(n);
}

/* The ratio of the last two corrections; 1: unknown */
static double contraction(const newton *n) {
  return n->previous > 0 ? n->correction / n->previous : 1;
}

/* 1: the error is estimated to be at most a hundredth of the change of velocity. */
static int is_nearly_converged(const newton *n) {
  const double NEARLY = 1e-2, theta = fmax(n->eta, contraction(n));
  return n->correction > 0 && theta * n->correction <= (1 - theta) * NEARLY * velocity_change(n);
}

/* If the matrix is constant, the error is A^-1 R, whose norm is below that of M^-1 R. */
static int is_converged(const newton *n) {
  if (n->linear && n->residual <= velocity_tolerance(n)) return 1;
  return converges_within(n, fmax(n->eta, contraction(n)), 0);
}

/* The clamped matrix is robust far from the solution; near it the exact one converges
 * quadratically, and is often positive definite. Solvers with descend() switch to it later, and
 * later still if FEW clamped iterations are sufficient: these need few iterations of conjugate
 * gradients, and correct in the plane of a cloth what an exact one has moved out of it. */
static int must_clamp(newton *n, double first) {
  enum { FEW = 8 };
  const int descends = ms_solver_can_descend(n->s->solver), is_lost = n->is_stuck;
  const int will_do =
      descends && n->residual > 1e-3 * first && converges_within(n, contraction(n), FEW);
  n->is_stuck = 0;
  return n->s->opt->jacobian == MSIM_JACOBIAN_CLAMP ||
         n->residual > (descends ? 1e-2 : 0.1) * first || will_do || is_lost;
}

static double line_search(newton *n, int full) {
  const int has_potential = !(n->s->model->features & MS_HAS_DAMPING || n->s->model->function) &&
                            !ms_stepper_has_contacts(n->s);
  if (n->search == LIMIT_ROTATION) return limit_rotation(n, full);
  if (n->search == REDUCE_RESIDUAL) return search_residual(n, full);
  return has_potential ? search_energy(n, full) : search_slope(n, full);
}

static msim_status fail_not_converged(newton *n, msim_error *err) {
  const double size = velocity_change(n), wanted = velocity_tolerance(n) / size;
  n->s->offender = ms_vector_find_largest(n->shape, n->rho);
  return ms_error_set(err, MSIM_NOT_CONVERGED,
                      "Newton's method did not converge in %d iterations: the last correction is "
                      "%.3g of the change of velocity in the step, but %s requires %.3g; use a "
                      "smaller h or raise newton.max_iterations",
                      n->s->opt->newton_max_iterations, n->moved / size,
                      wanted < n->s->opt->newton_rtol ? "tol" : "newton.rtol", wanted);
}

/* At the limit of iterations: keep v and the x that belongs to it, if options accept that. */
static msim_status end_incomplete(newton *n, msim_error *err) {
  if (!ms_options_accept_incomplete(n->s->opt)) return fail_not_converged(n, err);
  n->s->incomplete = 1;
  return MSIM_OK;
}

/* Starts from the guess in v, or, as strong dampers stop motion within a step, from the v that does
 * not change x, (x - x0)/ah, but for particles in contact, if the residual is far smaller there. */
static void choose_initial_guess(newton *n) {
  const double FAR = 0.1;
  const ms_newton_stage *g = n->stage;
  evaluate_residual(n);
  n->dampers = ms_damper_strength_find(n->s->model, g->ah);
  if (!n->dampers) return;
  const double usual = n->residual;
  ms_vector_copy(n->shape, g->v, n->from);
  ms_vector_add_scaled(n->shape, n->s->x, -1, g->x0, g->v);
  ms_vector_scale(n->shape, 1 / g->ah, g->v);
  ms_stepper_copy_contacts(n->s, n->from, g->v);
  evaluate_residual(n);
  if (n->residual < FAR * usual) {
    n->search = REDUCE_RESIDUAL;
    return;
  }
  ms_vector_copy(n->shape, n->from, g->v);
  evaluate_residual(n);
}

msim_status ms_newton_solve(ms_stepper *s, const ms_newton_stage *stage, msim_error *err) {
  newton n = {.s = s,
              .stage = stage,
              .shape = s->model->shape,
              .linear = s->solver->system.a.block == 1,
              .radius = INFINITY,
              .rho = stage->work[0],
              .b = stage->work[1],
              .d = stage->work[2],
              .from = stage->work[3]};
  choose_initial_guess(&n);
  const double first = n.residual;
  double before = 0;
  for (; n.count < s->opt->newton_max_iterations; n.count++) {
    if (n.residual == 0) return MSIM_OK;
    n.eta = forcing_tolerance(&n, before);
    msim_status status = find_direction(&n, must_clamp(&n, first), err);
    if (status == MSIM_NOT_CONVERGED && ms_options_accept_incomplete(s->opt)) break;
    if (status) s->offender = s->solver->offender;
    if (status) return status;
    if (s->solver->incomplete) n.eta = 1, s->incomplete = 1; /* an unknown residual */
    before = n.residual;
    n.previous = n.correction;
    n.correction = newton_norm(&n, n.d);
    s->stats->newton_iterations++;
    const int is_little = n.correction <= rounding_level(&n), last = is_little && !n.is_truncated;
    const double lambda = line_search(&n, last);
    n.moved = lambda * n.correction;
    n.search = find_next_search(&n, before, lambda);
    if (lambda < 1 || n.is_truncated) n.correction = 0;
    if (is_little) n.radius = INFINITY; /* slopes within rounding have made it small */
    if (last || is_converged(&n)) return MSIM_OK;
    if (ms_stepper_may_be_rejected(s) && is_nearly_converged(&n) && ms_stepper_is_rejected(s))
      return MSIM_OK;
  }
  return end_incomplete(&n, err);
}
