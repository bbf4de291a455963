/* msim.h - the whole public API of msim, a library that simulates mass-spring systems.
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
 *    event (MSIM_NOT_SPD, MSIM_NOT_CONVERGED, MSIM_NOT_FINITE: the state is that before the step;
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

#include "msim/status.h"

#define MSIM_VERSION_MAJOR 0
#define MSIM_VERSION_MINOR 1
#define MSIM_VERSION_PATCH 0

#if defined(_WIN32) && !defined(MSIM_STATIC)
#  ifdef MSIM_BUILDING
#    define MSIM_API __declspec(dllexport)
#  else
#    define MSIM_API __declspec(dllimport)
#  endif
#elif defined(__GNUC__)
#  define MSIM_API __attribute__((visibility("default")))
#else
#  define MSIM_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/*------------------------------------- errors, memory -------------------------------------------*/

/* What went wrong: a sentence that names the culprit. Empty after success. */
typedef struct msim_error {
  msim_status status;
  char text[1020];
} msim_error;

/* Fixed text for a status; never NULL. */
MSIM_API const char *msim_status_text(msim_status status);

/* The version of the library that runs, "0.1.0". */
MSIM_API const char *msim_version(void);

/* All memory of a scene, and of sims made from it, comes from here. free(NULL) must be allowed;
 * where sims run in several threads, both must be callable from all of them. */
typedef struct msim_allocator {
  void *(*alloc)(size_t bytes, void *user); /* NULL when there is none left */
  void (*free)(void *ptr, void *user);
  void *user;
} msim_allocator;

/*------------------------------------- scene ----------------------------------------------------*/

typedef struct msim_scene msim_scene;

/* The half space n.x >= d. A particle found outside after a step, s = n.x - d < 0, is reflected
 * (Teschner): x -= (1 + e) s n, and if n.v < 0 too: v += J n with J = -(1 + e) n.v, the part of v
 * along the plane times max(0, 1 - mu J/|v_t|). With option collision = event v changes like that
 * where and when the particle meets the plane. */
typedef struct msim_plane {
  double normal[3];   /* any length but 0; scaled to 1, and offset with it */
  double offset;      /* m */
  double restitution; /* [0, 1] */
  double friction;    /* Coulomb's, >= 0 */
} msim_plane;

/* n particles on a straight line, a spring between neighbours. */
typedef struct msim_rope {
  size_t size;
  int32_t n;             /* >= 1 */
  double from[3], to[3]; /* the first and the last particle, m */
  double mass;           /* of the whole rope, kg, > 0 */
  double k, damping;     /* N/m, N s/m; k = 0 leaves the springs out */
  int32_t npinned;
  const int32_t *pinned; /* npinned, indices within the object */
} msim_rope;

/* rows x columns particles in a parallelogram; particle r * columns + c lies at
 * origin + r/(rows-1) row + c/(columns-1) column. Springs of a particle: right, down,
 * down-right, down-left, two right, two down; listed by first particle. */
typedef struct msim_cloth {
  size_t size;
  int32_t rows, columns;                /* >= 1 */
  double origin[3], row[3], column[3];  /* m; row and column are whole edges of the cloth */
  double mass;                          /* of the whole cloth, kg, > 0 */
  double k_structural, k_shear, k_bend; /* N/m; 0 leaves those springs out */
  double damping;                       /* N s/m, of each spring */
  int32_t npinned;
  const int32_t *pinned; /* npinned, indices within the object */
} msim_cloth;

/* n[0] x n[1] x n[2] particles in a box; particle (ix * n[1] + iy) * n[2] + iz. Springs along the
 * edges, the face diagonals and the body diagonals of each cell. */
typedef struct msim_lattice {
  size_t size;
  int32_t n[3];                /* >= 1 each */
  double origin[3], extent[3]; /* the corner of least coordinates; edge lengths, >= 0; m */
  double mass;                 /* of the whole lattice, kg, > 0 */
  double k, damping;           /* N/m, N s/m; k = 0 leaves the springs out */
  int32_t npinned;
  const int32_t *pinned; /* npinned, indices within the object */
} msim_lattice;

/* Everything a scene holds, borrowed. */
typedef struct msim_scene_view {
  size_t size;
  const char *name; /* never NULL */
  int32_t nparticles, nsprings, nplanes;
  const double *x, *v;              /* 3 nparticles */
  const double *mass;               /* nparticles */
  const uint8_t *pinned;            /* nparticles: 1 where pinned */
  const int32_t *ij;                /* 2 nsprings */
  const double *k, *rest, *damping; /* nsprings */
  const msim_plane *planes;         /* nplanes, with unit normals */
  double gravity[3];                /* m/s^2 */
  double drag;                      /* N s/m: force -drag v on every particle */
} msim_scene_view;

/* Make an empty scene. Nullable: alloc (malloc and free are used). */
MSIM_API msim_status msim_scene_create(const msim_allocator *alloc, msim_scene **scene,
                                       msim_error *err);

/* Read a scene file (JSON). What is wrong is named by file, line or key. Nullable: alloc. */
MSIM_API msim_status msim_scene_load(const msim_allocator *alloc, const char *path,
                                     msim_scene **scene, msim_error *err);

/* The same from memory; `label` stands for the file name in errors. Nullable: alloc. */
MSIM_API msim_status msim_scene_parse(const msim_allocator *alloc, const char *label,
                                      const char *text, size_t length, msim_scene **scene,
                                      msim_error *err);

/* Write the scene as a scene file: objects expanded, every number exact. */
MSIM_API msim_status msim_scene_save(const msim_scene *scene, const char *path, msim_error *err);

MSIM_API void msim_scene_destroy(msim_scene *scene);

MSIM_API msim_status msim_scene_set_name(msim_scene *scene, const char *name, msim_error *err);
MSIM_API msim_status msim_scene_set_gravity(msim_scene *scene, const double gravity[3],
                                            msim_error *err);
MSIM_API msim_status msim_scene_set_drag(msim_scene *scene, double drag /* >= 0 */,
                                         msim_error *err);

/* Append n particles. Nullable: v (at rest). */
MSIM_API msim_status msim_scene_add_particles(msim_scene *scene, int32_t n,
                                              const double *x /* 3n */, const double *v /* 3n */,
                                              const double *mass /* n, > 0 */, msim_error *err);

/* Append n springs. With d = x_j - x_i, l = |d|, u = d/l the force on i is
 * k (l - rest) u + damping (u . (v_j - v_i)) u, on j the opposite; l = 0: no force.
 * Nullable: rest (the distance now), damping (0). All of them >= 0. */
MSIM_API msim_status msim_scene_add_springs(msim_scene *scene, int32_t n,
                                            const int32_t *ij /* 2n */, const double *k /* n */,
                                            const double *rest /* n */,
                                            const double *damping /* n */, msim_error *err);

MSIM_API msim_status msim_scene_add_plane(msim_scene *scene, const msim_plane *plane,
                                          msim_error *err);

/* Hold n particles where they are for ever; their velocity must be 0. */
MSIM_API msim_status msim_scene_pin(msim_scene *scene, int32_t n, const int32_t *particles /* n */,
                                    msim_error *err);

MSIM_API msim_status msim_scene_add_rope(msim_scene *scene, const msim_rope *rope, msim_error *err);
MSIM_API msim_status msim_scene_add_cloth(msim_scene *scene, const msim_cloth *cloth,
                                          msim_error *err);
MSIM_API msim_status msim_scene_add_lattice(msim_scene *scene, const msim_lattice *lattice,
                                            msim_error *err);

/* Everything in the scene; set view->size before. Valid until the scene is changed. */
MSIM_API void msim_scene_get(const msim_scene *scene, msim_scene_view *view);

/*------------------------------------- options --------------------------------------------------*/

enum { MSIM_JACOBIAN_EXACT, MSIM_JACOBIAN_CLAMP };
enum { MSIM_INDEFINITE_CLAMP, MSIM_INDEFINITE_SOLVE, MSIM_INDEFINITE_STOP };

/* REFLECT: the state after the step, as the notes do; of first order whatever the method.
 * EVENT: v at the time of the impact, located inside the step to rounding, so that methods keep
 * their order, with rest and sliding on planes; planes met together act together. Where more than 4
 * particles have impacts in one step, each flies on for itself: of second order. Not for `verlet`
 * and `respa`, and not with tol. */
enum { MSIM_COLLISION_REFLECT, MSIM_COLLISION_EVENT };
enum { MSIM_HEUN_FINAL, MSIM_HEUN_STANDARD, MSIM_HEUN_LITERAL };
enum { MSIM_VERLET_TAYLOR, MSIM_VERLET_PLAIN };

/* As a time step: 0.9 of the longest one with which an explicit method is stable in every state of
 * the scene, whatever its accuracy. Refused where there is no such limit, or it is 0. */
#define MSIM_H_AUTO (-1.0)

/* Passes that a scene without need for them is spared, unless switched off here. */
enum {
  MSIM_SKIP_SPRINGS = 1u << 0,
  MSIM_SKIP_DAMPING = 1u << 1,
  MSIM_SKIP_GRAVITY = 1u << 2,
  MSIM_SKIP_DRAG = 1u << 3,
  MSIM_SKIP_PLANES = 1u << 4,
  MSIM_SKIP_KEPT_FACTOR = 1u << 5,      /* off: each step makes its factors anew */
  MSIM_SKIP_TWO_D = 1u << 6,            /* off: flat scenes are computed in 3 components too */
  MSIM_SKIP_ZERO_REST_LENGTH = 1u << 7, /* off: springs of rest length 0 are treated as others */
  MSIM_SKIP_AT_REST = 1u << 8,          /* off: steps are made where they change nothing too */
  MSIM_SKIP_ISLANDS = 1u << 9           /* off: one system of all, connected by springs or not */
};

typedef struct msim_backend msim_backend; /* a linear solver, of msim/backend.h */

/* msim_option_info describes each member; strings are borrowed. */
typedef struct msim_options {
  size_t size;                   /* sizeof(msim_options); set by msim_options_init */
  const char *integrator;        /* required; see msim_integrator_info */
  double h;                      /* time step, s, or the first one to try; or MSIM_H_AUTO [1e-3] */
  int64_t steps;                 /* number of steps; -1 [default]: by t_end */
  double t_end;                  /* end time, s; -1 [default]: by steps */
  const char *solver;            /* linear solver ["auto"] */
  double solver_rtol;            /* ||b - A v|| <= rtol ||b|| [1e-8] */
  int32_t solver_max_iterations; /* of an iterative solver [2000] */
  int32_t jacobian;              /* MSIM_JACOBIAN_... [EXACT] */
  int32_t indefinite;            /* MSIM_INDEFINITE_... [CLAMP] */
  double newton_rtol;            /* [1e-8] */
  int32_t newton_max_iterations; /* [100] */
  int32_t collision;             /* MSIM_COLLISION_... [REFLECT] */
  double tol; /* error control; 0 [default]: fixed steps of h; auto, dop853 without `steps`: 1e-6 */
  int32_t threads;         /* at most so many; 0 [default]: by size. Bits do not depend on it */
  int32_t heun_collision;  /* MSIM_HEUN_... [FINAL] */
  int32_t verlet_start;    /* MSIM_VERLET_... [TAYLOR] */
  int64_t every;           /* a frame every so many steps; 0 [default]: by fps */
  double fps;              /* frames per simulated second; 0 [default]: about 200 a run */
  uint32_t skip_off;       /* MSIM_SKIP_...: passes to keep although nothing needs them [0] */
  const char *plugin_path; /* folders searched for plugins first, ':' between [NULL] */
  /* Told what a run should know but need not stop for: that h was lowered to end at t_end, or that
   * it is too long for the method to be stable. Nullable. */
  void (*warn)(const char *text, void *user);
  void *warn_user;
  /* Solvers that the program brings along: option `solver` finds them by name, before any other.
   * NULL at the end; tables that live as long as the sims. Nullable. */
  const msim_backend *const *backends;
  /* A fixed step that does not converge or is not finite is made in 2, 4, ... parts: times that
   * they are halved. Output times stay [0] */
  int32_t newton_retries;
} msim_options;

MSIM_API void msim_options_init(msim_options *opt, size_t size);

/* Set one option by its name on the command line and in scene files, as "solver.rtol", "1e-10".
 * The text is borrowed where the option is a string. */
MSIM_API msim_status msim_options_set(msim_options *opt, const char *name, const char *value,
                                      msim_error *err);

/* Set what the scene's `run` asks for; strings are borrowed from the scene. */
MSIM_API msim_status msim_options_from_scene(msim_options *opt, const msim_scene *scene,
                                             msim_error *err);

typedef struct msim_option_entry {
  const char *name;   /* "solver.rtol" */
  const char *values; /* what it accepts: "number > 0", "exact | clamp" */
  const char *preset; /* the default, "" where there is none */
  const char *doc;    /* one sentence */
} msim_option_entry;

/* The i-th option, NULL past the end. */
MSIM_API const msim_option_entry *msim_option_info(int32_t i);

/*------------------------------------- what there is --------------------------------------------*/

typedef struct msim_integrator_entry {
  const char *name;
  const char *doc;  /* the formula in a sentence */
  int32_t order;    /* of accuracy between impacts; 0: `auto`, which is one of the others */
  int32_t implicit; /* 1: solves a linear system in each step */
} msim_integrator_entry;

/* The i-th integrator, NULL past the end. */
MSIM_API const msim_integrator_entry *msim_integrator_info(int32_t i);

typedef struct msim_plugin_entry {
  const char *name;
  const char *library; /* the library behind it, with its version */
  const char *license; /* of that library, SPDX */
  const char *note;    /* where it lies, or why it cannot be used; stands in err */
  int32_t available;   /* 1: can be used here and now */
} msim_plugin_entry;

/* Tell of the i-th solver or recorder that is built in or known by name; 0 past the end, else 1.
 * This opens the plugin: ask only when somebody wants to know. Nullable: plugin_path. */
MSIM_API int32_t msim_solver_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                  msim_error *err);
MSIM_API int32_t msim_recorder_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                    msim_error *err);

/* The table of the solver that option `solver` = name would take, opening its plugin; MSIM_ERR_NAME
 * for the built-in ones, which have none. It is never unloaded. Nullable: plugin_path. */
MSIM_API msim_status msim_solver_backend(const char *name, const char *plugin_path,
                                         const msim_backend **backend, msim_error *err);

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
  int64_t contacts;         /* particles reflected, once a pass; impacts located */
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
 * once. No step allocates.
 *
 * Parts of the scene that no spring connects are islands: systems of their own, each with a solver
 * of its own, and not stepped while at exact rest. Pinned particles connect nothing; what is below
 * 512 particles is taken together with others.
 *
 * Error control is on where options.tol is set, or the method is dop853 and options.steps is not:
 * then steps are as long as their error E, in root mean square by mass, allows. A step of h may add
 *   E^2 = 1/(2 m) sum_i m_i (|dx_i|^2/L^2 + |dv_i|^2/U^2) <= (tol h/T)^2,
 * with the extent L and the speed U of the scene (explain tells them) and the length T of the run
 * up to t_end, or 1 s where there is none. So tol stands for the error at the end as far as errors
 * neither grow nor fade on the way: a tenth of tol makes about a tenth of the error. dop853 has an
 * estimate of its own; others make each step of two halves and compare with a whole one. `verlet`,
 * `bdf2`, `rkc` and `respa` have none. Particles are reflected at the end of a step, and one that
 * leads them deeper into planes than tol L, in root mean square, is shortened to end at the impact.
 * `step` counts the steps accepted, and the last one ends at t_end. Setting a state starts a new
 * run: its error is counted from there.
 * With integrator = "auto" each run begins with the choice of a method, by tol and steps tried in
 * the scene, as explain tells: counts decide, never a clock. Where stability alone sets the steps,
 * and there are no planes, they are fixed. `h` is not asked for, `steps` is refused.
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

/* Ask a running msim_sim_step or msim_sim_run to return MSIM_STOPPED after the step it is in.
 * May be called from another thread and from a signal handler. */
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
 * when it is complete enough to be read. */
MSIM_API msim_status msim_recorder_open(msim_sim *sim, const char *path, msim_recorder **recorder,
                                        msim_error *err);

/* Write the sim's present state as the next frame. */
MSIM_API msim_status msim_recorder_write(msim_recorder *recorder, msim_error *err);

/* Finish the file and free the recorder, also after errors. Nullable: recorder. */
MSIM_API msim_status msim_recorder_close(msim_recorder *recorder, msim_error *err);

#ifdef __cplusplus
}
#endif
#endif
