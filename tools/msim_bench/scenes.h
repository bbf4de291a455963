/* scenes - what the benches simulate */
#ifndef BENCH_SCENES_H
#define BENCH_SCENES_H

#include "msim/msim.h"

typedef struct bench_scene {
  const char *name;
  int32_t side; /* particles along an edge of 1 m */
  int solid;    /* 0: a cloth of 0.3 kg held at two corners, structural, shear and bend springs;
                   1: a jelly of 1 kg held at an upper edge, so that it swings; 13 springs a
                   particle */
  int random;   /* neither: side^2 particles at random in a plane, see mesh.h */
} bench_scene;

/* The i-th scene, NULL past the end. */
const bench_scene *scene_info(int i);

/* The scene whose name is the first `length` characters; NULL: there is none. */
const bench_scene *scene_find(const char *name, size_t length);
const bench_scene *scene_named(const char *name);

/* 1 m x 1 m of 0.3 kg, every spring of k, held at the particles given, which it borrows. */
msim_cloth bench_cloth(int32_t side, double k, int32_t npinned, const int32_t *pinned);

/* A scene in motion, half a second after it was let go: a cloth is folded and wrinkled, a jelly
 * swings. */
typedef struct moving {
  const bench_scene *kind;
  double k;        /* of each spring, N/m */
  int32_t threads; /* option of all sims */
  msim_scene *scene;
  msim_scene_view view;
  int32_t unknowns;
  msim_state state;
  double *x, *v, *none; /* 3n: what state points to; zeros */
  msim_error err;
} moving;

/* The scene as it is built, every particle moved a little, so that no spring is at rest. 0 where it
 * failed, and why in m->err. Call moving_free in any case. */
int moving_shaken(const bench_scene *kind, double k, moving *m);

/* seconds: for falling; where that is too short, an earlier state is taken, and m->state.t tells
 * which. until: when to give up, on wall_seconds' clock. 0 where it failed, and why in m->err. Call
 * moving_free in any case. */
int moving_make(const bench_scene *kind, double k, int32_t threads, double seconds, double until,
                moving *m);
void moving_free(moving *m);

/* After so many an iterative solver has failed. */
enum { MOST_ITERATIONS = 5000 };

/* Options of one linearly implicit step with a matrix that is positive definite. */
msim_options implicit_options(double h, double rtol, const char *solver, int32_t threads);

#endif
