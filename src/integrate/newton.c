#include "integrate/newton.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "physics/excess.h"

/* The residual in units of velocity: rho = M^-1 R, b = R. Norms are those of M; the radius and the
 * length of d, where the solver only solves, are in that of its matrix. */
typedef struct newton {
  ms_stepper *s;
  const ms_stage *stage;
  ms_shape shape;
  int linear; /* the matrix is constant */
  double *rho, *b, *d, *from;
  double residual;             /* ||rho|| */
  double eta;                  /* what the last solve left of its right side */
  double radius;               /* d is not longer */
  double length, promise;      /* of d: what the model says that it takes off the energy */
  int is_cut;                  /* d was cut at the radius */
  int is_lost;                 /* d of the matrix with all its parts did not reduce the residual */
  int is_whole;                /* d is that of the matrix with all its parts */
  double moved;                /* by the last iteration, ||lambda d|| */
  double correction, previous; /* ||d|| of this iteration and of the one before; 0: none, or cut */
} newton;

/* Error control may need more than the option asks for. */
static double rtol(const newton *n) {
  const double asked = n->s->opt->newton_rtol;
  return n->s->noise > 0 ? fmin(asked, n->s->noise) : asked;
}

static double norm(const newton *n, const double *v) {
  ms_scale_rows(n->shape, n->s->model->mass, v, n->s->scratch);
  return sqrt(ms_dot(n->shape, v, n->s->scratch));
}

/* x, rho and b at the v of the stage */
static void evaluate(newton *n) {
  const ms_stage *g = n->stage;
  ms_combine(n->shape, g->x0, g->ah, g->v, g->x);
  ms_acceleration(n->s, g->x, g->v, n->rho);
  ms_combine(n->shape, g->w, g->ah, n->rho, n->rho);
  ms_axpy(n->shape, -1, g->v, n->rho);
  ms_scale_rows(n->shape, n->s->model->mass, n->rho, n->b);
  n->residual = sqrt(ms_dot(n->shape, n->b, n->rho));
}

static msim_status solve(newton *n, const ms_request *request, msim_error *err) {
  memset(n->d, 0, (size_t)n->shape.dims * (size_t)n->shape.stride * sizeof *n->d);
  return ms_solver_solve(n->s->solver, request, n->b, n->d, err);
}

/* d = A^-1 R, cut at the radius: by the matrix as it is; clamped, where that is not positive
 * definite. */
static msim_status solve_within(newton *n, ms_request *request, msim_error *err) {
  msim_status status = solve(n, request, err);
  if (status == MSIM_NOT_SPD && !request->clamp) {
    request->clamp = 1;
    status = solve(n, request, err);
  }
  if (status) return status;
  const double drop = ms_dot(n->shape, n->b, n->d), part = n->radius / sqrt(drop);
  n->is_cut = part < 1;
  if (n->is_cut) ms_scale(n->shape, part, n->d);
  n->length = fmin(sqrt(drop), n->radius);
  n->promise = n->is_cut ? part * (1 - part / 2) * drop : drop / 2;
  return MSIM_OK;
}

/* d = A^-1 R with all of A, which leads down the residual and no energy */
static msim_status solve_whole(newton *n, ms_request *request, msim_error *err) {
  request->v = n->stage->v;
  const msim_status status = solve(n, request, err);
  request->v = NULL;
  n->is_whole = !status;
  n->is_cut = 0;
  return status;
}

/* d downhill, to the residual eta */
static msim_status find_direction(newton *n, int clamp, msim_error *err) {
  ms_solver *solver = n->s->solver;
  ms_request request = {
      .x = n->stage->x, .h = n->stage->ah, .clamp = clamp, .indefinite = -1, .rtol = n->eta};
  ms_hold_rows(n->s, &request);
  n->is_whole = 0;
  if (!clamp && ms_solver_takes_turning(solver) && !solve_whole(n, &request, err)) return MSIM_OK;
  if (!ms_solver_descends(solver)) return solve_within(n, &request, err);
  return ms_solver_descend(solver, &request, n->b, n->d, err);
}

/* The radius follows the ratio of the reduction of the energy to the predicted one. */
static void set_radius(newton *n, double lambda, double reduced) {
  if (ms_solver_descends(n->s->solver)) return;
  const double ratio = reduced / n->promise;
  if (lambda < 1) n->radius = lambda * n->length;
  else if (ratio < 0.25) n->radius = 0.5 * n->length;
  else if (ratio > 0.75 && n->is_cut) n->radius = fmax(n->radius, 2 * n->length);
}

/* E(v) - E(v + lambda d), E = |v - w|_M^2/2 + U(x0 + ah v), the incremental potential, whose
 * gradient is -R. slope: R.d; square: d.d, by mass and drag. */
static double reduction(const newton *n, double lambda, double slope, double square) {
  const ms_stage *g = n->stage;
  return lambda * (slope - lambda * square / 2) -
         ms_excess(n->s->model, g->x, g->ah, n->d, lambda, n->s->scratch);
}

/* v += lambda d, the first of 1, ... that reduces E enough (Armijo 1966), each from the minimum of
 * a parabola; whole: 1, unconditionally. Returns lambda. */
static double search_energy(newton *n, int whole) {
  enum { MOST = 30 };
  const ms_model *m = n->s->model;
  const double slope = ms_dot(n->shape, n->b, n->d), size = norm(n, n->d);
  const double drag = m->passes & MSIM_SKIP_DRAG ? n->stage->ah * m->scene->drag : 0;
  const double square = size * size + drag * ms_dot(n->shape, n->d, n->d);
  double lambda = 1, reduced = reduction(n, 1, slope, square);
  for (int i = 0; !(reduced >= 1e-4 * lambda * slope) && i < MOST && !whole; i++) {
    const double least = lambda * slope / (2 * (lambda * slope - reduced));
    lambda *= least > 0.1 ? fmin(least, 0.5) : 0.1;
    reduced = reduction(n, lambda, slope, square);
  }
  ms_axpy(n->shape, lambda, n->d, n->stage->v);
  evaluate(n);
  set_radius(n, lambda, reduced);
  return lambda;
}

/* v += lambda d, the first of 1, ... that does not lead far beyond the place where d would lead
 * uphill: d.R >= -1/2 of what it was (Matthies and Strang 1979). whole: 1, unconditionally. Returns
 * lambda. Where dashpots or contacts leave R without a potential. */
static double search_slope(newton *n, int whole) {
  enum { MOST = 30 };
  const double start = ms_dot(n->shape, n->b, n->d);
  double lambda = 1;
  ms_copy(n->shape, n->stage->v, n->from);
  for (int i = 0;; i++) {
    ms_combine(n->shape, n->from, lambda, n->d, n->stage->v);
    evaluate(n);
    const double slope = ms_dot(n->shape, n->b, n->d);
    if (slope >= -0.5 * start || i == MOST || whole) {
      set_radius(n, lambda, (start + slope) / 2);
      return lambda;
    }
    const double zero = start / (start - slope); /* of the straight line; NaN far outside */
    lambda *= zero > 0.1 ? zero : 0.1;
  }
}

/* v += lambda d, the first of 1, ... that takes enough off the residual (Armijo 1966), each after
 * the minimum of a parabola; whole: 1, whatever comes. Where d leads nowhere the clamped matrix
 * makes the next one. Returns lambda. */
static double search_residual(newton *n, int whole) {
  enum { MOST = 10 };
  const double start = n->residual * n->residual;
  double lambda = 1;
  ms_copy(n->shape, n->stage->v, n->from);
  for (int i = 0;; i++) {
    ms_combine(n->shape, n->from, lambda, n->d, n->stage->v);
    evaluate(n);
    const double end = n->residual * n->residual;
    n->is_lost = !(end <= (1 - 1e-4 * lambda) * start);
    if (!n->is_lost || i == MOST || whole) return lambda;
    const double least = lambda * start / (end - start + 2 * lambda * start);
    lambda *= least > 0.1 ? fmin(least, 0.5) : 0.1;
  }
}

/* The tolerance of the linear solve: as the residual drops (Eisenstat and Walker 1996, choice 2).
 */
static double forcing(const newton *n, double before) {
  if (n->linear) return fmin(n->s->opt->solver_rtol, rtol(n));
  const double ratio = before > 0 ? n->residual / before : 1, eta = 0.9 * ratio * ratio;
  return fmax(fmin(eta, 0.1), n->s->opt->solver_rtol);
}

/* What x = x0 + ah v cannot tell apart from v. */
static double rounding_level(const newton *n) {
  const ms_stage *g = n->stage;
  return 4 * DBL_EPSILON * (norm(n, g->v) + norm(n, g->x) / g->ah);
}

/* What the error is measured by. */
static double size(const newton *n) {
  ms_combine(n->shape, n->stage->v, -1, n->s->v, n->from);
  return fmax(norm(n, n->stage->v), norm(n, n->from));
}

/* theta is an estimate, and the errors of many steps add up. Where the matrix is constant the error
 * is A^-1 R, and less than M^-1 R. */
static int is_converged(const newton *n) {
  const double SAFETY = 0.1;
  const double theta = fmax(n->eta, n->previous > 0 ? n->correction / n->previous : 1);
  if (n->linear && n->residual <= rtol(n) * size(n)) return 1;
  return n->correction > 0 && theta < 1 &&
         theta / (1 - theta) * n->correction <= SAFETY * rtol(n) * size(n);
}

/* The clamped matrix leads far, the exact one to the end: near the solution it makes the method
 * quadratic, and is often positive definite. Conjugate gradients take it later than solves: clamped
 * iterations take few of theirs, and correct in the plane of a cloth what an exact one has moved
 * out of it. */
static int must_clamp(newton *n, double first) {
  const double dropped = ms_solver_descends(n->s->solver) ? 1e-3 : 0.1;
  const int is_lost = n->is_lost;
  n->is_lost = 0;
  return n->s->opt->jacobian == MSIM_JACOBIAN_CLAMP || n->residual > dropped * first || is_lost;
}

static double search(newton *n, int whole) {
  const int has_potential = !(n->s->model->passes & MSIM_SKIP_DAMPING) && !ms_rests(n->s);
  if (n->is_whole) return search_residual(n, whole);
  return has_potential ? search_energy(n, whole) : search_slope(n, whole);
}

static msim_status give_up(newton *n, msim_error *err) {
  n->s->culprit = ms_find_largest(n->shape, n->rho);
  return ms_fail(err, MSIM_NOT_CONVERGED,
                 "Newton's method made %d iterations and the last changed v by %.3g of its size; "
                 "%s asks for %.3g",
                 n->s->opt->newton_max_iterations, n->moved / norm(n, n->stage->v),
                 rtol(n) < n->s->opt->newton_rtol ? "tol" : "newton.rtol", rtol(n));
}

msim_status ms_newton_solve(ms_stepper *s, const ms_stage *stage, msim_error *err) {
  newton n = {.s = s,
              .stage = stage,
              .shape = s->model->shape,
              .linear = s->solver->system.a.block == 1,
              .radius = INFINITY,
              .rho = stage->work[0],
              .b = stage->work[1],
              .d = stage->work[2],
              .from = stage->work[3]};
  evaluate(&n);
  const double first = n.residual;
  double before = 0;
  for (int32_t i = 0; i < s->opt->newton_max_iterations; i++) {
    if (n.residual == 0) return MSIM_OK;
    n.eta = forcing(&n, before);
    msim_status status = find_direction(&n, must_clamp(&n, first), err);
    if (status) s->culprit = s->solver->culprit;
    if (status) return status;
    before = n.residual;
    n.previous = n.correction;
    n.correction = norm(&n, n.d);
    s->stats->newton_iterations++;
    const int is_little = n.correction <= rounding_level(&n), last = is_little && !n.is_cut;
    const double lambda = search(&n, last);
    n.moved = lambda * n.correction;
    if (lambda < 1 || n.is_cut) n.correction = 0;
    if (is_little) n.radius = INFINITY; /* slopes that are noise have made it small */
    if (last || is_converged(&n)) return MSIM_OK;
  }
  return give_up(&n, err);
}
