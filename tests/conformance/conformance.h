/* conformance - what the groups of tests share: the backend under test, and one system solved */
#ifndef CONFORMANCE_H
#define CONFORMANCE_H

#include "rig.h"

extern const msim_backend *backend;           /* the one under test, watched by checking_backend */
extern const msim_backend *bare;              /* the same unwatched, for what a host must not do */
extern int iterative, symmetric, unsymmetric; /* its flags */

#define RTOL 1e-10 /* asked of iterations where nothing else is said */
enum { LIMIT = 5000 };

/* The groups of tests; each returns how many failed. */
int run_answers(void);
int run_definiteness(void);
int run_iterations(void);
int run_refusals(void);
int run_manners(void);
int run_scarcity(void);

/* A test, at whose end nobody must have broken a promise. */
#define conformance_test(f) cmocka_unit_test_teardown(f, no_breach)
int no_breach(void **state);

/* A kind of problem, its values times `factor`. */
typedef struct kind {
  const char *name;
  problem *(*make)(int32_t n, int32_t block, uint64_t seed);
  double factor;
} kind;

typedef void visitor(const char *label, const problem *p);

/* Calls visit for all kinds up to one without a name, all sizes up to 0, and blocks of 1, 2, 3. */
void for_each(const kind *kinds, const int32_t *sizes, visitor *visit);

/* One system from the first call to the last. */
typedef struct outcome {
  msim_status status; /* the first that was not MSIM_OK */
  const char *call;   /* that gave it, or "solve" */
  int32_t definite;   /* what factor() and solve() learnt of A */
  int64_t iterations;
  double fill, flops;
  double *y; /* the answer, from the guess 0 */
} outcome;

outcome solve_with(const msim_backend *table, const problem *p, int32_t ask, const double *b);

/* A status that says openly that there is no answer, or one that holds. */
int is_honest(const problem *p, const double *b, msim_status status, const double *y);

/* Is y as good as can be asked: of an iteration rtol or rounding, of a factor a backward error? */
int is_answer(const problem *p, const double *b, const double *y, double rtol, double error);

/* y: many right sides at once, one at a time, in the bits of another instance, ... */
void assert_same(const char *label, const double *y, const double *z, int32_t n);

#endif
