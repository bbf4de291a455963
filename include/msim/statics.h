/* statics.h - equilibrium and natural vibrations of a sim's scene; conventions: msim.h */
#ifndef MSIM_STATICS_H
#define MSIM_STATICS_H

#include "msim/options.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How msim_sim_equilibrium ended. Members may be added at the end. */
typedef struct msim_equilibrium {
  size_t size;
  double force;       /* N: the largest force on a free particle that nothing balances */
  int32_t particle;   /* which has it */
  int32_t iterations; /* of Newton's method */
  int32_t saddles;    /* equilibria that were left, as they are no minimum of the energy */
  int32_t is_minimum; /* 1: no small displacement lowers the energy: the stiffness matrix, in
                         contact with the curvature of obstacles, has no negative eigenvalue; 0: not
                         known, as a particle touches an obstacle with friction, or samples, or as
                         the linear solver does not converge */
} msim_equilibrium;

/* Move the particles to an equilibrium near the present state, where the forces on each free one
 * sum up to at most `ftol` (N, > 0): a local minimum of elastic and potential energy, at the
 * present positions of pinned particles. Velocities become 0; the time stays. Damping and drag have
 * no effect. Any method of the sim will do.
 *
 * MSIM_NOT_CONVERGED: none was found in so many iterations of Newton's method, or there is none, as
 * gravity moves a body that nothing supports, or a spring would break: the message says which.
 * MSIM_ERR_UNSUPPORTED: self-contact, forces that depend on time or velocity, colliders that move,
 * several ranks. MSIM_STOPPED: msim_sim_stop.
 * After an error the state is as it was. Nullable: result. */
MSIM_API msim_status msim_sim_equilibrium(msim_sim *sim, double ftol,
                                          int32_t max_iterations /* >= 1 */,
                                          msim_equilibrium *result, msim_error *err);

/* Compute the n lowest natural frequencies of small undamped vibrations about the present state,
 * ascending: K u = (2 pi f)^2 M u, K the stiffness matrix, M the masses. f (Hz) is 0 where a motion
 * meets no stiffness, as that of a free body, and negative, -sqrt(-w^2)/(2 pi), where the state is
 * unstable. shape: the motions u of all particles, with u.M u = 1 and u_i.M u_j = 0, 0 for pinned
 * ones. Contacts and drag have no effect.
 *
 * MSIM_ERR_ARG: n is not in 1 .. 3 times the number of free particles. MSIM_ERR_UNSUPPORTED: as
 * above, but for self-contact. MSIM_NOT_CONVERGED. MSIM_STOPPED. Nullable: shape. */
MSIM_API msim_status msim_sim_modes(msim_sim *sim, int32_t n, double *frequency /* n */,
                                    double *shape /* n x 3 nparticles */, msim_error *err);

#ifdef __cplusplus
}
#endif
#endif
