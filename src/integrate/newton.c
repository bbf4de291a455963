#include "integrate/newton.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* The residual in units of velocity: rho = M^-1 R, b = R. Norms are those of M. */
typedef struct newton {
  ms_stepper *s;
  const ms_stage *stage;
  ms_shape shape;
  int linear; /* the matrix is constant */
  double *rho, *b, *d, *from;
  double residual;             /* ||rho|| */
  double moved;                /* by the last iteration, ||lambda d|| */
  double correction, previous; /* ||d|| of this iteration and of the one before; 0: none, or cut */
} newton;

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

/* d, to the residual eta: by the matrix as it is; clamped, where that is not positive definite. */
static msim_status find_direction(newton *n, int clamp, double eta, msim_error *err) {
  const ms_shape shape = n->shape;
  ms_request request = {n->stage->x, n->stage->ah, clamp, -1, eta};
  for (;;) {
    memset(n->d, 0, (size_t)shape.dims * (size_t)shape.stride * sizeof *n->d);
    msim_status status = ms_solver_solve(n->s->solver, &request, n->b, n->d, err);
    if (status != MSIM_NOT_SPD || request.clamp) return status;
    request.clamp = 1;
  }
}

/* v += lambda d, the first of 1, ... that does not lead far beyond the place where d would lead
 * uphill: d.R >= -1/2 of what it was (Matthies and Strang 1979). whole: 1, whatever comes. Returns
 * lambda. */
static double search(newton *n, int whole) {
  enum { MOST = 30 };
  const double start = ms_dot(n->shape, n->b, n->d);
  double lambda = 1;
  ms_copy(n->shape, n->stage->v, n->from);
  for (int i = 0;; i++) {
    ms_combine(n->shape, n->from, lambda, n->d, n->stage->v);
    evaluate(n);
    const double slope = ms_dot(n->shape, n->b, n->d);
    if (slope >= -0.5 * start || i == MOST || whole) return lambda;
    const double zero = start / (start - slope); /* of the straight line; NaN far outside */
    lambda *= zero > 0.1 ? zero : 0.1;
  }
}

/* The tolerance of the linear solve: as the residual drops (Eisenstat and Walker 1996, choice 2).
 */
static double forcing(const newton *n, double before) {
  if (n->linear) return fmin(n->s->opt->solver_rtol, n->s->opt->newton_rtol);
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
  const double SAFETY = 0.1, rtol = n->s->opt->newton_rtol;
  const double theta = n->previous > 0 ? n->correction / n->previous : 1;
  if (n->linear && n->residual <= rtol * size(n)) return 1;
  return n->correction > 0 && theta < 1 &&
         theta / (1 - theta) * n->correction <= SAFETY * rtol * size(n);
}

/* Near the solution the matrix as it is makes the method quadratic. */
static int must_clamp(const newton *n, double first) {
  const double DROPPED = 0.1;
  return n->s->opt->jacobian == MSIM_JACOBIAN_CLAMP || n->residual > DROPPED * first;
}

static msim_status give_up(newton *n, msim_error *err) {
  n->s->culprit = ms_find_largest(n->shape, n->rho);
  return ms_fail(err, MSIM_NOT_CONVERGED,
                 "Newton's method made %d iterations and the last changed v by %.3g of its size; "
                 "newton.rtol asks for %.3g",
                 n->s->opt->newton_max_iterations, n->moved / norm(n, n->stage->v),
                 n->s->opt->newton_rtol);
}

msim_status ms_newton_solve(ms_stepper *s, const ms_stage *stage, msim_error *err) {
  newton n = {.s = s,
              .stage = stage,
              .shape = s->model->shape,
              .linear = s->solver->system.a.block == 1,
              .rho = stage->work[0],
              .b = stage->work[1],
              .d = stage->work[2],
              .from = stage->work[3]};
  evaluate(&n);
  const double first = n.residual;
  double before = 0;
  for (int32_t i = 0; i < s->opt->newton_max_iterations; i++) {
    if (n.residual == 0) return MSIM_OK;
    const int clamp = must_clamp(&n, first);
    msim_status status = find_direction(&n, clamp, forcing(&n, before), err);
    if (status) s->culprit = s->solver->culprit;
    if (status) return status;
    before = n.residual;
    n.previous = n.correction;
    n.correction = norm(&n, n.d);
    s->stats->newton_iterations++;
    const int last = n.correction <= rounding_level(&n);
    const double lambda = search(&n, last);
    n.moved = lambda * n.correction;
    if (lambda < 1) n.correction = 0;
    if (last || is_converged(&n)) return MSIM_OK;
  }
  return give_up(&n, err);
}
