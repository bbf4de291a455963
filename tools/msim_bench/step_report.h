/* step_report - prints the results of a nonlinear step comparison and writes them to the report */
#ifndef BENCH_STEP_REPORT_H
#define BENCH_STEP_REPORT_H

#include "step_comparison.h"

void report_step_comparison(report *out, const step_comparison *r);

/* Ratio of the times of two methods to an accuracy. */
typedef struct step_ratio {
  double value;                 /* NAN: not measured; INFINITY: msim's Newton method failed */
  const accuracy_record *bound; /* of the other method, which failed, so that `value` is an upper
                                   bound; NULL: exact */
} step_ratio;

void report_step_ratio(report *out, const step_comparison *r, const char *name, int accuracy,
                       step_ratio ratio);

#endif
