/* conformance - what the groups of conformance tests share: the backend under test and the solution
 * of one linear system */
#ifndef CONFORMANCE_H
#define CONFORMANCE_H

#include "rig.h"

extern const msim_backend *backend;           /* under test, wrapped by checking_backend */
extern const msim_backend *bare;              /* the same unwrapped, for invalid calls */
extern int iterative, symmetric, unsymmetric; /* nonzero: its flags MSIM_BACKEND_... */

#define RTOL 1e-10 /* default relative tolerance of iterative backends */
enum { LIMIT = 5000 };

/* The groups of tests; each returns the number of failures. */
int run_solutions(void);
int run_definiteness(void);
int run_iterations(void);
int run_refusals(void);
int run_side_effects(void);
int run_out_of_memory(void);

/* A test that fails at its end if the host or the backend has broken the contract. */
#define conformance_test(f) cmocka_unit_test_teardown(f, check_no_breach)
int check_no_breach(void **state);

/* A kind of problem whose values are multiplied by `factor`. */
typedef struct kind {
  const char *name;
  problem *(*make)(int32_t n, int32_t block, uint64_t seed);
  double factor;
} kind;

typedef void visitor(const char *label, const problem *p);

/* Call visit for all kinds up to the first without a name, all sizes up to the first 0, and blocks
 * of 1, 2, 3. */
void for_each(const kind *kinds, const int32_t *sizes, visitor *visit);

/* The results of one system, from create to solve. */
typedef struct outcome {
  msim_status status; /* the first that was not MSIM_OK */
  const char *call;   /* the call that returned it; "solve" if none did */
  int32_t definite;   /* what factor() and solve() reported about A */
  int64_t iterations;
  double fill, flops;
  double *y; /* the solution, from the initial guess 0 */
} outcome;

outcome solve_with(const msim_backend *table, const problem *p, int32_t ask, const double *b);

/* 1 if the status reports a failure, or if y is a solution. */
int is_valid_outcome(const problem *p, const double *b, msim_status status, const double *y);

/* 1 if y is accurate enough: of an iteration, a residual of at most rtol or rounding error; of a
 * factorization, a small backward error. */
int is_solution(const problem *p, const double *b, const double *y, double rtol, double error);

/* Two vectors must agree bit for bit, such as the solutions of two instances. */
void assert_same(const char *label, const double *y, const double *z, int32_t n);

#endif
