/* linear - what the parts of the bench `linear` share */
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

/* Enter the whole step of all solvers that are not left out, and beside those that factorise the
 * backend alone; what is left out is reported as a row of this measure. `auto`
 * for the measure "step" only. */
void enter_solvers(const linear_bench *b, race *r, const thrift *t, const char *measure);

/* One step to solver.rtol 1e-12 by all solvers: the largest difference of two velocities in m/s;
 * NAN: fewer than two did it, or some had no time to. */
double compare_solvers(const linear_bench *b, const moving *m, double h, const thrift *t);

/* How much slower a step by `auto` and by CHOLMOD is while the other cores are busy, and CHOLMOD
 * out of the box: rows, and the keys of the former two. */
void measure_busy(linear_bench *b, const moving *m, double h, const patience *p);

/* These keys, without a result. */
void announce_slowdown(report *out, const bench_scene *scene);

/* The keys that compare `auto` with CHOLMOD, and matrices with forces. seconds: for each scene to
 * fall. */
void measure_duels(linear_bench *b, double seconds, const patience *p);

#endif
