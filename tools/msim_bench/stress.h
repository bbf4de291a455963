/* stress - scenes that methods break down on, and what becomes of them */
#ifndef BENCH_STRESS_H
#define BENCH_STRESS_H

#include "msim/msim.h"

typedef struct stress_scene {
  const char *name;
  /* of springs, N/m and N s/m; of the heaviest particle over the lightest */
  double k, damping, ratio;
  double drag, g; /* N s/m, m/s^2 */
  int planes;     /* 1: a floor, 2: a corner */
  double restitution;
  int64_t steps;                                 /* at h = 1 ms; 0: as everywhere */
  void (*place)(double (*x)[3], double (*v)[3]); /* STRESS_N particles */
  double rest;                                   /* rest lengths, in those of the straight scene */
  int pinned;                                    /* so many of the first particles */
} stress_scene;

enum { STRESS_N = 9 };

/* The i-th scene, NULL past the end. */
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
  REFUSED, /* there is no sim, as of forces that the method does not take: not counted as a cell */
  STRESS_OUTCOMES
} stress_outcome;

extern const char *const stress_words[STRESS_OUTCOMES];

typedef struct stress_result {
  stress_outcome outcome;
  int64_t late; /* steps from passing the bound to the report; -1: nothing of that */
  char text[256];
} stress_result;

/* A run of so many steps in a process of its own, which may take so many seconds. watch: as in
 * msim_options */
stress_result stress_run(const stress_scene *s, const char *method, double h, int64_t steps,
                         int watch, unsigned seconds);

#endif
