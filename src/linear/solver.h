/* solver - the policy over linear solvers: which one, what is new, what happens when A is not
 * positive definite, and whether the answer is good enough. Backends obey. */
#ifndef MS_SOLVER_H
#define MS_SOLVER_H

#include "linear/linear.h"

typedef struct ms_solver {
  ms_system system;
  ms_linear *linear;
  ms_target target;
  int clamp;      /* jacobian = clamp */
  int indefinite; /* MSIM_INDEFINITE_... */
  msim_stats *stats;
  double *guess, *residual, *correction, *magnitude; /* work vectors */
  double reached;                                    /* ||b - A v|| / ||b|| of the last solve */
  int32_t culprit;  /* the row to blame for the last status != MSIM_OK; -1: none in particular */
  char reason[256]; /* why this solver, for people */
} ms_solver;

/* h: the step, for `auto`. Set up once; nothing is allocated later. Counts go to stats. */
msim_status ms_solver_create(const ms_model *model, const msim_options *opt, double h,
                             msim_stats *stats, ms_solver **solver, msim_error *err);
void ms_solver_destroy(ms_solver *solver);

/* v = A(x, h)^-1 b. v: first guess in, solution out, scratch unless MSIM_OK.
 *
 * A found not positive definite: counted, then by option the step is repeated with the clamped
 * matrix, or solved as it is, or given up with MSIM_NOT_SPD. The true residual is checked after
 * every solve: ||b - A v|| <= rtol ||b||, or at rounding level, 8 eps || |A||v| + |b| ||. Above
 * that a factor gets up to three steps of iterative refinement; then MSIM_NOT_CONVERGED. */
msim_status ms_solver_solve(ms_solver *solver, const double *x, double h, const double *b,
                            double *v, msim_error *err);

#endif
