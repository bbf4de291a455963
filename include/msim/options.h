/* options.h - options of a sim, and lists of methods and plugins; conventions: msim.h */
#ifndef MSIM_OPTIONS_H
#define MSIM_OPTIONS_H

#include "msim/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The matrix J = df/dx of implicit methods. */
enum {
  MSIM_JACOBIAN_EXACT = 0, /* the derivative of the spring forces */
  MSIM_JACOBIAN_CLAMP = 1  /* with the transverse term of compressed springs set to 0 */
};

/* What happens if the exact matrix of a step is not positive definite. */
enum {
  MSIM_INDEFINITE_CLAMP = 0, /* the step is repeated with the clamped matrix */
  MSIM_INDEFINITE_SOLVE = 1, /* the indefinite system is solved, by a solver that can */
  MSIM_INDEFINITE_STOP = 2   /* the run ends with MSIM_NOT_SPD */
};

/* How impacts on planes are treated. With tol they are located in any case. */
enum {
  /* Particles that are behind a plane at the end of a step are reflected; of order 1 with any
   * method. In scenes with colliders implicit methods whose step does not resolve the springs
   * constrain particles in contact. */
  MSIM_COLLISION_REFLECT = 0,
  /* Impacts are located inside the step, so that methods keep their order, with exact rest, sliding
   * and sticking on planes; simultaneous impacts on several planes are solved together. Not for
   * `verlet` and `respa`. */
  MSIM_COLLISION_EVENT = 1
};

/* A fixed step whose linear solver or Newton's method has reached its maximum of iterations. */
enum {
  MSIM_INCOMPLETE_STOP = 0,  /* it fails: it is repeated in substeps (newton_retries), or the run
                                ends with MSIM_NOT_CONVERGED */
  MSIM_INCOMPLETE_ACCEPT = 1 /* it is made with the iterate reached, if that is finite, and counted
                                in msim_stats.incomplete_steps: the cost of a step is bounded */
};

/* The energy monitor. Results do not depend on it. */
enum {
  /* The motion is checked after every 160th explicit step, after every implicit step, before each
   * frame and at the end of a run. If kinetic plus elastic energy, or the extent of the scene,
   * exceeds 100 times what the initial state and gravity can supply, the run ends with
   * MSIM_UNSTABLE. With tol, a warning reports motion in which the errors of steps grow (chaos). */
  MSIM_WATCH_ON = 0,
  MSIM_WATCH_OFF = 1 /* nothing is checked but that the state is finite */
};

/* Contacts, for msim_sim_contacts. Results do not depend on it. */
enum {
  MSIM_CONTACTS_OFF = 0,
  MSIM_CONTACTS_ON = 1 /* each step records which particles touch which planes and colliders, and
                          the impulses; integrator = auto refuses it */
};

/* Durability of trajectories. */
enum {
  MSIM_SYNC_OFF = 0, /* each frame is passed to the operating system and survives the end of this
                        process, however it ends */
  MSIM_SYNC_ON = 1   /* each frame is flushed to the disk and survives power failure */
};

/* What `heun` reflects at planes. */
enum {
  MSIM_HEUN_FINAL = 0,    /* the stage, for its acceleration only, and the result */
  MSIM_HEUN_STANDARD = 1, /* the result */
  MSIM_HEUN_LITERAL = 2   /* the stage, not the result, so that particles never bounce */
};

/* The precision of positions, velocities and forces in steps. Times, energies and what the
 * functions of msim.h return are doubles in any case. */
enum {
  MSIM_PRECISION_DOUBLE = 0,
  MSIM_PRECISION_SINGLE = 1, /* floats, for explicit methods up to order 4 with steps of h and
                                linearly-implicit-euler, in scenes of springs without laws: faster,
                                with errors of some 1e-5 */
  MSIM_PRECISION_AUTO = 2    /* floats where integrator = auto chooses a method that keeps tol with
                                them; else doubles, as with every method that is named */
};

/* Initial v(-h/2) of `verlet`. */
enum {
  MSIM_VERLET_TAYLOR = 0, /* v0 - h/2 a0 */
  MSIM_VERLET_PLAIN = 1   /* v0 */
};

/* Value of the step size: 0.9 of the largest one for which an explicit method is stable in every
 * state of the scene; this says nothing about accuracy. Refused if there is no limit or it is 0. */
#define MSIM_H_AUTO (-1.0)

/* Features that are skipped in scenes that do not need them, unless set in
 * msim_options.skip_off. */
enum {
  MSIM_SKIP_SPRINGS = 1u << 0,          /* off: loops over springs even if there are none */
  MSIM_SKIP_DAMPING = 1u << 1,          /* off: dashpots are computed even if all are 0 */
  MSIM_SKIP_GRAVITY = 1u << 2,          /* no effect: gravity is always added, at no cost */
  MSIM_SKIP_DRAG = 1u << 3,             /* off: drag is computed even if it is 0 */
  MSIM_SKIP_PLANES = 1u << 4,           /* off: contact is looked for even without planes */
  MSIM_SKIP_KEPT_FACTOR = 1u << 5,      /* off: every step factors anew */
  MSIM_SKIP_TWO_D = 1u << 6,            /* off: planar scenes are computed in 3 components, too */
  MSIM_SKIP_ZERO_REST_LENGTH = 1u << 7, /* off: no special treatment of springs of rest length 0 */
  MSIM_SKIP_AT_REST = 1u << 8,          /* off: steps are made at exact rest as well */
  MSIM_SKIP_ISLANDS = 1u << 9           /* off: one system for all particles, connected or not */
};

typedef struct msim_sim msim_sim;                     /* a scene in motion, see msim/msim.h */
typedef struct msim_backend msim_backend;             /* a linear solver, see msim/backend.h */
typedef struct msim_recorder_type msim_recorder_type; /* writes trajectories, see msim/recorder.h */
typedef struct msim_comm msim_comm; /* joins ranks that share one scene, see msim/comm.h */

/* msim_option_info describes each member. Strings are borrowed until msim_sim_create has copied
 * them. Defaults are in brackets. */
typedef struct msim_options {
  size_t size;            /* sizeof(msim_options); set by msim_options_init */
  const char *integrator; /* required; see msim_integrator_info */
  double h;               /* step size, s, or the first one to try; or MSIM_H_AUTO [1e-3] */
  int64_t steps;          /* number of steps; -1: given by t_end [-1] */
  double t_end;           /* end of the run, s; -1: given by steps [-1] */
  const char *solver;     /* linear solver ["auto"] */
  double
      solver_rtol; /* ||b - A dv|| <= rtol ||b|| in the norm ||r|| = sqrt(r.D^-1 r), D the diagonal
                      blocks of A; dv: change of the velocity in the step [1e-8] */
  int32_t solver_max_iterations; /* of an iterative solver [2000] */
  int32_t jacobian;              /* MSIM_JACOBIAN_... [EXACT] */
  int32_t indefinite;            /* MSIM_INDEFINITE_... [CLAMP] */
  double newton_rtol;            /* error of v over its change in the step [1e-8] */
  int32_t newton_max_iterations; /* in a step, or in each of its substeps [1000] */
  int32_t collision;             /* MSIM_COLLISION_... [REFLECT] */
  double tol;      /* error control; 0: fixed steps of h [0; auto, dop853 without `steps`: 1e-6] */
  int32_t threads; /* maximum; 0: by size [0]. The results do not depend on it */
  int32_t heun_collision;  /* MSIM_HEUN_... [FINAL] */
  int32_t verlet_start;    /* MSIM_VERLET_... [TAYLOR] */
  int64_t every;           /* steps between frames; 0: given by fps [0] */
  double fps;              /* frames per simulated second; 0: about 200 in a run [0] */
  uint32_t skip_off;       /* MSIM_SKIP_...: features that are not skipped [0] */
  const char *plugin_path; /* folders searched first for plugins, ':' between [NULL] */
  /* Receives warnings, for example that h was reduced to end at t_end, or that the method is
   * unstable with this h. Nullable. */
  void (*warn)(const char *text, void *user);
  void *warn_user;
  /* Solvers provided by the program: option `solver` finds them by name, before all others. A list
   * that ends with NULL; it and its tables must outlive the sims. Nullable. */
  const msim_backend *const *backends;
  /* A fixed step that does not converge, or is not finite, is repeated in 2, 4, ... substeps: the
   * maximum number of these bisections. Output times stay; stats.rejected_steps counts the
   * attempts. -1: 6 with nonlinear methods, else 0 [-1] */
  int32_t newton_retries;
  int32_t watch; /* MSIM_WATCH_... [ON] */
  int32_t sync;  /* MSIM_SYNC_... [OFF] */
  /* Recorders provided by the program: a file's extension finds them before all others. A list that
   * ends with NULL; its tables must outlive the sims. Nullable. */
  const msim_recorder_type *const *recorders;
  int32_t incomplete; /* MSIM_INCOMPLETE_... [STOP]; unused under error control */
  int32_t contacts;   /* MSIM_CONTACTS_... [OFF] */
  /* The ranks that simulate the scene together: see msim_sim_create. Nullable; must outlive the sim
   * [NULL] */
  const msim_comm *comm;
  const char *solver_options; /* for the library behind the solver, in its own words; NULL: none */
  int32_t precision;          /* MSIM_PRECISION_... [AUTO] */
} msim_options;

/* Set all options to their defaults; size: sizeof(msim_options). MSIM_ERR_SIZE: it is too small for
 * any member, and nothing is written. */
MSIM_API msim_status msim_options_init(msim_options *opt, size_t size);

/* Set one option by its name on the command line and in scene files, as in "solver.rtol", "1e-10".
 * The value is borrowed if the option is a string. MSIM_ERR_ARG: unknown name or invalid value. */
MSIM_API msim_status msim_options_set(msim_options *opt, const char *name, const char *value,
                                      msim_error *err);

/* Set the options in `run` of the scene file: all, or none after an error, as of msim_options_set.
 * Strings are borrowed from the scene. */
MSIM_API msim_status msim_options_from_scene(msim_options *opt, const msim_scene *scene,
                                             msim_error *err);

/* Owned by the library */
typedef struct msim_option_entry {
  const char *name;   /* "solver.rtol" */
  const char *values; /* accepted values: "number > 0", "exact | clamp" */
  const char *preset; /* default, "" if there is none */
  const char *doc;    /* one sentence */
} msim_option_entry;

/* Get the i-th option, NULL past the end. */
MSIM_API const msim_option_entry *msim_option_info(int32_t i);

/* The name that was probably meant by `word`: that for which other systems say `word` ("dt": "h"),
 * else one that begins with it, else the most similar one. NULL: none. `names` ends with NULL. */
MSIM_API const char *msim_nearest_name(const char *word, const char *const *names);

/*------------------------------------- lists ----------------------------------------------------*/

/* Owned by the library */
typedef struct msim_integrator_entry {
  const char *name;
  const char *doc;  /* the formula, in one sentence */
  int32_t order;    /* of accuracy between impacts; 0: `auto`, which chooses one of the others */
  int32_t implicit; /* 1: solves a linear system in each step */
} msim_integrator_entry;

/* Get the i-th integrator, NULL past the end. */
MSIM_API const msim_integrator_entry *msim_integrator_info(int32_t i);

typedef struct msim_plugin_entry {
  size_t size; /* sizeof(msim_plugin_entry), set by the caller */
  const char *name;
  const char *library; /* the library behind it, with its version */
  const char *license; /* license of that library, SPDX */
  const char *note;    /* path of the plugin, or why it is not available; stored in err */
  int32_t available;   /* 1: can be used on this machine */
} msim_plugin_entry;

/* Describe the i-th solver, recorder, importer (of scene files other than JSON) or kind of
 * communicator (see msim_comm_open), built in or known by name; 0 past the end, or if entry->size
 * is 0 (then err says so), else 1. This loads the plugin, and opens no communicator. Nullable:
 * plugin_path. */
MSIM_API int32_t msim_solver_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                  msim_error *err);
MSIM_API int32_t msim_recorder_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                    msim_error *err);
MSIM_API int32_t msim_importer_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                    msim_error *err);
MSIM_API int32_t msim_comm_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                msim_error *err);

/* Get the function table of the solver that option `solver` = name selects, and load its plugin,
 * for good. Plugin statuses; MSIM_ERR_NAME also for the built-in solvers, which have none.
 * Nullable: plugin_path. */
MSIM_API msim_status msim_solver_backend(const char *name, const char *plugin_path,
                                         const msim_backend **backend, msim_error *err);

#ifdef __cplusplus
}
#endif
#endif
