/* step_rows - what a race over a nonlinear step found, as a table and as rows of the report */
#ifndef BENCH_STEP_ROWS_H
#define BENCH_STEP_ROWS_H

#include "report.h"
#include "step_race.h"

void report_step_race(report *out, const step_race *r);

/* A step of which no solution is known. */
void report_unsolved(report *out, const moving *m, double h, const char *why);

/* Of two times to an accuracy. */
typedef struct step_ratio {
  double value;         /* NAN: not measured; INFINITY: msim's Newton method has no result */
  const pursuit *bound; /* the other, which has no result: it is this at most; NULL: exact */
} step_ratio;

void report_step_ratio(report *out, const step_race *r, const char *name, int accuracy,
                       step_ratio ratio);

#endif
