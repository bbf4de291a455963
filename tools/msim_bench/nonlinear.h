/* nonlinear - one step of implicit Euler, and its converged solution
 *
 *   M (v' - v) = h F(x + h v'),  sizes in the norm of M: |u| = sqrt(sum m u.u) */
#ifndef BENCH_NONLINEAR_H
#define BENCH_NONLINEAR_H

#include "pursuit.h"
#include "scenes.h"

/* The residual, over that at v' = v, of what counts as a solution. */
#define SOLVED 1e-9

typedef struct nonlinear_step {
  const moving *moving;
  double h;
  const char *solver; /* that found the solution */
  int64_t iterations; /* of Newton's method */
  double *v;          /* 3n: the solution */
  double change;      /* |v' - v| */
  double start;       /* residual at v' = v */
  double residual;    /* of the solution, over `start` */
  msim_sim *sim;      /* computes forces */
  double *x, *force;  /* 3n: scratch */
} nonlinear_step;

/* Of Newton's method, one thread. */
msim_options newton_options(double h, double rtol, const char *solver);

/* Some steps of length h of this method, as far as they get: the first ones after another method,
 * which leaves springs compressed that this one lets buckle, are unlike those of a run. */
void nonlinear_settle(moving *m, double h);

/* The step of length h from a scene's state, solved by Newton's method; allowed: what it may take
 * by pcg and then by cholmod, about. 0 where neither gets there, and why in err. Call
 * nonlinear_free in any case. */
int nonlinear_make(const moving *m, double h, const allowance allowed[2], nonlinear_step *s,
                   msim_error *err);
void nonlinear_free(nonlinear_step *s);

/* |v - v'| / |v' - v(t)|, v' being the solution */
double nonlinear_error(const nonlinear_step *s, const double *v);

/* |v - v(t) - h M^-1 F(x + h v)|, over that at v = v(t) */
double nonlinear_residual(const nonlinear_step *s, const double *v);

/* Whether v solves the equation and is not the solution: folded cloth can buckle in several ways.
 */
int is_another_minimum(const nonlinear_step *s, const double *v);

#endif
