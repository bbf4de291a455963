/* sim - the simulation object: a scene, the plan of its run, the state of each island, the
 * integration method, and the monitors of energy and errors */
#ifndef MS_SIM_H
#define MS_SIM_H

#include <stdatomic.h>
#include <string.h>

#include "layout/rank_part.h"
#include "contact/self_contact.h"
#include "sim/energy_monitor.h"
#include "sim/error_growth.h"
#include "sim/run_state.h"

/* The simulation of one island: particles that no spring connects with other islands. */
typedef struct ms_island_sim {
  ms_model model;
  ms_stepper stepper; /* stepper.solver: NULL where the method needs none */
  int at_rest;        /* exact rest: steps would change no bit, and are skipped */
  int at_rest_next;   /* at_rest after the step that is being made */
  int single_thread;  /* one thread steps this island while others step other islands */
  msim_stats stats;   /* single_thread: counts of this island, until they are added to the sim's */
  msim_status status; /* single_thread: result of the step that is being made */
  int is_reused;      /* while islands are built: 1 + the old island that this one is; 0: none */
  ms_self_contact *self_contact; /* NULL: surfaces pass through each other */
  ms_norm norm;                  /* scales of errors, with a tol */
  double error;                  /* of the step that is being made, over what is allowed */
  ms_last_good_state last_good;
  ms_island_verification verification;
  ms_disturbance disturbance;
} ms_island_sim;

/* A list of freed arrays of the state; together they are shorter than the present ones. */
typedef struct ms_retired_state {
  struct ms_retired_state *next;
  double *arrays[3];
} ms_retired_state;

enum { MS_SCENE_HASHES = 9 }; /* hashed arrays of a scene (checkpoint/fingerprint.h) */

/* Islands that an edit of the scene has left as they were (reuse.h) */
struct ms_island_reuse;

struct msim_sim {
  msim_allocator alloc;
  ms_ranks *ranks;                 /* that share the scene; NULL: one process has all of it */
  ms_rank_part *part;              /* what this rank computes; NULL likewise */
  struct ms_rank_section *section; /* what this rank has for output; NULL: not requested */
  int ranks_stop;                  /* 1: the ranks have agreed to stop after the step just made */
  ms_scene *scene;                 /* reference counted; where `kept` is set, a part of the whole */
  struct ms_rank_scene *kept;      /* what this rank keeps of the scene; NULL: all of it */
  ms_scene *created_from; /* has the forces and pins of the creation; NULL: `scene` has them */
  ms_scene *edited_from;  /* the scene before the first edit; NULL: there was none */
  int64_t edits;          /* changes of particles and springs, by edits and checkpoints */
  ms_scene *chosen_for;   /* solvers were chosen for its springs; NULL: for those of `scene` */
  ms_config config;
  ms_run_state run;
  /* what options.solver, solver_options and plugin_path point to; nullable */
  char *solver, *solver_options, *plugin_path;
  ms_pool *pool;           /* NULL: one thread */
  int32_t threads_planned; /* exceeds the threads of the pool if some could not be started */
  msim_stats stats;
  atomic_int stop;
  msim_status last_status; /* of the last call that made or checked steps, for msim_sim_advice */
  int in_observer;         /* 1: the observer of msim_sim_run is being called */
  int is_in_batch;         /* 1: msim_sim_step_many is stepping it */

  int32_t nislands;       /* at least 1 */
  ms_island_sim *islands; /* nislands; built anew when the components of space change */
  int any_single_thread;  /* 1: threads step several islands at the same time */

  uint64_t scene_hashes[MS_SCENE_HASHES]; /* hashes of the scene's arrays, see fingerprint.h */
  int scene_is_hashed;

  /* 3n, particle order: the state as last requested. Several ranks may not have them: before they
   * are requested for the first time */
  double *state_x, *state_v, *state_v_half;
  int state_is_current;      /* without arrays: the state is that of the scene */
  int32_t state_capacity;    /* particles of these arrays */
  ms_retired_state *retired; /* arrays that were too small: borrowed pointers stay valid */

  struct ms_island_reuse *reuse;     /* while islands are built for an edited scene; else NULL */
  const struct ms_island_sims *like; /* while islands are built: those with which new models share
                                        what they can (ms_model_create_like), if scene and axis
                                        left out are the same; else NULL */

  int contacts_known;     /* the contact logs of all islands are those of the last step */
  msim_contact *contacts; /* as last requested; NULL: none */

  int32_t *island_of;      /* of msim_sim_islands, as last requested; NULL: none */
  double *island_energies; /* likewise */

  ms_energy_monitor monitor;
  ms_error_growth error_growth;

  ms_text explanation;
  struct ms_matrix_export *matrix_export; /* for msim_sim_matrix; NULL: not requested */
};

/* 1: error control chooses the length of each step. */
static inline int ms_sim_has_control(const msim_sim *sim) { return sim->config.opt.tol > 0; }

/* 1: the integrator is `auto`. */
static inline int ms_sim_selects(const msim_sim *sim) { return sim->config.choice.tol > 0; }

/* The time of the state that msim_sim_state returns, s. */
static inline double ms_sim_time(const msim_sim *sim) {
  if (ms_sim_has_control(sim)) return sim->run.t_shown;
  return sim->config.plan.t0 + (double)(sim->run.step - sim->run.step0) * sim->run.h;
}

/* Build all islands, without components along the axis left_out (-1: with all three); on failure
 * the old ones stay. The caller then has to set the state. */
msim_status ms_sim_build_islands(msim_sim *sim, int32_t left_out, msim_error *err);

/* The linear solver of an island for steps of h; on failure it may be there, and must be destroyed.
 */
msim_status ms_sim_create_solver(msim_sim *sim, const ms_island_sim *m, double h,
                                 ms_solver **solver, msim_error *err);

/* The islands that ms_sim_detach_islands takes out of a sim */
typedef struct ms_island_sims {
  int32_t n;
  ms_island_sim *islands;
  int any_by_one;
} ms_island_sims;

/* The parts of ms_sim_build_islands: put the old islands aside and make new ones. Then either drop
 * the old ones, or put them back, which destroys the new ones, partly built or not. */
ms_island_sims ms_sim_detach_islands(msim_sim *sim);
msim_status ms_sim_create_islands(msim_sim *sim, int32_t left_out, msim_error *err);
void ms_sim_destroy_detached(msim_sim *sim, const ms_island_sims *old);
void ms_sim_restore_islands(msim_sim *sim, const ms_island_sims *old);

/* Let the islands that will be built for a new sim share the models of another one, which loses its
 * islands. */
void ms_sim_take_models(msim_sim *sim, msim_sim *from);

/* Record that the present solvers were chosen for the springs of that scene, and take over the
 * caller's reference to it; NULL: for the springs of the sim's scene. */
void ms_sim_set_solver_scene(msim_sim *sim, ms_scene *scene);

/* Make room in all models for springs of any values. */
msim_status ms_sim_reserve_springs(msim_sim *sim, msim_error *err);

/* Replace the sim's scene, and update the springs of all models; no reference count changes. To be
 * called after ms_sim_reserve_springs() if springs have other values than at creation, unless these
 * are those of springs that have broken. */
void ms_sim_replace_scene(msim_sim *sim, ms_scene *scene);

/* Set the bounds of all steppers after springs, forces or the method changed; collective. */
void ms_sim_set_bounds(msim_sim *sim);

/* Replace the sim's scene by one with other gravity, drag or constant forces, and update all
 * models; no reference count changes. Fails, with nothing changed, only where particles get
 * constant forces for the first time. */
msim_status ms_sim_replace_forces(msim_sim *sim, ms_scene *scene, msim_error *err);

/* Record that forces or pins are no longer those that the sim was made with, which `before` has
 * unless that was recorded earlier; NULL: they are these. */
void ms_sim_set_created_scene(msim_sim *sim, ms_scene *before);

/* Record that the sim's scene is an edited one, and which scene the sim had before its first edit;
 * takes over the caller's reference. NULL: the scene is not edited. */
void ms_sim_set_edited_from(msim_sim *sim, ms_scene *before);

/* Make room for n particles in the arrays of the state, which keep their content. Older arrays stay
 * until the sim is destroyed. */
msim_status ms_sim_reserve_state(msim_sim *sim, int32_t n, msim_error *err);
void ms_sim_free_state(msim_sim *sim);

/* Make the arrays of the state where several ranks do not have them yet; collective. */
msim_status ms_sim_provide_arrays(msim_sim *sim, msim_error *err);

/* At the start, where there are arrays: set the velocities that the method carries, those of the
 * state along an axis left out. */
void ms_sim_start_v_half(msim_sim *sim);

/* Make the section that this rank has for output, if it is not there, and set it to the present
 * state (rank_section.h); collective. */
msim_status ms_sim_update_section(msim_sim *sim, msim_error *err);

/* Build all islands anew, with the same components, and start them in the present state. */
msim_status ms_sim_rebuild_islands(msim_sim *sim, msim_error *err);

/* MSIM_ERR_ARG where the method cannot handle these dampings, or the scene's drag or planes.
 * damping: one value per spring. */
msim_status ms_sim_check_method_forces(const msim_sim *sim, const double *damping, msim_error *err);

/* Destroy all islands, also partly built ones. */
void ms_sim_destroy_islands(msim_sim *sim);

/* The island with the most free particles, the first of several: reports describe this one. */
const ms_island_sim *ms_sim_largest_island(const msim_sim *sim);

/* Free the matrix of msim_sim_matrix. */
void ms_sim_free_matrix(msim_sim *sim);

/* Pass a note to options.warn, if that is set. */
void ms_sim_warn(const msim_sim *sim, const char *format, ...) MS_PRINTF(2, 3);

/* Choose a method for integrator = auto for a run that starts in this state. late: a run that has
 * begun (method_choice.h) */
typedef msim_status ms_sim_choose(msim_sim *sim, int late, const msim_state *start,
                                  msim_error *err);

/* As msim_sim_create(), without a check of the arguments. choose: for integrator = auto; else NULL.
 * like: msim_sim.like, nullable */
msim_status ms_sim_create(const msim_scene *scene, const msim_options *opt, ms_sim_choose *choose,
                          const ms_island_sims *like, msim_sim **sim, msim_error *err);

/* A sim with the scene and the decisions of another one, but without islands, which must be built
 * next; after an error it may be there, and must be destroyed. */
msim_status ms_sim_create_empty_copy(const msim_sim *from, msim_sim **sim, msim_error *err);

/* Make n steps, or fewer if one fails or the sim is asked to stop. The method stays. */
msim_status ms_sim_make_steps(msim_sim *sim, int64_t n, msim_error *err);

/* MSIM_ERR_ARG if the state does not fit the scene or is not finite. */
msim_status ms_sim_check_state(const msim_sim *sim, const msim_state *state, msim_error *err);

/* Check the state and start a run from it by the present method. */
msim_status ms_sim_set_state(msim_sim *sim, const msim_state *state, msim_error *err);

/* Start a run from this state, which the caller has checked. */
msim_status ms_sim_start(msim_sim *sim, const msim_state *state, msim_error *err);

/* Continue from the present state by another method, with steps of h. The sim was built for an
 * explicit method with at least as many work vectors. */
void ms_sim_switch_method(msim_sim *sim, const ms_integrator *method, double h);

/* Start all islands in this state, with the planned step. */
void ms_sim_start_islands(msim_sim *sim, const msim_state *state);

/* Set moving pins to the present time in all islands, and count the work that changes their energy.
 * A step from t that ends at a time of a motion leaves no cached stages. */
void ms_sim_move_pins(msim_sim *sim, double t);

/* Set moving pins to the present time in the arrays of the state, and find their energy. */
void ms_sim_start_pins(msim_sim *sim);

/* Set moving pins to the present time in all islands. */
void ms_sim_set_pins(msim_sim *sim);

/* MSIM_ERR_ARG where the scene has motions and the method or the options do not support them */
msim_status ms_sim_check_motions(const msim_sim *sim, msim_error *err);

/* Reduce options.steps by the steps already made; those made beyond it do not count. */
void ms_sim_subtract_steps_made(msim_sim *sim);

/* Plan the run from t0 and x, v (3n, in particle order); on failure the old plan stays. */
msim_status ms_sim_make_plan(msim_sim *sim, double t0, const double *x, const double *v,
                             msim_error *err);

/* Add seconds spent on output to the sim's stats. */
void ms_sim_count_output(msim_sim *sim, double seconds);

#endif
