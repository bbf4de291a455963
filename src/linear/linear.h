/* linear - what the policy in solver.c sees of a linear solver, native or behind the plugin ABI */
#ifndef MS_LINEAR_H
#define MS_LINEAR_H

#include "linear/system.h"

/* The system of one step. */
typedef struct ms_system {
  const ms_model *model;
  ms_coefficients a;
  ms_turning turning; /* A is a and this */
  int clamped;        /* a is that of the clamped matrix: positive definite, up to rounding */
} ms_system;

/* y = A x, as ms_coefficients_apply */
static inline void ms_system_apply(const ms_system *s, const double *x, double *y) {
  ms_coefficients_apply(s->model, &s->a, x, y);
  if (s->turning.v) ms_turning_apply(s->model, &s->turning, x, y);
}

/* What a solve has to reach, and what it cost. */
typedef struct ms_target {
  double rtol;
  double size; /* ||b|| (jacobi.h), for solvers that iterate by themselves */
  int32_t max_iterations;
} ms_target;

/* A step d with b.d > 0: A need not be positive definite. */
typedef struct ms_descent {
  double rtol;            /* of the residual, sqrt(r.P^-1 r), P the preconditioner: enough */
  int32_t max_iterations; /* enough, too */
} ms_descent;

typedef struct ms_linear ms_linear;

/* Calls come in this order: create, (expand, factor+, solve+)+, destroy. */
typedef struct ms_linear_ops {
  /* The coefficients are new: write the matrix. Nullable: there is none. */
  void (*expand)(ms_linear *self);
  /* Make ready to solve. kind: MSIM_FACTOR_.... Nullable. */
  msim_status (*factor)(ms_linear *self, int32_t kind, msim_error *err);
  /* A y = b; y: 0 in, solution out. */
  msim_status (*solve)(ms_linear *self, const ms_target *target, const double *b, double *y,
                       int64_t *iterations, msim_error *err);
  /* Conjugate gradients from y = 0 as far as d says, after factor() for symmetric systems. Where A
   * is not positive definite, parts of it are left out (compression.h), which the next calls take
   * in again. Nullable: only solves. */
  void (*descend)(ms_linear *self, const ms_descent *d, const double *b, double *y,
                  int64_t *iterations);
  /* z = P r, P as in descend(). Nullable: there is no P but solve(). */
  void (*precondition)(ms_linear *self, const double *r, double *z);
  /* Forget what earlier systems left. Nullable. */
  void (*restart)(ms_linear *self);
  void (*destroy)(ms_linear *self);
} ms_linear_ops;

struct ms_linear {
  const ms_linear_ops *ops;
  const ms_system *system;
  const char *name;
  int symmetric;   /* can solve systems that are not positive definite */
  int unsymmetric; /* nor symmetric */
  int factorises;  /* factor() factors a matrix */
  int exact;       /* answers are right to rounding: nothing to check */
  int met;         /* the last solve has seen its true residual reach the goal */
  double residual; /* that residual, ||b - A y|| */
  int64_t analyses;
  int32_t aggregates;                          /* of a coarse space; 0: there is none */
  double fill, flops;                          /* of one factorisation */
  int64_t coarse_factors, kept_coarse_factors; /* since creation */
};

/* A is diagonal where no spring pulls: y = b / (m + h b). */
msim_status ms_diagonal_create(const ms_system *system, ms_linear **linear, msim_error *err);

/* Conjugate gradients, matrix free, with block Jacobi and the coarse space of aggregates of so many
 * rows; 0: block Jacobi alone. */
msim_status ms_pcg_create(const ms_system *system, const msim_options *opt, int32_t aggregate,
                          ms_linear **linear, msim_error *err);

/* A backend of the ABI, by name: opt's own, linked in, or from a plugin. */
msim_status ms_adapter_create(const ms_system *system, const char *name, const msim_options *opt,
                              ms_linear **linear, msim_error *err);

#endif
