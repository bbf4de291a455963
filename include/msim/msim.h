/* msim.h - the public API of msim, a library that simulates mass-spring systems. Include this
 * header; it includes scene.h, mesh.h, options.h, change.h and statics.h.
 *
 * There are two kinds of objects: a scene (the mechanical model) and a sim (its motion). Build a
 * scene, create a sim from it, step the sim, read its state:
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
 * Conventions of all functions:
 *  - The object comes first, inputs next, outputs after them, the error last (nullable).
 *  - Functions that can fail return msim_status: 0 success; < 0 error; > 0 numerical event. Any of
 *    them may return MSIM_ERR_ARG (an argument is invalid) and MSIM_ERR_MEMORY (an allocation
 *    failed), those with a struct that has a size MSIM_ERR_SIZE (it was not set, or members are set
 *    that this msim does not have). "Plugin statuses" are MSIM_ERR_NAME (not found),
 *    MSIM_ERR_PLUGIN and MSIM_ERR_ABI (unusable), MSIM_ERR_BACKEND (its library failed). All others
 *    are listed at each function. Getters have no error argument: their status says all.
 *  - After an error nothing is changed but counts and times in msim_stats; pointers that were
 *    borrowed may be invalid. Only msim_sim_step, msim_sim_run and msim_recorder_write may have
 *    done a part: see there.
 *  - Functions that destroy an object accept NULL; others that return no status need all arguments.
 *  - Positions, velocities and forces are contiguous arrays of 3n doubles: x0 y0 z0 x1 y1 z1 ...
 *    Units are SI: m, kg, s, N. Indices are int32_t and count from 0.
 *  - Arguments are copied; they must not point into memory borrowed from the same object. Returned
 *    pointers are borrowed: valid until their owner is destroyed or changed, or called again.
 *  - Structs that the caller allocates begin with their size, as later versions may add members at
 *    the end: set it to sizeof before use, as above, or call msim_options_init; all other members
 *    that are not set must be 0. Members beyond the size count as 0, and are not written.
 *    msim_error and msim_plane have no size, as they never grow. Structs that functions return a
 *    pointer to belong to the library and may grow, too: do not copy them by sizeof, nor index them
 *    as arrays.
 *  - The library never prints, aborts or exits, and keeps no state but the plugins that it has
 *    loaded. Different sims may run in different threads, also if they were created from the same
 *    scene; one scene or sim must not be used by two threads at once, except by msim_sim_stop.
 *  - In an observer (msim_sim_run) every function may be called for the sim that it observes,
 *    except msim_sim_step and msim_sim_run, which then return MSIM_ERR_ARG, and msim_sim_destroy,
 *    which then only warns. Functions that change the sim act as between two calls of msim_sim_run.
 *    Functions in msim_options and msim_allocator must not use the scene or sim that calls them.
 */
#ifndef MSIM_MSIM_H
#define MSIM_MSIM_H

#include "msim/change.h"
#include "msim/mesh.h"
#include "msim/options.h"
#include "msim/statics.h"

#ifdef __cplusplus
extern "C" {
#endif

/*------------------------------------- sim ------------------------------------------------------*/

/* State at the time t = t0 + (step - step0) h; under error control t is the sum of all steps, or
 * the time of a frame. */
typedef struct msim_state {
  size_t size;
  int64_t step;
  double t;             /* s */
  int32_t n;            /* number of particles */
  const double *x;      /* 3n, m */
  const double *v;      /* 3n, m/s: the velocity at t */
  const double *v_half; /* 3n: the velocity at t - h/2 that `verlet` carries; else NULL */
  double h;         /* step size of the run, s, to which v_half belongs; with tol the next to try */
  double work;      /* energy supplied since the first start, J, as in msim_energy */
  int32_t nsprings; /* number of springs; msim_sim_set_state ignores it */
} msim_state;

/* As size: msim_sim_state sets step, t and n alone, for which several ranks gather nothing. */
#define MSIM_STATE_TIME offsetof(msim_state, x)

/* Energies in J, of all particles, pinned ones included. Zero levels: velocity 0, springs at rest
 * length, and x = 0 for the gravitational energy, which includes -F.x of the constant forces F of
 * msim_scene_set_forces and the potential of a force function. Angular momentum is taken about the
 * origin. */
typedef struct msim_energy {
  size_t size;
  double kinetic, elastic, gravitational, total;
  double momentum[3];         /* kg m/s */
  double angular_momentum[3]; /* kg m^2/s */
  double work; /* energy supplied since the first start, J, by motions of pinned particles and
                  colliders, by a force function without potential, and by each call of
                  msim_sim_set_gravity, msim_sim_set_forces and msim_sim_edit; without damping,
                  drag, inelastic impacts and springs that break total - work is constant, to the
                  accuracy of the method. At a frame inside a step: that at the end of the step */
} msim_energy;

/* The islands of a scene: free particles that springs connect which are not broken. All pinned
 * particles are one more island, the last; they connect nothing. The energies are those of
 * msim_energy, whose sums they are up to rounding; that of a spring to a pinned particle belongs to
 * the island of the free one. */
typedef struct msim_islands {
  size_t size;
  int32_t n;
  const int32_t *of; /* for each particle: its island, numbered by their first particles */
  const double *kinetic, *elastic, *gravitational; /* n, J */
} msim_islands;

/* A particle and a plane or a collider that it touched in a step. This struct is fixed. */
typedef struct msim_contact {
  int32_t particle;
  int32_t plane;    /* -1: it touched a collider */
  int32_t collider; /* -1: it touched a plane */
  int32_t reserved; /* 0 */
  double point[3];  /* m: of the surface, nearest to the particle in the step or at its end */
  double normal[3]; /* of the surface there, to the side of the particle */
  /* N s: the sum of all impulses on the particle in the step, with friction; of a contact that
   * lasts, its mean force times h */
  double impulse[3];
} msim_contact;

/* Work done and time spent since creation; 0: that phase never ran. Each island of a scene counts
 * its own evaluations, assemblies, factorizations, solves and iterations. */
typedef struct msim_stats {
  size_t size;
  int64_t steps, force_evaluations, assemblies, analyses, factorizations, solves, iterations;
  int64_t newton_iterations;
  int64_t contacts;         /* reflections at planes; impacts located, where the sum of infinitely
                               many bounces counts as one */
  int64_t indefinite_steps; /* steps whose exact matrix was found not to be positive definite */
  int64_t coarse_factors;   /* factorizations of the coarse matrix of pcg's preconditioner */
  int64_t kept_factors;     /* solves preconditioned by a lagged factorization or coarse factor */
  int64_t refinements;      /* corrections of a solution above solver.rtol */
  int64_t fallbacks;        /* changes of solver by solver = auto */
  /* force_s of scenes with fewer than 1000 springs is estimated from some of the evaluations */
  double total_s, force_s, assemble_s, factor_s, solve_s, collide_s, output_s;
  int64_t steps_at_rest;      /* those of `steps` that were skipped: the scene was at rest */
  int64_t islands_at_rest;    /* steps of single islands that were skipped for that reason */
  int64_t spring_evaluations; /* springs in all force evaluations; those of respa take some only */
  int64_t rejected_steps;     /* steps repeated in shorter ones: too inaccurate, or failed */
  int64_t incomplete_steps;   /* steps made although iterations ended at their maximum (option
                                 incomplete = accept) */
  int64_t broken;             /* springs that have broken (break_strain, break_force of laws) */
} msim_stats;

/* Decisions made at creation, or when the state was last set. */
typedef struct msim_plan {
  size_t size;
  double h;      /* step size in use, s; under error control the next to try */
  int64_t steps; /* from there to the end; -1 if no end was given, and under error control */
  const char *integrator; /* the method in use, also if `auto` has chosen it */
  const char *solver;     /* of the largest island; "none" if the method needs none */
  int32_t threads;        /* in use; fewer than requested if not all could be started */
  double tol;             /* of the error control; `auto` may raise it; 0: fixed steps */
  double t_end;           /* end of the run, s; -1: none */
} msim_plan;

/* The cost of the run from the present state to its end, or for 1 s if it has none, extrapolated
 * from the first steps; counts as in msim_stats. */
typedef struct msim_estimate {
  size_t size;
  int64_t tried; /* steps that were made to find it, at most 24 */
  double steps;  /* exact with fixed steps */
  double force_evaluations, solves, iterations, factorizations;
  double work; /* all of that in evaluations of the forces of all springs: an iteration of pcg is
                  1.5 of them, with a coarse space 3; factorizations count by their flops */
} msim_estimate;

/* The matrix of the next implicit step, A = M - h D - h^2 J, in compressed rows: in the order of
 * the particles, without rows and columns of pinned particles. */
typedef struct msim_csr {
  size_t size;
  int32_t n;                      /* rows: 3 times the free particles, also in planar scenes */
  const int32_t *rowptr, *colind; /* n + 1; rowptr[n] */
  const double *val;              /* rowptr[n] */
  const int32_t *particle;        /* n / 3: the particle of each block row */
} msim_csr;

/* Create a sim from a scene. The sim shares the data of the scene until either is changed; the
 * scene may be destroyed at once. Returns also MSIM_ERR_NAME (no such integrator) and plugin
 * statuses.
 *
 * Steps allocate no memory, except: the plugins cholmod and klu in every step; solver = "auto" when
 * it opens cholmod; integrator = "auto" when it chooses a method for planes, or continues with
 * doubles in place of floats; self-contact when more pairs come near each other than before; and
 * qsort of glibc, which works without memory, too, with implicit methods where many particles rest
 * on planes.
 *
 * Islands are parts of the scene that no spring connects: each is a system with a solver of its
 * own, and is not stepped while at exact rest. Pinned particles connect nothing; islands of less
 * than 512 particles are combined with others.
 *
 * Error control is on if options.tol is set, or if the method is dop853 and options.steps is not
 * set. It chooses the step size h so that the root mean square error E added by a step satisfies
 *   E^2 = 1/(2 n) sum_i (|dx_i|^2/L^2 + |dv_i|^2/U^2) <= (tol h/T)^2
 * in each part of n free particles that springs connect, with the extent L and the speed U of the
 * part (see msim_sim_explain) and the length T of the run up to t_end, or 1 s if there is no end.
 * The part with the largest error determines h. So tol is the error at the end of the run if errors
 * neither grow nor decay; a tenth of tol gives about a tenth of the error. dop853, ssprk102,
 * ssprk104, rk6, rkc and bdf2 have an error estimate of their own; others compare each step with
 * two half steps. `verlet`, `respa` and `takahashi-imada` have no error control. Impacts are
 * located: a step ends at the first impact that would lead deeper behind a plane than tol L/10, and
 * particles bounce at the start of the next step. `step` counts the accepted steps, and the last
 * one ends at t_end. Setting a state starts a new run, with an error counted from there.
 *
 * With integrator = "auto" each run begins with the choice of a method from tol and pilot runs in
 * the scene (see msim_sim_explain); only operation counts decide, never timings. Small scenes run
 * under error control; others mostly with fixed steps, which are verified during the run and split
 * up where tol requires it. When a particle comes close to a plane, a method for impacts is chosen:
 * impacts are located, unless reflection keeps tol and collision is not event. `h` is ignored,
 * `steps` is refused.
 *
 * With options.comm the ranks of this communicator simulate the scene together: each calls this
 * function with the same scene and options, each with its own `comm`, and then all others in the
 * same order (docs/ranks.md). They agree on every status. MSIM_ERR_UNSUPPORTED: several ranks do
 * not support an option, the scene or, of other functions, the call. MSIM_ERR_BACKEND:
 * communication failed. MSIM_ERR_ABI: comm was built for another version.
 *
 * A scene is planar if along some axis all particles have the same coordinate and no velocity, and
 * gravity and all plane normals have no component. Its motion is computed in two components: equal
 * to that in three, up to rounding, and exactly planar. A matrix that is indefinite only for
 * displacements out of the plane is then positive definite. */
MSIM_API msim_status msim_sim_create(const msim_scene *scene, const msim_options *opt,
                                     msim_sim **sim, msim_error *err);

/* Close the recorders of the sim before. In an observer of the sim: only warns. Nullable: sim. */
MSIM_API void msim_sim_destroy(msim_sim *sim);

/* Make n >= 0 steps. Stops early, with a status > 0, at a numerical event or after msim_sim_stop:
 * MSIM_NOT_SPD, MSIM_NOT_CONVERGED, MSIM_NOT_FINITE and MSIM_FORCE_FAILED leave the state before
 * the failed step, or, if its energy or extent exceeds the bounds of the energy monitor
 * (MSIM_WATCH_ON), the last state within them; MSIM_UNSTABLE leaves that state; MSIM_STOPPED the
 * state after the step. An error, MSIM_ERR_MEMORY or one of the plugin statuses, leaves the state
 * after the last complete step. The sim may go on from there. Not in an observer: MSIM_ERR_ARG. */
MSIM_API msim_status msim_sim_step(msim_sim *sim, int64_t n, msim_error *err);

/* Make `steps` >= 0 steps of each of n >= 0 different sims, as msim_sim_step does, several sims at
 * a time: in `threads` threads, the calling one included, 1 to 256; 0: as many as there are cores.
 * All are stepped, whatever happens to one of them. errors[i]: status and message of sims[i].
 * Returns the first status in the array that is not MSIM_OK; err has the number of that sim, too.
 * Meant for many small scenes, whose sims have one thread each (options.threads = 1). Force
 * functions, warnings and allocators that sims share are called from several threads at once.
 * MSIM_ERR_ARG: a sim is there twice, in its observer or shared by ranks; none is stepped then.
 * Nullable: errors, and sims where n = 0. */
MSIM_API msim_status msim_sim_step_many(msim_sim *const *sims /* n */, int32_t n, int64_t steps,
                                        int32_t threads, msim_error *errors /* n */,
                                        msim_error *err);

/* Called at the first state and at each frame (options every, fps); non-zero stops the run, which
 * then returns MSIM_STOPPED. */
typedef int msim_observer(msim_sim *sim, void *user);

/* Make steps to the end given by options.steps or options.t_end, and call the observer at each
 * frame, including the initial and the final state. Running in several pieces gives the same bits.
 * Under error control frames of `fps`, and those of the default, are at their exact times: the
 * state passed to the observer is interpolated inside the last step, which it does not change.
 * Statuses and the state that they leave: as msim_sim_step. MSIM_ERR_ARG: no end is given. Not in
 * an observer: MSIM_ERR_ARG. Nullable: observer. */
MSIM_API msim_status msim_sim_run(msim_sim *sim, msim_observer *observer, void *user,
                                  msim_error *err);

/* Ask a running msim_sim_step or msim_sim_run to return MSIM_STOPPED after the present step; if
 * that step is a frame, the observer is called first. If none is running, the next one stops after
 * one step. May be called from another thread and from a signal handler. */
MSIM_API void msim_sim_stop(msim_sim *sim);

/* The number of the next step that is a frame; at most the last step of the run. Under error
 * control with frames in time, which msim_sim_run interpolates: the next step. */
MSIM_API int64_t msim_sim_next_frame(const msim_sim *sim);

/* Get the present state; set state->size first. The arrays are valid until the next call with this
 * sim. MSIM_ERR_MEMORY: several ranks have no memory for the state of the whole scene. */
MSIM_API msim_status msim_sim_state(msim_sim *sim, msim_state *state);

/* Continue from another state; number of steps and t_end are planned anew. Pinned particles must
 * keep their positions. If the method carries v_half and it is given together with the same h, it
 * is used unchanged, else it is computed from v. Nullable: v_half. If a planar scene gets a state
 * out of its plane it is computed in three components from then on, and in two again after a state
 * within the plane: these changes allocate and analyze everything anew, and may return plugin
 * statuses. */
MSIM_API msim_status msim_sim_set_state(msim_sim *sim, const msim_state *state, msim_error *err);

/* Save a checkpoint: all data that further steps depend on, so that another sim can continue with
 * the same bits, with any method, solver and error control, and with the same counts in stats
 * (except for times). The caller provides the memory. The data include a format identifier and a
 * hash of all bytes. Saving changes nothing, also inside the observer of msim_sim_run. Several
 * ranks get the same bytes, which describe the whole scene: any number of them may continue.
 * msim_sim_save_size is an upper bound of `length`, valid until a state or springs are set, pinned
 * particles or colliders are moved, or the sim is edited. MSIM_ERR_ARG: capacity is too small. */
MSIM_API size_t msim_sim_save_size(const msim_sim *sim);
MSIM_API msim_status msim_sim_save(msim_sim *sim, void *to, size_t capacity, size_t *length,
                                   msim_error *err);

/* Continue from a checkpoint, in a sim created from the same scene with the same options, and with
 * the same calls of msim_sim_set_step; the springs must be those set last. Errors name the
 * difference, also of the version of msim or of MSIM_ISA. These may differ: threads, frames (every,
 * fps), plugin_path, sync and the end (steps, t_end), if h stays the same; under error control tol
 * per second must stay the same, too. May return plugin statuses. A sim that returns to a state of
 * its own analyzes nothing anew, and computes only factorizations that differ. */
MSIM_API msim_status msim_sim_load(msim_sim *sim, const void *from, size_t length, msim_error *err);

/* Create an independent sim with the state, history, options and counts of this one: both go on
 * with the same bits. It shares the data of the scene and opens no recorder; warnings of both go to
 * the same callback until msim_sim_set_warn. No method is chosen again; matrices are analyzed once.
 * Destroy it by msim_sim_destroy. May return plugin statuses. */
MSIM_API msim_status msim_sim_clone(msim_sim *sim, msim_sim **copy, msim_error *err);

/* Pass warnings of the sim to another callback than that of msim_options. Nullable: warn, user. */
MSIM_API void msim_sim_set_warn(msim_sim *sim, void (*warn)(const char *text, void *user),
                                void *user);

/* Get energies of the present state, work done since creation, and decisions; set size first. */
MSIM_API msim_status msim_sim_energy(msim_sim *sim, msim_energy *energy);
MSIM_API msim_status msim_sim_stats(const msim_sim *sim, msim_stats *stats);
MSIM_API msim_status msim_sim_plan(const msim_sim *sim, msim_plan *plan);

/* Estimate the cost of the rest of the run by the first steps of a clone; counted, not timed, and
 * so the same each time. Later steps may cost more or less, as where bodies meet planes. A status
 * > 0 is that of a step of the clone: the run would end there. Nothing of the sim changes. Set size
 * first. May return plugin statuses. */
MSIM_API msim_status msim_sim_estimate(msim_sim *sim, msim_estimate *estimate, msim_error *err);

/* Compute the forces on all particles in the state x, v, now; 0 for pinned particles. That of a
 * force function is left out where it fails. */
MSIM_API void msim_sim_force(msim_sim *sim, const double *x /* 3n */, const double *v /* 3n */,
                             double *force /* 3n */);

/* Compute the force (N) that its support exerts on each pinned particle in the present state, 0 for
 * all others: what balances the springs and the external force there. The sum of reactions and of
 * external forces on all particles, and of those of planes, is the rate of momentum. */
MSIM_API msim_status msim_sim_reactions(msim_sim *sim, double *reaction /* 3n */);

/* Get the contacts of the last step (option contacts = on), sorted by particle, then planes before
 * colliders, each pair once; none before the first step, and after a state was set or loaded, or a
 * step failed. With the external forces on free particles, and those of springs to pinned ones, the
 * sum of the impulses is the change of momentum, to rounding; to the order h^3 a step where a
 * contact lasts and the method does not integrate forces by the trapezoidal rule (docs/contact.md).
 * The array is borrowed until the next call with this sim. MSIM_ERR_ARG: contacts are not recorded;
 * MSIM_ERR_MEMORY: also if there are more than 3 for each particle. */
MSIM_API msim_status msim_sim_contacts(msim_sim *sim, int32_t *n, const msim_contact **contacts);

/* Compute for each spring of the scene, in its order and in the present state: tension, the force
 * f + c dl/dt (N) with which it pulls its ends together, f = k (l - L) or that of its law;
 * elongation, l - L (m); and strain, (l - L)/L, 0 where L = 0. Nullable: tension, elongation,
 * strain. */
MSIM_API msim_status msim_sim_springs(msim_sim *sim, double *tension /* nsprings */,
                                      double *elongation /* nsprings */,
                                      double *strain /* nsprings */);

/* Get the islands of the scene and their energies in the present state; set size first. The arrays
 * are borrowed until the next call with this sim. */
MSIM_API msim_status msim_sim_islands(msim_sim *sim, msim_islands *islands);

/* Get for each spring of the scene 1 if it is broken, by a threshold of its law or msim_sim_break;
 * else 0. */
MSIM_API msim_status msim_sim_broken(const msim_sim *sim, uint8_t *broken /* nsprings */);

/* Assemble the matrix of the next step. Refused if the method needs no matrix. MSIM_FORCE_FAILED,
 * MSIM_NOT_FINITE: a force function failed. */
MSIM_API msim_status msim_sim_matrix(msim_sim *sim, msim_csr *A, msim_error *err);

/* Describe the run as text. The first five lines are advice: what to do, the method and its steps,
 * the cost (msim_sim_estimate), what limits the steps, frames and sizes of files. The others report
 * decisions: method, solver, skipped features, stability limits, matrix size. */
MSIM_API msim_status msim_sim_explain(msim_sim *sim, const char **text, msim_error *err);

/* Say what to try after steps that have ended with MSIM_NOT_SPD, MSIM_NOT_CONVERGED,
 * MSIM_NOT_FINITE or MSIM_UNSTABLE: at most five sentences, one a line, the first the most likely
 * to help, as "Set h = 0.0018: ...". They follow from h and the stability limit, the method, the
 * solver and limits of iterations. "" otherwise. `size`: 1024 bytes hold all; sentences that do not
 * fit are left out. */
MSIM_API msim_status msim_sim_advice(msim_sim *sim, char *text, size_t size);

/*------------------------------------- ranks ----------------------------------------------------*/

/* Create communicators for ranks that are threads of this process: comms[r] is that of rank r, for
 * the thread that makes the calls of this rank. Calls that do not fit together, as a sum on one
 * rank and a maximum on another, fail on all of them. Nullable: alloc. */
MSIM_API msim_status msim_comm_threads_create(int32_t nranks, const msim_allocator *alloc,
                                              msim_comm **comms /* nranks */, msim_error *err);

/* Make pending and later calls of all ranks fail with this sentence, as when a thread ends early
 * and the others must not wait for it. May be called from any thread. */
MSIM_API void msim_comm_threads_fail(msim_comm *comm, const char *reason);

/* Destroy the communicators of all ranks, given any one of them. Nullable: comm. */
MSIM_API void msim_comm_threads_destroy(msim_comm *comm);

/* Create a communicator by the plugin `name`, msim_comm_NAME.so; collective. from: what it is made
 * from, as the plugin documents; NULL: all processes that were started together. Plugin statuses.
 * Nullable: from, plugin_path. */
MSIM_API msim_status msim_comm_open(const char *name, const void *from, const char *plugin_path,
                                    msim_comm **comm, msim_error *err);

/* Close a communicator of msim_comm_open; collective. Nullable: comm. */
MSIM_API void msim_comm_close(msim_comm *comm);

/*------------------------------------- recording ------------------------------------------------*/

/* Writer of a trajectory. The extension of the file selects the recorder: one of
 * msim_options.recorders, .csv, .html and .pvd (built in), .vtkhdf (plugin hdf5), or the plugin
 * with that name, see recorder.h. Its functions also return plugin statuses. It must be closed
 * before its sim is destroyed.
 * Where several ranks share the scene, all call its functions; rank 0 creates the file, and any
 * number of ranks resumes it. */
typedef struct msim_recorder msim_recorder;

/* Open a file for the frames that the options of the sim define. The file appears under its name as
 * soon as it can be read. It replaces an older trajectory of msim. MSIM_ERR_IO: another file has
 * that name, another recorder, in any process, is writing it, or it cannot be created;
 * MSIM_ERR_NAME: there is no recorder for the extension. */
MSIM_API msim_status msim_recorder_open(msim_sim *sim, const char *path, msim_recorder **recorder,
                                        msim_error *err);

/* The same, but replaces any file, unless a recorder is writing it. */
MSIM_API msim_status msim_recorder_replace(msim_sim *sim, const char *path,
                                           msim_recorder **recorder, msim_error *err);

/* Continue a .vtkhdf file of a run that was interrupted in any way: load its last checkpoint, like
 * msim_sim_load, into a sim in the initial state of that run, and append the following frames. The
 * last frame, which is then the state of the sim, is not written again. The run may have another
 * end within the frames planned in the file, which never grows. A file without frames starts from
 * the beginning. Refused, and nothing is changed, if the file was planned for other times or
 * msim_sim_load refuses. MSIM_ERR_IO: there is no such file; MSIM_ERR_UNSUPPORTED: .csv, .html, and
 * others whose recorders cannot. */
MSIM_API msim_status msim_recorder_resume(msim_sim *sim, const char *path, msim_recorder **recorder,
                                          msim_error *err);

/* Write the present state of the sim as the next frame. MSIM_UNSTABLE: the energy monitor refuses
 * the state, and the sim is in the last good one again; MSIM_NOT_FINITE: its energy is infinite; in
 * both cases nothing is written. MSIM_ERR_IO: the frame is missing, or incomplete if the message
 * says so; those before are intact. */
MSIM_API msim_status msim_recorder_write(msim_recorder *recorder, msim_error *err);

/* Finish the file and free the recorder, also after errors. MSIM_ERR_IO: a write that was buffered
 * has failed. Nullable: recorder. */
MSIM_API msim_status msim_recorder_close(msim_recorder *recorder, msim_error *err);

#ifdef __cplusplus
}
#endif
#endif
