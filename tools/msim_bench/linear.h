/* linear - declarations shared by the parts of the benchmark `linear` */
#ifndef BENCH_LINEAR_H
#define BENCH_LINEAR_H

#include "background_load.h"
#include "cost_limits.h"
#include "solver_comparison.h"

typedef struct linear_bench {
  const bench_run *run;
  report *report; /* of the run */
  const struct linear_plan *plan;
  int nsolvers;
  struct bench_solver {
    char name[32];
    const msim_backend *table; /* NULL: built in */
  } solvers[MOST_STEPS];
  reference_program cholmod, sundials;
  background_load load;
  timing_limits pair_limits;
  const int *pair_series; /* consecutive steps of cloths and of jellies in a paired timing */
  /* For soft and for stiff springs: the largest difference of a velocity in m/s, how many were to
   * be measured, how many were. */
  struct disagreement_summary {
    double largest;
    int expected, measured;
  } disagreement[2];
} linear_bench;

/* Adds the steps of all solvers that are affordable; the others become rows of this measure. `auto`
 * and the direct backends alone are added for the measure "step" only. */
void add_solvers(const linear_bench *b, solver_comparison *r, const cost_limits *t,
                 const char *measure);

/* One step to solver.rtol 1e-12 by all solvers: returns the largest difference of a velocity in
 * m/s; NAN: fewer than two succeeded, or the time was up. */
double compare_solvers(const linear_bench *b, const moving_scene *m, double h,
                       const cost_limits *t);

/* Slowdown of a step by `auto`, by CHOLMOD and by CHOLMOD with default settings while the other
 * cores are busy: rows, and keys of the first two. */
void measure_slowdown(linear_bench *b, const moving_scene *m, double h, const timing_limits *p);

/* Paired timings: the keys that compare `auto` with CHOLMOD, and assembly with forces. */
void measure_paired_keys(linear_bench *b);

#endif
