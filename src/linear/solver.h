/* solver - the policy over linear solvers: which one, what is new, what happens when A is not
 * positive definite, and whether the answer is good enough. Backends obey. */
#ifndef MS_SOLVER_H
#define MS_SOLVER_H

#include "base/bytes.h"
#include "linear/bicgstab.h"
#include "linear/elimination.h"
#include "linear/kept.h"
#include "linear/momentum.h"

/* What pcg spends on a matrix that hardly changes would buy a factor of it. */
typedef struct ms_savings {
  int allowed;
  ms_linear *cholmod; /* NULL: nobody has looked whether it is there */
  double flops;       /* saved since the matrix last changed, or a factor was bought */
  int64_t steps;      /* that did */
} ms_savings;

/* What a factor was made from. From that it is made again, to the bit. */
typedef struct ms_origin {
  double *x;     /* NULL: nobody asks, as no factor is kept, or as A is the same for every x */
  ms_hold *hold; /* nholds rows that planes held; NULL where none can */
  double h;
  int32_t clamped, kind, nholds;
} ms_origin;

typedef struct ms_solver {
  ms_system system;
  const msim_options *opt;
  ms_linear *linear;
  ms_target target;
  int may_switch; /* auto took pcg: cholmod stands behind it */
  ms_kept kept;
  ms_savings savings;
  double made_for;     /* h of the constant matrix that is factored; 0: there is none */
  double h;            /* of the matrix at hand */
  double planned;      /* h that it was chosen for, at creation */
  ms_origin by_kept;   /* of the kept factor */
  ms_origin by_coarse; /* of the coarse factor */
  msim_stats *stats;
  ms_free_components components;
  ms_bicgstab bicgstab;       /* for pcg and `auto`, where springs are damped; else empty */
  ms_elimination elimination; /* the same, where there are few unknowns */
  double *b;                  /* the right-hand side of a request with a base */
  double *residual, *correction, *magnitude; /* work vectors */
  double reached;   /* ||b - A v|| / ||b|| of the last solve, in ms_jacobi_norm() */
  int32_t culprit;  /* the row to blame for the last status != MSIM_OK; -1: none in particular */
  char reason[256]; /* why this solver, for people */
} ms_solver;

/* opt lives as long as the solver; h: the step, for `auto`; nonlinear: for Newton's method, whose
 * requests may have a v. Counts go to stats. Set up once:
 * nothing is allocated later but by CHOLMOD and KLU, or where `auto` changes its mind (5. and 6.
 * below). */
msim_status ms_solver_create(const ms_model *model, const msim_options *opt, double h,
                             int nonlinear, msim_stats *stats, ms_solver **solver, msim_error *err);
void ms_solver_destroy(ms_solver *solver);

/* Which matrix, and how well. */
typedef struct ms_request {
  const double *x; /* A(x, h) */
  double h;
  const double *v; /* A(x, v, h), with what the turning of dashpots adds; NULL: without */
  int direct;      /* with v: by elimination in place of BiCGStab, where there are few unknowns */
  ms_hold *hold;   /* nholds rows that are held */
  int32_t nholds;
  int clamp;          /* the clamped matrix: positive definite always */
  int32_t indefinite; /* MSIM_INDEFINITE_...: what follows where A is not; -1: it is told */
  double rtol;        /* of the residual */
  const double *base; /* the solution is a change from this velocity: the right-hand side is
                         b - (A - M) base, by the matrix that is finally used; NULL: b */
} ms_request;

/* v = A(x, h)^-1 b. v: solution out, scratch unless MSIM_OK; iterations begin with 0.
 *
 * The pattern is analysed once, at creation; a factor is made in every solve, because x is new. A
 * matrix of scalars (force.h) is the same for every x: it is assembled and factored once for an h.
 * The true residual is checked after every solve: ||b - A v|| <= rtol ||b||, or at rounding level,
 * 8 eps (|A||v| + |b|), in the norm sqrt(r.D^-1 r) of the diagonal blocks D (jacobi.h). Last of
 * all momentum is balanced (momentum.h). What follows what, each counted in stats:
 *   1. `auto` with a factorisation: the kept factor preconditions conjugate gradients, where the
 *      iterations cost no more than a step did on average since it was made; else a new factor.
 *   2. A factor whose answer is above the residual gets up to 3 steps of iterative refinement.
 *   3. A found not positive definite: as asked, the step is repeated with the clamped matrix, or
 *      solved as it is, or given up with MSIM_NOT_SPD.
 *   4. An answer above the residual is MSIM_NOT_CONVERGED, except that
 *   5. `auto`, where pcg did not converge, goes on with cholmod for good, if it is there.
 *   6. `auto`, where pcg has spent on a matrix that hardly changes what a factor of it costs, has
 *      cholmod make one, which takes part as in 1. until it is no help. */
msim_status ms_solver_solve(ms_solver *solver, const ms_request *request, const double *b,
                            double *v, msim_error *err);

/* 1: requests may have a v, as springs are damped and there is a solver for such matrices: the one
 * chosen, BiCGStab preconditioned by it, or elimination. */
int ms_solver_takes_turning(const ms_solver *solver);

/* v downhill, b.v > 0, to the residual r->rtol: conjugate gradients on A(x, h) from 0, as
 * ms_linear_ops.descend. Where ms_solver_descends() is 0 the solver can only solve. */
int ms_solver_descends(const ms_solver *solver);
msim_status ms_solver_descend(ms_solver *solver, const ms_request *request, const double *b,
                              double *v, msim_error *err);

/* Forget the kept factor: what follows depends on the state alone. */
void ms_solver_restart(ms_solver *solver);

/* 1: `auto` chose it, or its coarse space is made, by h and the springs at its creation. */
int ms_solver_is_chosen(const ms_solver *solver);

/* What solves to come owe to solves made: who solves, the factors that are kept, and what decides
 * on their use. Taken by a solver just created with the same h, and springs where it is chosen: it
 * solves to the same bits, and may have no use after a failure, or where the bytes are wrong. */
msim_status ms_solver_history(ms_bytes *bytes, ms_solver *solver, msim_error *err);

/* For that: a factor by one of the solver's own, of the matrix that it was made from. */
msim_status ms_solver_make(ms_solver *solver, ms_linear *by, const ms_origin *origin,
                           msim_error *err);
/* 1: requests may hold rows. */
int ms_solver_may_hold(const ms_solver *solver);
/* `auto` takes cholmod in the place of pcg, or lets it make factors beside, or never. */
msim_status ms_solver_switch(ms_solver *solver, msim_error *err);
msim_status ms_solver_add_cholmod(ms_solver *solver, msim_error *err);
void ms_solver_drop_kept(ms_solver *solver);

/* The model's springs are others. Whether its matrix is one of scalars must not have changed. */
void ms_solver_renew(ms_solver *solver);

#endif
