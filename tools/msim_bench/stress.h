/* stress - scenes in which methods break down, and the outcome of running them */
#ifndef BENCH_STRESS_H
#define BENCH_STRESS_H

#include "msim/msim.h"

typedef struct stress_scene {
  const char *name;
  /* of springs, N/m and N s/m; mass of the heaviest particle over that of the lightest */
  double k, damping, ratio;
  double drag, g; /* N s/m, m/s^2 */
  int planes;     /* 1: a floor, 2: a corner of two planes */
  double restitution;
  int64_t steps;                                 /* at h = 1 ms; 0: the default */
  void (*place)(double (*x)[3], double (*v)[3]); /* sets STRESS_N particles */
  double rest;                                   /* -1: rest lengths 0; 0: those of the undeformed
                                                    scene */
  int pinned;                                    /* number of pinned particles, the first ones */
} stress_scene;

enum { STRESS_N = 9 };

/* The i-th scene; NULL past the end. */
const stress_scene *stress_info(int i);
msim_status stress_make(const stress_scene *s, msim_scene **scene, msim_error *err);

typedef enum stress_outcome {
  STABLE,
  BOUNDED,
  DISSIPATED,
  REPORTED,
  SILENT,
  CRASHED,
  HUNG,
  UNSUPPORTED, /* no sim was made, as the method does not support the forces; not a cell */
  STRESS_OUTCOMES
} stress_outcome;

extern const char *const stress_words[STRESS_OUTCOMES];

typedef struct stress_result {
  stress_outcome outcome;
  int64_t detection_steps; /* steps from exceeding the bound to the report; -1: not exceeded */
  char text[256];
} stress_result;

/* Runs that many steps in a child process, with a time limit in s. watch: as in msim_options */
stress_result stress_run(const stress_scene *s, const char *method, double h, int64_t steps,
                         int watch, unsigned seconds);

#endif
