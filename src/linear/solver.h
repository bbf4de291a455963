/* solver - solves the linear systems of implicit steps: selects a linear solver, lags factors,
 * treats matrices that are not positive definite, and verifies each solution */
#ifndef MS_SOLVER_H
#define MS_SOLVER_H

#include "base/archive.h"
#include "linear/bicgstab.h"
#include "linear/elimination.h"
#include "linear/lagged_factor.h"
#include "linear/momentum.h"

/* Amortization: cholmod computes a factor once pcg has spent its cost on a matrix that hardly
 * changes. */
typedef struct ms_amortization {
  int allowed;
  ms_linear *cholmod; /* NULL: not opened */
  double flops;       /* of pcg since the matrix changed, or since cholmod computed a factor */
  int64_t solves;     /* solves that took them */
} ms_amortization;

/* The data from which a factorization was computed. A resumed run computes it again from them, to
 * the bit. */
typedef struct ms_linearization_point {
  double *x; /* NULL: not recorded, as no factor is lagged, or as A does not depend on x */
  ms_constraint *constraint; /* nconstraints constrained unknowns; NULL where there can be none */
  double h;
  int32_t clamped, kind, nconstraints;
} ms_linearization_point;

typedef struct ms_solver {
  ms_linear_system system;
  const msim_options *opt;
  ms_linear *linear;
  ms_linear_target target;
  int may_switch; /* 1: auto selected pcg, and may still replace it by cholmod */
  ms_lagged_factor lagged_factor;
  ms_amortization amortization;
  double constant_h;                   /* h of the constant matrix that is factored; 0: none */
  double h;                            /* of the present matrix */
  double creation_h;                   /* h at creation, for which the linear solver was selected */
  ms_linearization_point lagged_point; /* of the lagged factor */
  ms_linearization_point coarse_point; /* of the coarse factor of pcg */
  msim_stats *stats;
  ms_momentum_components components;
  ms_bicgstab bicgstab;       /* for pcg and auto, with Newton's method and damping; else empty */
  ms_elimination elimination; /* likewise, with few unknowns */
  double *b;                  /* the right-hand side of a spec with a base */
  double *residual, *correction, *magnitude; /* work vectors, those of `linear` if it has any */
  double relative_residual; /* ||b - A v|| / ||b|| of the last solve, in ms_jacobi_norm() */
  int incomplete;           /* 1: the last solution is the iterate at the limit of iterations */
  int32_t offender;         /* the offending unknown of the last status != MSIM_OK; -1: none */
  char reason[256];         /* why this linear solver: text for `explain` */
} ms_solver;

/* opt must outlive the solver. h: the step, for solver = auto. stats receives the counts. Later
 * calls allocate nothing, except within CHOLMOD and KLU, and where auto opens cholmod (5 and 6
 * below). */
msim_status ms_solver_create(const ms_model *model, const msim_options *opt, double h,
                             msim_stats *stats, ms_solver **solver, msim_error *err);
/* After all ranks have created theirs; collective. */
static inline msim_status ms_solver_connect(ms_solver *solver, msim_error *err) {
  ms_linear *linear = solver->linear;
  return linear->ops->connect ? linear->ops->connect(linear, err) : MSIM_OK;
}
void ms_solver_destroy(ms_solver *solver);

/* For Newton's method, whose specs may have a v: with solver = auto or pcg, also create solvers for
 * the damping derivative, unless the one selected takes it. */
msim_status ms_solver_create_unsymmetric(ms_solver *solver, msim_error *err);

/* Linear system spec: which matrix, and how accurate a solution. */
typedef struct ms_linear_system_spec {
  const double *x; /* positions: A(x, h) */
  double h;
  const double *v;     /* velocities: A(x, v, h), with the damping derivative; NULL: without it */
  int use_elimination; /* with v: 1 for elimination in place of BiCGStab, where unknowns are few */
  ms_constraint *constraint; /* nholds constrained unknowns */
  int32_t nconstraints;
  int clamp;          /* 1: the clamped matrix, which is always positive definite */
  int32_t indefinite; /* MSIM_INDEFINITE_...: the treatment of an A that is not positive definite;
                         -1: none, MSIM_NOT_SPD is returned */
  double rtol;        /* of the residual */
  int32_t max_iterations; /* 0: that of the options */
  const double *base;     /* the solution is a change from this velocity: the right-hand side is
                         b - (A - M) base, with the matrix that is finally used; NULL: b */
  const double *guess;    /* initial guess of the solution; NULL: 0. rtol stays relative to the
                          right-hand side, so that a better guess takes fewer iterations */
  int continues; /* 1: the last matrix may serve, but for its constraints: it is tested whether x
                          and h are the same. It stays clamped, and a coarse factor is kept. */
} ms_linear_system_spec;

/* v = A(x, h)^-1 b. v: the solution on output, undefined unless MSIM_OK; iterations start from 0.
 *
 * The pattern is analysed once, at creation. A new x requires a new factorization, unless the
 * matrix is scalar (force.h): it is then the same for every x, and factored once for each h.
 * Each solution is verified by its true residual, ||b - A v|| <= rtol ||b||, or at rounding level,
 * 8 eps (|A||v| + |b|), in the norm sqrt(r.D^-1 r), D the diagonal blocks (jacobi.h). A last
 * correction conserves momentum (momentum.h). Variants and fallbacks, which stats counts:
 *   1. solver = auto with a factorization: conjugate gradients preconditioned by the lagged factor,
 *      while their iterations cost no more than a solve did on average since it was computed; else
 *      a new factorization.
 *   2. Iterative refinement, up to 3 steps, if the residual of a factorization is too large.
 *   3. If A is found not positive definite, according to `indefinite`: the system is solved again
 *      with the clamped matrix, or as it is, or the result is MSIM_NOT_SPD. With the clamped matrix
 *      also where an iterative solver finds A nearly singular.
 *   4. MSIM_NOT_CONVERGED if the residual is still too large, except that with incomplete =
 *      accept the last iterate of an iterative solver is the solution (`incomplete`), and that
 *   5. auto replaces pcg by cholmod for good, if cholmod is available.
 *   6. auto computes a factorization by cholmod where pcg has spent its cost on a matrix that
 *      hardly changes; it preconditions as in 1 until it fails.
 * MSIM_NOT_FINITE: b, A or v has NaN or numbers beyond MS_LARGEST_VALID. */
msim_status ms_solver_solve(ms_solver *solver, const ms_linear_system_spec *spec, const double *b,
                            double *v, msim_error *err);

/* v = A^-1 b to the relative residual rtol, with the matrix and the factor of the last solve, which
 * succeeded */
msim_status ms_solver_solve_again(ms_solver *solver, double rtol, const double *b, double *v,
                                  msim_error *err);

/* v_i = A^-1 b_i likewise, for n right-hand sides: without refinement, where the linear solver has
 * a factorization. room: 2 n vectors */
msim_status ms_solver_solve_several(ms_solver *solver, double rtol, int32_t n, double *const *b,
                                    double *const *v, double *room, msim_error *err);

/* 1: specs may have a v, because springs are damped and a solver for non-symmetric matrices exists:
 * the one selected, or BiCGStab or elimination beside it. */
int ms_solver_supports_damping_derivative(const ms_solver *solver);

/* 1: systems with v are solved by BiCGStab, even where elimination is allowed. */
static inline int ms_solver_needs_bicgstab(const ms_solver *solver) {
  return !solver->linear->unsymmetric && !solver->elimination.a;
}

/* To be called once before ms_solver_descend(). */
static inline msim_status ms_solver_prepare_descent(ms_solver *solver, msim_error *err) {
  ms_linear *linear = solver->linear;
  return linear->ops->prepare_descent ? linear->ops->prepare_descent(linear, err) : MSIM_OK;
}

/* A descent direction v, b.v > 0, by conjugate gradients on A(x, h) from 0 to the relative residual
 * request->rtol (ms_linear_ops.descend). Not where ms_solver_can_descend() is 0. */
int ms_solver_can_descend(const ms_solver *solver);
msim_status ms_solver_descend(ms_solver *solver, const ms_linear_system_spec *spec, const double *b,
                              double *v, msim_error *err);

/* Discard lagged factors, so that later solves depend on the state alone. */
void ms_solver_discard_factors(ms_solver *solver);

/* The model has moved to another address, unchanged. */
static inline void ms_solver_set_model(ms_solver *s, const ms_model *model) {
  s->system.model = model;
  if (s->linear->ops->set_model) s->linear->ops->set_model(s->linear);
}

/* For solver_state.c: */
/* Let `by`, a linear solver of this one, compute its factorization at a linearization point. */
msim_status ms_solver_factor_at(ms_solver *solver, ms_linear *by,
                                const ms_linearization_point *origin, msim_error *err);
/* 1: specs may have constraints. */
int ms_solver_may_have_constraints(const ms_solver *solver);
/* Replace pcg by cholmod for good; open cholmod beside pcg, for factors that precondition; drop
 * these for good. */
msim_status ms_solver_switch_to_cholmod(ms_solver *solver, msim_error *err);
msim_status ms_solver_add_cholmod(ms_solver *solver, msim_error *err);
void ms_solver_drop_lagged_factor(ms_solver *solver);

/* To be called after a change of the springs, which must leave a scalar matrix scalar, and others
 * not. */
void ms_solver_update_springs(ms_solver *solver);

#endif
