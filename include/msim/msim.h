/* msim.h - the public API of msim, a library that simulates mass-spring systems. Include this one;
 * it brings scene.h and options.h.
 *
 * Two objects: a scene (what there is) and a sim (how it moves). Build a scene, make a sim from
 * it, step the sim, read its state:
 *
 *     msim_scene *scene = NULL;
 *     msim_sim *sim = NULL;
 *     msim_options opt;
 *     msim_state state = {.size = sizeof state};
 *     msim_error err;
 *
 *     msim_scene_create(NULL, &scene, &err);
 *     msim_scene_add_particles(scene, n, x, NULL, mass, &err);
 *     msim_scene_add_springs(scene, ns, ij, k, NULL, NULL, &err);
 *     msim_options_init(&opt, sizeof opt);
 *     opt.integrator = "velocity-verlet";
 *     opt.h = 1e-3;
 *     if (msim_sim_create(scene, &opt, &sim, &err) != MSIM_OK) puts(err.text);
 *     msim_sim_step(sim, 2000, &err);
 *     msim_sim_state(sim, &state);
 *     msim_sim_destroy(sim);
 *     msim_scene_destroy(scene);
 *
 * Conventions, valid for every function here:
 *  - The object comes first, inputs next, outputs after them, the error last and nullable.
 *  - What can fail returns msim_status: 0 success; < 0 error, nothing was changed; > 0 numerical
 *    event (MSIM_NOT_SPD, MSIM_NOT_CONVERGED, MSIM_NOT_FINITE: the state is that before the step,
 *    or, where that is beyond what energy allows, as with MSIM_UNSTABLE, the last good one;
 *    MSIM_STOPPED: that after it). Destroyers return void and accept NULL.
 *  - Positions, velocities and forces are flat arrays of 3n doubles: x0 y0 z0 x1 y1 z1 ...
 *    Units are SI: m, kg, s, N. Indices are int32_t and count from 0.
 *  - What you pass in is copied; it must not be what the same object lent. What you get back is
 *    borrowed and dies with its owner, or when its owner is changed or asked again.
 *  - Structs that may grow begin with their size: set it (or call their _init) before use.
 *  - The library never prints, aborts or exits, and holds no global state. Distinct sims may run
 *    in distinct threads, also when they were made from one scene.
 */
#ifndef MSIM_MSIM_H
#define MSIM_MSIM_H

#include "msim/options.h"

#ifdef __cplusplus
extern "C" {
#endif

/*------------------------------------- sim ------------------------------------------------------*/

typedef struct msim_sim msim_sim;

/* The state at time t = t0 + (step - step0) h; under error control t is the sum of all steps. */
typedef struct msim_state {
  size_t size;
  int64_t step;
  double t;             /* s */
  int32_t n;            /* particles */
  const double *x;      /* 3n, m */
  const double *v;      /* 3n, m/s: the velocity at t */
  const double *v_half; /* 3n: the velocity at t - h/2 that `verlet` carries; NULL for others */
  double h; /* the step of the run, s: v_half belongs to it; under error control the next to try */
} msim_state;

/* Energies in J: 0 at rest, at rest length and at x = 0; all particles count, pinned ones too.
 * Angular momentum is about the origin. */
typedef struct msim_energy {
  size_t size;
  double kinetic, elastic, gravitational, total;
  double momentum[3];         /* kg m/s */
  double angular_momentum[3]; /* kg m^2/s */
} msim_energy;

/* Work done and time spent since creation. A zero says that the phase never ran. Each island of a
 * scene counts its own evaluations, assemblies, factorizations, solves and iterations. */
typedef struct msim_stats {
  size_t size;
  int64_t steps, force_evaluations, assemblies, analyses, factorizations, solves, iterations;
  int64_t newton_iterations;
  int64_t contacts;         /* particles reflected, once a pass; impacts located; endless bounces
                               that were summed are one */
  int64_t indefinite_steps; /* steps whose exact matrix was seen not to be positive definite */
  int64_t coarse_factors;   /* factorisations of the coarse part of pcg's preconditioner */
  int64_t kept_factors;     /* solves that an old factor, or coarse factor, preconditioned */
  int64_t refinements;      /* corrections of an answer above solver.rtol */
  int64_t fallbacks;        /* changes of mind of solver = auto */
  double total_s, force_s, assemble_s, factor_s, solve_s, collide_s, output_s;
  int64_t steps_at_rest;   /* of `steps`, those that were not made, as they would change nothing */
  int64_t islands_at_rest; /* steps of single islands that were not made for that reason */
  int64_t spring_evaluations; /* springs in all force evaluations: respa's are of some of them */
  int64_t rejected_steps;     /* made again, shorter or in parts: too far off, or not to be made */
} msim_stats;

/* What was decided at creation, or from the last state set. */
typedef struct msim_plan {
  size_t size;
  double h;      /* the step actually made, s; under error control the next one to try */
  int64_t steps; /* from there to the end; -1 where no end was given, and under error control */
  const char *integrator; /* what `auto` has chosen, too */
  const char *solver;     /* of the largest island; "none" where the method needs none */
  int32_t threads;        /* that compute; fewer than asked for where not all could be started */
  double tol;             /* that error control keeps; 0: steps are fixed */
  double t_end;           /* where the run ends, s; -1 where it has no end */
} msim_plan;

/* The matrix of the next implicit step by rows: A = M - h D - h^2 J, in particle order, rows and
 * columns of pinned particles left out. */
typedef struct msim_csr {
  size_t size;
  int32_t n;                      /* rows, 3 times the free particles, in flat scenes too */
  const int32_t *rowptr, *colind; /* n + 1; rowptr[n] */
  const double *val;              /* rowptr[n] */
  const int32_t *particle;        /* n / 3: the particle of each block row */
} msim_csr;

/* Make a sim from a scene, which it shares until either is changed: the scene may be destroyed at
 * once. Steps allocate nothing, except where `auto` chooses anew, and by CHOLMOD and KLU, which
 * call malloc in every step.
 *
 * Parts of the scene that no spring connects are islands: systems of their own, each with a solver
 * of its own, and not stepped while at exact rest. Pinned particles connect nothing; what is below
 * 512 particles is taken together with others.
 *
 * Error control is on where options.tol is set, or the method is dop853 and options.steps is not:
 * then steps are as long as their error E, in root mean square, allows. A step of h may add
 *   E^2 = 1/(2 n) sum_i (|dx_i|^2/L^2 + |dv_i|^2/U^2) <= (tol h/T)^2,
 * to each part of n free particles that springs connect, with the extent L and the speed U of the
 * part (explain tells them) and the length T of the run up to t_end, or 1 s where there is none.
 * The part with the largest error decides. So tol stands for the error at the end as far as errors
 * neither grow nor fade on the way: a tenth of tol makes about a tenth of the error. dop853 has an
 * estimate of its own; others make each step of two halves and compare with a whole one. `verlet`,
 * `bdf2`, `rkc` and `respa` have none. Impacts are located: a step ends at the first one that leads
 * deeper behind a plane than tol L/10, and particles bounce at the start of the next one.
 * `step` counts the steps accepted, and the last one ends at t_end. Setting a state starts a new
 * run: its error is counted from there.
 * With integrator = "auto" each run begins with the choice of a method, by tol and steps tried in
 * the scene, as explain tells: counts decide, never a clock. Few bodies run under error control;
 * others mostly in fixed steps, which are verified as they are made, and made in parts where tol
 * asks for that. Once a plane is close a method for impacts is chosen: they are located, always
 * with collision = event, else unless reflection keeps tol. `h` is not used, `steps` is refused.
 *
 * A scene is flat where along some axis all particles lie level and at rest, gravity is 0 and no
 * plane has a part of its normal. Its motion is computed in two components: the same as in three,
 * to rounding, and exactly level. Nothing leaves a plane in which nothing pushes it out, so a
 * matrix that were indefinite out of the plane only is positive definite here. */
MSIM_API msim_status msim_sim_create(const msim_scene *scene, const msim_options *opt,
                                     msim_sim **sim, msim_error *err);
MSIM_API void msim_sim_destroy(msim_sim *sim);

/* Make n steps. Stops early, with a status > 0, at a numerical event or when asked to. */
MSIM_API msim_status msim_sim_step(msim_sim *sim, int64_t n, msim_error *err);

/* Called at the first step and at each frame (options every, fps); non-zero stops the run. */
typedef int msim_observer(msim_sim *sim, void *user);

/* Step to the end that options.steps or options.t_end set, calling the observer at each frame,
 * the first state and the last included. Running in several pieces gives the same bits.
 * Under error control frames of `fps`, and the default ones, are at their exact times: the observer
 * then sees the state there, from inside the step just made, which no frame changes. */
MSIM_API msim_status msim_sim_run(msim_sim *sim, msim_observer *observer, void *user,
                                  msim_error *err);

/* Ask a running msim_sim_step or msim_sim_run to return MSIM_STOPPED after the step it is in; if
 * that step is a frame, it is shown first. May be called from another thread and from a signal
 * handler. */
MSIM_API void msim_sim_stop(msim_sim *sim);

/* The step at which the next frame is due after the present one; the end of the run at latest.
 * Under error control frames in time lie between steps, for msim_sim_run to show: the next step. */
MSIM_API int64_t msim_sim_next_frame(const msim_sim *sim);

/* The present state; set state->size before. The arrays hold until the next call. */
MSIM_API void msim_sim_state(msim_sim *sim, msim_state *state);

/* Go on from another state; steps and t_end are planned anew from there. Pinned particles must
 * stay where they are. Where the method carries v_half and it is given for the same h, it is taken
 * as it is, else it is made from v. Nullable: v_half.
 * A state out of the plane of a flat scene is computed in three components from there on, one
 * within it in two: between them all is planned, allocated and analysed anew. */
MSIM_API msim_status msim_sim_set_state(msim_sim *sim, const msim_state *state, msim_error *err);

/* Go on from the present state with another step: s, > 0, or MSIM_H_AUTO. The end stays: t_end, or
 * as many steps as options.steps leaves. Values of matrices change, nothing is analysed anew. A
 * recorder that is open keeps the frames it has planned. Under error control h is the next step to
 * try; refused with auto. */
MSIM_API msim_status msim_sim_set_step(msim_sim *sim, double h, msim_error *err);

/* Change the springs of this sim; the scene it was made from stays as it is. Values of matrices
 * change; they are analysed anew only where all rest lengths and dampings were 0 or become so. The
 * step stays, also where MSIM_H_AUTO has chosen it for the old ones; but integrator = auto begins a
 * new run in the present state. Nullable: k, rest, damping (as they are). */
MSIM_API msim_status msim_sim_set_springs(msim_sim *sim, const double *k /* nsprings */,
                                          const double *rest /* nsprings */,
                                          const double *damping /* nsprings */, msim_error *err);

/* A checkpoint: all that the steps to come owe to those made, so that a sim made anew goes on from
 * there to the same bits, with any method, solver or error control, and counts on in stats, but
 * for the seconds. The bytes are the caller's, to be written straight to where they are to lie;
 * they name what they are, and each of them counts in a hash. Saving changes nothing, and frames of
 * msim_sim_run are checkpoints too. No sim ever needs more than this, until a state or springs are
 * set: */
MSIM_API size_t msim_sim_save_size(const msim_sim *sim);
MSIM_API msim_status msim_sim_save(msim_sim *sim, void *to, size_t capacity, size_t *length,
                                   msim_error *err);

/* Go on from a checkpoint, in a sim that was made from the same scene with the same options, and to
 * which the same msim_sim_set_step happened; its springs are those that were set last. What differs
 * is named; so is another msim or MSIM_ISA. Free are threads, frames (every, fps), plugin_path,
 * sync and the end (steps, t_end), as long as h stays; under error control the tolerance for a
 * second stays, too. */
MSIM_API msim_status msim_sim_load(msim_sim *sim, const void *from, size_t length, msim_error *err);

MSIM_API void msim_sim_energy(msim_sim *sim, msim_energy *energy);
MSIM_API void msim_sim_stats(const msim_sim *sim, msim_stats *stats);
MSIM_API void msim_sim_plan(const msim_sim *sim, msim_plan *plan);

/* The forces on all particles, pinned ones 0, in the state x, v. */
MSIM_API void msim_sim_force(msim_sim *sim, const double *x /* 3n */, const double *v /* 3n */,
                             double *force /* 3n */);

/* The matrix of the next step, assembled anew. Refused where the method needs no matrix. */
MSIM_API msim_status msim_sim_matrix(msim_sim *sim, msim_csr *A, msim_error *err);

/* What will run, what is skipped and why, stability limits, matrix size: text for people. */
MSIM_API msim_status msim_sim_explain(msim_sim *sim, const char **text, msim_error *err);

/*------------------------------------- recording ------------------------------------------------*/

/* A file being written. The kind follows from the name: .csv (built in), .vtkhdf (plugin hdf5). */
typedef struct msim_recorder msim_recorder;

/* Open a file for the frames that the sim's options ask for. The file appears under its name
 * when it is complete enough to be read. An older trajectory of msim gives way to it; any other
 * file is kept, and so is one that another recorder writes, in whatever process: refused. */
MSIM_API msim_status msim_recorder_open(msim_sim *sim, const char *path, msim_recorder **recorder,
                                        msim_error *err);

/* The same, but any file gives way that no recorder writes. */
MSIM_API msim_status msim_recorder_replace(msim_sim *sim, const char *path,
                                           msim_recorder **recorder, msim_error *err);

/* Go on with a .vtkhdf file whose run was interrupted in whatever way: load its last checkpoint,
 * as msim_sim_load does, into a sim that stands where that run began, and write what follows behind
 * the frames up to there. The last of them, in which the sim is then, is not written again. The end
 * may be another as far as the file has planned frames for it: it never grows. A file without a
 * frame is begun anew. Refused, and nothing is changed, where the file was planned for other times
 * or msim_sim_load refuses. */
MSIM_API msim_status msim_recorder_resume(msim_sim *sim, const char *path, msim_recorder **recorder,
                                          msim_error *err);

/* Write the sim's present state as the next frame. */
MSIM_API msim_status msim_recorder_write(msim_recorder *recorder, msim_error *err);

/* Finish the file and free the recorder, also after errors. Nullable: recorder. */
MSIM_API msim_status msim_recorder_close(msim_recorder *recorder, msim_error *err);

#ifdef __cplusplus
}
#endif
#endif
