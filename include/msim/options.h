/* options.h - how a scene is to move, and what there is to choose from; conventions: msim.h */
#ifndef MSIM_OPTIONS_H
#define MSIM_OPTIONS_H

#include "msim/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { MSIM_JACOBIAN_EXACT, MSIM_JACOBIAN_CLAMP };
enum { MSIM_INDEFINITE_CLAMP, MSIM_INDEFINITE_SOLVE, MSIM_INDEFINITE_STOP };

/* REFLECT: the state after the step is mirrored at planes; of first order whatever the method.
 * EVENT: impacts are located inside the step, so that methods keep their order, with exact rest,
 * sliding and sticking on planes; planes met together act together. Not for `verlet` and `respa`.
 * With tol impacts are located in any case. */
enum { MSIM_COLLISION_REFLECT, MSIM_COLLISION_EVENT };

/* ON: every 160 explicit steps, every implicit one, before each frame and at the end of a run the
 * motion is checked: kinetic and elastic energy, and the extent of the scene, beyond 100 times what
 * the start and gravity can supply end it with MSIM_UNSTABLE. Under tol, a note reports motion in
 * which errors of steps grow (chaos). Bits do not depend on it. */
enum { MSIM_WATCH_ON, MSIM_WATCH_OFF };

/* Of trajectories. OFF: each frame is the system's to keep once it is written: it outlives this
 * process, however that ends. ON: it is on the disk, and outlives a power cut. */
enum { MSIM_SYNC_OFF, MSIM_SYNC_ON };
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
  size_t size;            /* sizeof(msim_options); set by msim_options_init */
  const char *integrator; /* required; see msim_integrator_info */
  double h;               /* time step, s, or the first one to try; or MSIM_H_AUTO [1e-3] */
  int64_t steps;          /* number of steps; -1 [default]: by t_end */
  double t_end;           /* end time, s; -1 [default]: by steps */
  const char *solver;     /* linear solver ["auto"] */
  double
      solver_rtol; /* ||b - A dv|| <= rtol ||b||, in the norm sqrt(r.D^-1 r), D the diagonal blocks
                         of A: relative to the change of v in the step [1e-8] */
  int32_t solver_max_iterations; /* of an iterative solver [2000] */
  int32_t jacobian;              /* MSIM_JACOBIAN_... [EXACT] */
  int32_t indefinite;            /* MSIM_INDEFINITE_... [CLAMP] */
  double newton_rtol;            /* of the error of v over its change in the step [1e-8] */
  int32_t newton_max_iterations; /* of a step, or of each of its parts [1000] */
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
   * they are halved. Output times stay; stats.rejected_steps counts the attempts. -1 [default]: 6
   * with nonlinear methods, else 0 */
  int32_t newton_retries;
  int32_t watch; /* MSIM_WATCH_... [ON] */
  int32_t sync;  /* MSIM_SYNC_... [OFF] */
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

/* Tell of the i-th solver, recorder or importer (of scene files that are not JSON) that is built in
 * or known by name; 0 past the end, else 1. This opens the plugin: ask only when somebody wants to
 * know. Nullable: plugin_path. */
MSIM_API int32_t msim_solver_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                  msim_error *err);
MSIM_API int32_t msim_recorder_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                    msim_error *err);
MSIM_API int32_t msim_importer_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                                    msim_error *err);

/* The table of the solver that option `solver` = name would take, opening its plugin; MSIM_ERR_NAME
 * for the built-in ones, which have none. It is never unloaded. Nullable: plugin_path. */
MSIM_API msim_status msim_solver_backend(const char *name, const char *plugin_path,
                                         const msim_backend **backend, msim_error *err);

#ifdef __cplusplus
}
#endif
#endif
