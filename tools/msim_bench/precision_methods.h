/* precision_methods - the methods in the benchmark `precision` and their settings, fixed in advance
 *
 * Fixed steps: h = L, L/2, L/4, ... from the longest stable step L on, or from 64 times that of
 * Verlet for methods without a limit; MRIStep of SUNDIALS likewise, for its slow steps. Error
 * control, and the other methods of SUNDIALS: tol = 1e-1, 1e-2, ... */
#ifndef BENCH_PRECISION_METHODS_H
#define BENCH_PRECISION_METHODS_H

#include "../bench_reference/ode.h"
#include "../bench_reference/ode_forces.h"
#include "../bench_reference/reference_solution.h"
#include "precision_scenes.h"

enum { MAX_PRECISION_METHODS = 64, MAX_SWEEP_POINTS = 24 };

typedef struct precision_method {
  char name[32];
  const char *integrator; /* of msim; NULL: a method of the other library */
  int ode;                /* its number there, see ode.h */
  int by_tol;
  int32_t collision, precision;
  double first, ratio; /* first setting (h in s, or tol); ratio of successive settings */
} precision_method;

typedef struct precision_methods {
  int count;
  precision_method all[MAX_PRECISION_METHODS];
} precision_methods;

/* Collects the methods that suit the scene. split_by: SPLIT_* if its forces are split, else 0; ode:
 * may be NULL. */
void precision_methods_collect(const reference_solution *t, int split_by, const ode_methods *ode,
                               precision_methods *list);

/* Returns NULL if there is none. */
#define AUTO_BY_TOL "auto, tol"
const precision_method *precision_methods_find(const precision_methods *list, const char *name);

/* One run with one setting. Returns 0 on failure and sets e->reason. */
typedef struct run_context {
  const precision_scene *kind;
  const reference_solution *reference;
  const ode_forces *kernel; /* forces for the other library */
  const ode_forces *parts;  /* the same, split, if split.by is set */
  const ode_methods *ode;   /* may be NULL */
  int32_t threads;
} run_context;

int precision_method_run(const run_context *a, const precision_method *m, double setting,
                         double until, run_result *e);

#endif
