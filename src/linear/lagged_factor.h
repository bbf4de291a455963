/* lagged_factor - lagged factorization: conjugate gradients preconditioned by the factor of an
 * earlier matrix, while that is cost-effective (Hestenes and Stiefel 1952)
 *
 * Costs are in flops of a factorization, whose dense kernels run about 4 times as fast as the two
 * triangular solves, which read the factor twice. So a solve costs 16 per number of the factor; an
 * iteration of pcg costs about 32 per half-edge (measured on CPUs with AVX2 and AVX-512). */
#ifndef MS_LAGGED_FACTOR_H
#define MS_LAGGED_FACTOR_H

#include "linear/linear.h"

#define MS_SOLVE_FLOPS_PER_NONZERO 16.0
#define MS_PCG_FLOPS_PER_HALF_EDGE 32.0

/* The cost of an iteration of pcg; an angular spring counts as 4 springs. */
static inline double ms_lagged_factor_iteration_flops(const ms_model *model) {
  return MS_PCG_FLOPS_PER_HALF_EDGE * 2 * (model->springs.n + 4.0 * model->angles.n);
}

typedef struct ms_lagged_factor {
  const ms_linear_system *system;
  ms_linear *factorizer; /* the solver that factors; NULL: no factor is lagged */
  double *r, *z, *p, *q; /* residual, preconditioned residual, direction, A p */
  double rtol;        /* for solves with the factor: >= 1e-4 permits single precision (backend.h) */
  int64_t age;        /* solves with the factor, including the one it was computed for; 0: none */
  int64_t iterations; /* made in these solves */
  int64_t skip_length,
      skips_left; /* solves to skip after a failure; those left to skip, may be negative */
  double limit;   /* iterations that a solve may take; 0: the mean cost of the solves so far,
                         including the factorization */
} ms_lagged_factor;

msim_status ms_lagged_factor_create(const ms_linear_system *system, ms_linear *by,
                                    ms_lagged_factor *kept, msim_error *err);
void ms_lagged_factor_destroy(ms_lagged_factor *kept);

/* To be called when `by` has factored the system. limit: as above. */
void ms_lagged_factor_renew(ms_lagged_factor *kept, double limit);
void ms_lagged_factor_discard(ms_lagged_factor *kept);

/* To be called once per solve: 1 if it should try the lagged factor. After a factor that failed in
 * its second solve, 1 solve passes without a try; after further ones in a row 3, 7, ... 63. */
int ms_lagged_factor_begin_solve(ms_lagged_factor *kept);

/* A v = b, within the limit of iterations; v: 0 on input, the solution on output. MSIM_OK: the true
 * residual ||b - A v|| has reached the target or stagnates, which the caller must check.
 * MSIM_NOT_SPD: a search direction has p.A p <= 0. */
msim_status ms_lagged_factor_solve(ms_lagged_factor *kept, const ms_linear_target *target,
                                   const double *b, double *v, int64_t *iterations,
                                   double *residual);

/* Record the outcome of ms_lagged_factor_solve. served: 1 if its solution was accepted. */
void ms_lagged_factor_record(ms_lagged_factor *kept, int served, int64_t iterations);

#endif
