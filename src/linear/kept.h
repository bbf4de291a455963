/* kept - the factor of an earlier matrix, which preconditions conjugate gradients as long as that
 * pays
 *
 * Costs are in flops of a factorisation. Its dense kernels run about 4 times as fast as two
 * triangular solves, which read the factor twice: a solve costs 16 for each number of the factor,
 * and a half spring costs an iteration of pcg about 32 (measured on CPUs with AVX2 and AVX-512). */
#ifndef MS_KEPT_H
#define MS_KEPT_H

#include "linear/cg.h"

#define MS_FLOPS_PER_FILL 16.0
#define MS_FLOPS_PER_HALF 32.0

typedef struct ms_kept {
  ms_linear *by; /* who factors; NULL: nobody, and nothing is kept */
  ms_cg cg;
  double rtol;        /* asked of `by`: where a rough answer will do, it may be quick about it */
  int64_t age;        /* steps since the factor was made, this one included; 0: there is none */
  int64_t iterations; /* spent on them */
  int64_t wait, rest; /* steps to let pass after a failure, and how many are left of them */
  double limit;       /* iterations that a step may take; 0: what steps cost on average, with the
                         making of the factor */
} ms_kept;

msim_status ms_kept_create(const ms_system *system, ms_linear *by, ms_kept *kept, msim_error *err);
void ms_kept_destroy(const ms_system *system, ms_kept *kept);

/* by has a new factor, of this system. limit: as above. */
void ms_kept_renew(ms_kept *kept, const ms_system *system, double limit);
void ms_kept_forget(ms_kept *kept);

/* Whether this step is to be tried by an old factor. One that was no help in the very next step is
 * a sign: the next tries come after 1, 3, 7, ... 63 steps. */
int ms_kept_is_ready(ms_kept *kept);

/* A v = b, as ms_cg_solve; residual: ||b - A v||. */
msim_status ms_kept_solve(ms_kept *kept, const ms_system *system, const ms_target *target,
                          const double *b, double *v, int64_t *iterations, double *residual);

/* How the step ended that ms_kept_solve has tried. */
void ms_kept_judge(ms_kept *kept, int served, int64_t iterations);

#endif
