/* nonlinear_step - one step of implicit Euler and its converged solution v'
 *
 *   M (v' - v) = h F(x + h v'),  norms: |u| = sqrt(sum m u.u) */
#ifndef BENCH_NONLINEAR_STEP_H
#define BENCH_NONLINEAR_STEP_H

#include "accuracy_record.h"
#include "bench_scenes.h"

/* v' is a solution if its residual, relative to that at v' = v, is below this. */
#define SOLVED_RESIDUAL 1e-9

typedef struct nonlinear_step {
  const moving_scene *moving;
  double h;
  const char *solver; /* the one that converged */
  int64_t iterations; /* of Newton's method */
  double *v;          /* 3n: the solution */
  double change;      /* |v' - v| */
  double start;       /* residual at v' = v */
  double residual;    /* of the solution, over `start` */
  msim_sim *sim;      /* computes forces */
  double *x, *force;  /* 3n: scratch */
} nonlinear_step;

/* Options of implicit Euler by Newton's method, on one thread. */
msim_options newton_options(double h, double rtol, const char *solver);

/* Advances the state by 3 steps of length h, or until one fails. The state comes from linearly
 * implicit Euler with a clamped Jacobian, which leaves springs compressed that buckle under
 * implicit Euler; the first steps after it are not typical of a run. */
void nonlinear_step_settle(moving_scene *m, double h);

/* Solves the step of length h from a scene's state by Newton's method. allowed: limits with pcg,
 * and with cholmod if that fails. Returns 0 if neither converges and sets err. Call
 * nonlinear_step_free in any case. */
int nonlinear_step_solve(const moving_scene *m, double h, const method_limits allowed[2],
                         nonlinear_step *s, msim_error *err);
void nonlinear_step_free(nonlinear_step *s);

/* |v - v'| / |v' - v(t)|, where v' is the solution */
double nonlinear_step_error(const nonlinear_step *s, const double *v);

/* Whether v solves the equation but is another solution: folded cloth can buckle in several
 * ways. */
int is_another_minimum(const nonlinear_step *s, const double *v);

#endif
