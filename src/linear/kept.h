/* kept - lagged factorization: conjugate gradients preconditioned by the factor of an earlier
 * matrix, while that is cost-effective
 *
 * Costs are in flops of a factorization, whose dense kernels run about 4 times as fast as the two
 * triangular solves, which read the factor twice. So a solve costs 16 per number of the factor; an
 * iteration of pcg costs about 32 per half-edge (measured on CPUs with AVX2 and AVX-512). */
#ifndef MS_KEPT_H
#define MS_KEPT_H

#include "linear/cg.h"

#define MS_FLOPS_PER_FILL 16.0
#define MS_FLOPS_PER_HALF 32.0

typedef struct ms_kept {
  ms_linear *by; /* the solver that factors; NULL: no factor is lagged */
  ms_cg cg;
  double rtol;        /* for solves with the factor: >= 1e-4 permits single precision (backend.h) */
  int64_t age;        /* solves with the factor, including the one it was computed for; 0: none */
  int64_t iterations; /* made in these solves */
  int64_t wait, rest; /* solves to skip after a failure; those left to skip, may be negative */
  double limit;       /* iterations that a solve may take; 0: the mean cost of the solves so far,
                         including the factorization */
} ms_kept;

msim_status ms_kept_create(const ms_system *system, ms_linear *by, ms_kept *kept, msim_error *err);
void ms_kept_destroy(const ms_system *system, ms_kept *kept);

/* To be called when `by` has factored this system. limit: as above. */
void ms_kept_renew(ms_kept *kept, const ms_system *system, double limit);
void ms_kept_forget(ms_kept *kept);

/* To be called once per solve: 1 if it should try the lagged factor. After a factor that failed in
 * its second solve, 1 solve passes without a try; after further ones in a row 3, 7, ... 63. */
int ms_kept_is_ready(ms_kept *kept);

/* A v = b as by ms_cg_solve, within the limit of iterations; residual: ||b - A v||. */
msim_status ms_kept_solve(ms_kept *kept, const ms_system *system, const ms_target *target,
                          const double *b, double *v, int64_t *iterations, double *residual);

/* Record the outcome of ms_kept_solve. served: 1 if its solution was accepted. */
void ms_kept_judge(ms_kept *kept, int served, int64_t iterations);

#endif
