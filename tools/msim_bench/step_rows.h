/* step_rows - prints the results of a nonlinear step comparison and writes them to the report */
#ifndef BENCH_STEP_ROWS_H
#define BENCH_STEP_ROWS_H

#include "report.h"
#include "step_race.h"

void report_step_race(report *out, const step_race *r);

/* Writes a row for a step without a converged solution. */
void report_unsolved(report *out, const moving *m, double h, const char *why);

/* Ratio of the times of two methods to an accuracy. */
typedef struct step_ratio {
  double value;         /* NAN: not measured; INFINITY: msim's Newton method failed */
  const pursuit *bound; /* other method, which failed: `value` is an upper bound; NULL: exact */
} step_ratio;

void report_step_ratio(report *out, const step_race *r, const char *name, int accuracy,
                       step_ratio ratio);

#endif
