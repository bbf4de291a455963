/* linear - declarations shared by the parts of the benchmark `linear` */
#ifndef BENCH_LINEAR_H
#define BENCH_LINEAR_H

#include "benches.h"
#include "race.h"
#include "rules.h"
#include "spinner.h"

typedef struct linear_bench {
  const bench_wishes *wishes;
  report *report;
  const struct linear_plan *plan;
  double until; /* on wall_seconds' clock */
  int nsolvers;
  struct bench_solver {
    char name[32];
    const msim_backend *table; /* NULL: built in */
  } solvers[MOST_STEPS];
  reference cholmod, sundials;
  spinner spinner;
} linear_bench;

/* Adds the steps of all solvers that are affordable; the others become rows of this measure. `auto`
 * and the direct backends alone are added for the measure "step" only. */
void enter_solvers(const linear_bench *b, race *r, const thrift *t, const char *measure);

/* One step to solver.rtol 1e-12 by all solvers: returns the largest difference of a velocity in
 * m/s; NAN: fewer than two succeeded, or the time was up. */
double compare_solvers(const linear_bench *b, const moving *m, double h, const thrift *t);

/* Slowdown of a step by `auto`, by CHOLMOD and by CHOLMOD with default settings while the other
 * cores are busy: rows, and keys of the first two. */
void measure_busy(linear_bench *b, const moving *m, double h, const patience *p);

/* Sets these keys to "no result". */
void announce_slowdown(report *out, const bench_scene *scene);

/* Paired timings: the keys that compare `auto` with CHOLMOD, and assembly with forces. seconds:
 * limit for advancing each scene. */
void measure_duels(linear_bench *b, double seconds, const patience *p);

#endif
