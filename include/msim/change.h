/* change.h - changes of a sim between steps: springs, forces, pins, colliders, particles;
 * conventions: msim.h */
#ifndef MSIM_CHANGE_H
#define MSIM_CHANGE_H

#include "msim/options.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Continue from the present state with another step size h: s, > 0, or MSIM_H_AUTO. The end stays:
 * t_end, or the number of steps left of options.steps. Matrices get new values, nothing is analyzed
 * anew, except with respa, which splits the springs anew. An open recorder keeps its planned
 * frames. Under error control h is the next step to try; refused with integrator = auto. */
MSIM_API msim_status msim_sim_set_step(msim_sim *sim, double h, msim_error *err);

/* Change the springs of this sim, not of its scene. Matrices get new values; they are analyzed anew
 * only if all rest lengths and dampings were 0 or become 0. The step size stays, even if
 * MSIM_H_AUTO chose it for the old springs; but integrator = auto starts a new run from the present
 * state. New solvers may return plugin statuses. Nullable: k, rest, damping (unchanged). */
MSIM_API msim_status msim_sim_set_springs(msim_sim *sim, const double *k /* nsprings */,
                                          const double *rest /* nsprings */,
                                          const double *damping /* nsprings */, msim_error *err);

/* Change gravity, drag or the constant forces of this sim, not of its scene: a run with the new
 * forces starts from the present state, as in a sim that is created with them and gets that state
 * by msim_sim_set_state. The end stays: t_end, or the number of steps left of options.steps. The
 * step size stays, even if MSIM_H_AUTO chose it; integrator = auto chooses its method anew. Nothing
 * is analyzed anew, except with respa, and where forces leave the plane of a planar scene or no
 * longer do. Checkpoints contain the changes. MSIM_ERR_ARG also where the method cannot handle
 * drag. May return plugin statuses. Nullable: force (none). */
MSIM_API msim_status msim_sim_set_gravity(msim_sim *sim, const double gravity[3], msim_error *err);
MSIM_API msim_status msim_sim_set_drag(msim_sim *sim, double drag /* >= 0 */, msim_error *err);
MSIM_API msim_status msim_sim_set_forces(msim_sim *sim, const double *force /* 3n */,
                                         msim_error *err);

/* Move pinned particles on straight lines from where they are to x, from now on within `duration`
 * s; there they rest. This replaces a motion that they have, and starts a run like
 * msim_sim_set_gravity. Refused where msim_scene_add_motion says. */
MSIM_API msim_status msim_sim_move_pinned(msim_sim *sim, int32_t n,
                                          const int32_t *particles /* n */,
                                          const double *x /* 3n */, double duration /* > 0 */,
                                          msim_error *err);

/* Move a collider on a straight line from where it is to x, the position of `center` or of the
 * middle of its axis, and by a rotation vector that changes linearly to `rotation`
 * (msim_collider_motion), from now on within `duration` s; there it rests. This replaces a motion
 * that it has, and starts a run like msim_sim_set_gravity. Nullable: rotation (stays). */
MSIM_API msim_status msim_sim_move_collider(msim_sim *sim, int32_t collider,
                                            const double *x /* 3 */, const double *rotation /* 3 */,
                                            double duration /* > 0 */, msim_error *err);

/* Pin particles where they are (pinned = 1), which ends their velocities and motions, or let them
 * go with the velocities that they have (0). This starts a run like msim_sim_set_gravity; all
 * matrices are analyzed anew, as they have other unknowns. */
MSIM_API msim_status msim_sim_set_pinned(msim_sim *sim, int32_t n, const int32_t *particles /* n */,
                                         int32_t pinned, msim_error *err);

/* Remove and add particles and springs, also angular ones, of this sim, not of its scene: a run
 * with the others starts from the present state like msim_sim_set_gravity, as in a sim created from
 * the edited scene. What stays continues in its state, what is added starts with the given x and v,
 * and the energy that both change counts as work. Only islands that differ are built and analyzed
 * anew; integrator = auto and respa build all. Checkpoints contain the edited scene, and are loaded
 * into a sim of the original one. Recorders opened before refuse further frames. Time grows with
 * the number of particles and springs of the whole scene: make one edit of many changes. Faces and
 * removed indices as msim_scene_edit. May return plugin statuses. */
MSIM_API msim_status msim_sim_edit(msim_sim *sim, const msim_edit *edit, msim_error *err);

/* Break springs by hand, as the thresholds of laws do: from now on they exert no force, and keep
 * their indices; nothing is analyzed anew, times and frames go on, and open recorders write on.
 * Springs stay broken, whatever is set later; a checkpoint from before has them whole. Their energy
 * is lost, as it is there. Only in scenes that have a law with break_strain or break_force:
 * MSIM_ERR_ARG. */
MSIM_API msim_status msim_sim_break(msim_sim *sim, int32_t n, const int32_t *springs /* n */,
                                    msim_error *err);

#ifdef __cplusplus
}
#endif
#endif
