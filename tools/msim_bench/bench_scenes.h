/* bench_scenes - the scenes that the benchmarks simulate */
#ifndef BENCH_BENCH_SCENES_H
#define BENCH_BENCH_SCENES_H

#include "msim/msim.h"

typedef struct bench_scene {
  const char *name;
  int32_t side; /* particles along an edge of 1 m */
  int solid;    /* 0: a cloth of 0.3 kg pinned at two corners, structural, shear and bend springs;
                   1: a jelly of 1 kg pinned at an upper edge, so that it swings; 13 springs per
                   particle */
  int random;   /* side^2 particles at random in a plane instead, see random_mesh.h */
} bench_scene;

/* The i-th scene; NULL past the end. */
const bench_scene *scene_info(int i);

/* NULL: none */
const bench_scene *scene_named(const char *name);

/* A cloth of 1 m x 1 m and 0.3 kg, all springs of stiffness k; `pinned` is not copied. */
msim_cloth bench_cloth(int32_t side, double k, int32_t npinned, const int32_t *pinned);

/* A scene in motion, half a second after its release, cloth1000 a tenth: a cloth is folded and
 * wrinkled, a jelly swings. */
typedef struct moving_scene {
  const bench_scene *kind;
  double k;        /* of each spring, N/m */
  int32_t threads; /* option of all sims */
  msim_scene *scene;
  msim_scene_view view;
  int32_t unknowns;
  msim_state state;
  double *x, *v, *zeros; /* 3n: the arrays of `state`; zeros */
  msim_error err;
} moving_scene;

/* Makes the scene only. alloc: NULL for malloc and free. Call moving_scene_free in any case. */
msim_status moving_scene_build(const bench_scene *kind, double k, const msim_allocator *alloc,
                               moving_scene *m);

/* The scene as built, with free particles displaced randomly so that no spring is at rest. Returns
 * 0 on failure and sets m->err. Call moving_scene_free in any case. */
int moving_scene_create_perturbed(const bench_scene *kind, double k, moving_scene *m);

/* Makes the scene and advances it by 0.5 s, cloth1000 by 0.1 s, or less if that takes more than
 * `seconds` of wall time; m->state.t is the time reached. until: when to give up, on the clock of
 * clock_seconds. Returns 0 on failure and sets m->err. Call moving_scene_free in any case. */
int moving_scene_create(const bench_scene *kind, double k, int32_t threads, double seconds,
                        double until, moving_scene *m);
void moving_scene_free(moving_scene *m);

/* iteration limit of linear solvers */
enum { MAX_ITERATIONS = 5000 };

/* Options of linearly implicit Euler with a positive definite matrix (clamped Jacobian). */
msim_options implicit_options(double h, double rtol, const char *solver, int32_t threads);

#endif
