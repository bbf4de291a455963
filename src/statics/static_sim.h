/* static_sim - a sim of the same scene without damping and drag, at rest in the present state of
 * another sim, by which equilibria and modes are computed */
#ifndef MS_STATIC_SIM_H
#define MS_STATIC_SIM_H

#include "sim/sim.h"

/* MSIM_ERR_UNSUPPORTED: forces depend on time or velocity, colliders move, or several ranks share
 * the scene. `function` names the caller. */
msim_status ms_static_sim_check(const msim_sim *of, const char *function, msim_error *err);

/* The linear solver. MS_STATIC_FAST: pcg. MS_STATIC_EXACT: that of the other sim, where it is auto
 * cholmod, if it is available, which finds out whether a matrix is positive definite. */
enum { MS_STATIC_FAST, MS_STATIC_EXACT };

/* A sim of one system with 3 components, with the solver and the work vectors of implicit-euler. On
 * failure nothing is left. */
msim_status ms_static_sim_create(msim_sim *of, int kind, msim_sim **sim, msim_error *err);

/* MSIM_STOPPED: msim_sim_stop was called for `of`. */
msim_status ms_static_sim_check_stop(msim_sim *of, msim_error *err);

/* Start at rest in the positions x (3n) with steps of h. */
msim_status ms_static_sim_start(msim_sim *sim, const double *x, double h, msim_error *err);

/* Relative residual of linear systems: modes need solutions to rounding. */
#define MS_STATIC_RTOL 1e-12

/* A(x, h) = M + h^2 K of the sim's one system in the present positions: v = A^-1 b, in which the
 * contacts of its stepper, if it has found any, hold particles. MSIM_NOT_SPD: K has an eigenvalue
 * below -1/h^2, with respect to M. */
msim_status ms_static_sim_solve(msim_sim *sim, double h, const double *b, double *v,
                                msim_error *err);

/* The same, with *h halved until the matrix is positive definite and the solver converges. */
msim_status ms_static_sim_solve_definite(msim_sim *sim, double *h, const double *b, double *v,
                                         msim_error *err);

/* The same for another b, with the matrix and the factor of the last solve, which succeeded. */
msim_status ms_static_sim_solve_again(msim_sim *sim, const double *b, double *v, msim_error *err);

/* v_i = A^-1 b_i for n right-hand sides, likewise, but not refined. room: 2 n vectors */
msim_status ms_static_sim_solve_several(msim_sim *sim, int32_t n, double *const *b,
                                        double *const *v, double *room, msim_error *err);

#endif
