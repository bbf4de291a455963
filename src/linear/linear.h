/* linear - the interface of linear solvers, built in or from plugins, to solver.c */
#ifndef MS_LINEAR_H
#define MS_LINEAR_H

#include "linear/sparse_matrix.h"

/* The matrix A of one step. */
typedef struct ms_linear_system {
  const ms_model *model;
  ms_coefficients a;                        /* A without the damping derivative: symmetric */
  ms_damping_derivative damping_derivative; /* v NULL: none, and A is symmetric */
  int clamped;   /* a is that of the clamped matrix: positive definite, up to rounding */
  int continues; /* a is, but for its constraints, the matrix of the last solve */
} ms_linear_system;

/* y = A x, with the conventions of ms_coefficients_apply on padding */
static inline void ms_linear_system_apply(const ms_linear_system *s, const double *x, double *y) {
  ms_coefficients_apply(s->model, &s->a, x, y);
  if (s->damping_derivative.v) ms_damping_derivative_apply(s->model, &s->damping_derivative, x, y);
}

/* Tolerance and limit of a solve: ||b - A y|| <= rtol size */
typedef struct ms_linear_target {
  double rtol;
  double size; /* ||b|| (jacobi.h), for msim's own iterations */
  int32_t max_iterations;
} ms_linear_target;

/* Tolerance and limit of descend(), either of which ends it */
typedef struct ms_descent_target {
  double rtol; /* of the residual sqrt(r.B r), B ~ A^-1 the preconditioner */
  int32_t max_iterations;
} ms_descent_target;

typedef struct ms_linear ms_linear;

/* Order of calls: create, connect where there are ranks, (expand, factor+, solve+)+, destroy. */
typedef struct ms_linear_ops {
  /* Once, after all ranks that share the system have created theirs; collective. Nullable. */
  msim_status (*connect)(ms_linear *self, msim_error *err);
  /* Write the matrix of new coefficients. Nullable: matrix-free. */
  void (*expand)(ms_linear *self);
  /* Compute a factorization or a preconditioner. kind: MSIM_FACTOR_.... Nullable. */
  msim_status (*factor)(ms_linear *self, int32_t kind, msim_error *err);
  /* A y = b; y: 0 on input, the solution on output. Adds to *iterations. */
  msim_status (*solve)(ms_linear *self, const ms_linear_target *target, const double *b, double *y,
                       int64_t *iterations, msim_error *err);
  /* A y_i = b_i for n right-hand sides, by the factorization alone, where `substitutes` is 1. room:
   * 2 n vectors without padding. */
  msim_status (*substitute)(ms_linear *self, int32_t n, double *const *b, double *const *y,
                            double *room, msim_error *err);
  /* Once, before the first descend(); where that fails, destroy() may follow. Nullable. */
  msim_status (*prepare_descent)(ms_linear *self, msim_error *err);
  /* A descent direction y, b.y > 0, by conjugate gradients from y = 0, after factor() with
   * MSIM_FACTOR_SYMMETRIC. Where A is not positive definite, the compression of springs is reduced
   * in it (compression.h); later calls restore most of that. Nullable. */
  void (*descend)(ms_linear *self, const ms_descent_target *d, const double *b, double *y,
                  int64_t *iterations);
  /* z = B r, B as in ms_descent_target. Nullable: only solve() preconditions. */
  void (*precondition)(ms_linear *self, const double *r, double *z);
  /* The model of the system has another address. Nullable: it is not kept. */
  void (*set_model)(ms_linear *self);
  /* Discard all factors of earlier systems. Nullable. */
  void (*restart)(ms_linear *self);
  void (*destroy)(ms_linear *self);
} ms_linear_ops;

struct ms_linear {
  const ms_linear_ops *ops;
  const ms_linear_system *system;
  const char *name;
  int symmetric;      /* solves symmetric systems that are not positive definite */
  int unsymmetric;    /* solves non-symmetric systems */
  int factorizes;     /* factor() computes a factorization of A */
  int substitutes;    /* substitute() is there */
  int exact;          /* solutions are exact to rounding: no check */
  int is_verified;    /* the last solve has verified that its true residual is within the target */
  double residual;    /* that residual, ||b - A y|| */
  double *work[3];    /* vectors that others may use between its calls; NULL: it has none */
  int64_t analyses;   /* symbolic analyses made */
  int32_t aggregates; /* of the coarse space; 0: no coarse space */
  double fill, flops; /* of one factorization: numbers in the factor, operations */
  int64_t coarse_factors, reused_coarse_factors; /* since creation: computed; reused */
};

/* The solver for a diagonal A, where no spring couples unknowns: y_i = b_i / (m_i + h drag). */
msim_status ms_diagonal_create(const ms_linear_system *system, ms_linear **linear, msim_error *err);

/* A coarse space (coarse.h) */
typedef struct ms_coarse_size {
  int32_t aggregate; /* unknowns in an aggregate, approximately; 0: there is none */
  int32_t cluster;   /* aggregates in a cluster of the cycle; 0: there is none where the factor of
                        P^T A P would be small */
} ms_coarse_size;

/* Matrix-free conjugate gradients with block Jacobi and a coarse space */
msim_status ms_pcg_create(const ms_linear_system *system, const msim_options *opt,
                          ms_coarse_size size, ms_linear **linear, msim_error *err);

/* A backend of the plugin ABI by its name: one of opt->backends, linked in, or from a plugin. */
msim_status ms_adapter_create(const ms_linear_system *system, const char *name,
                              const msim_options *opt, ms_linear **linear, msim_error *err);

#endif
