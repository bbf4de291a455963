/* setting_sweep - runs every method of `precision` over its settings, from large to small errors,
 * as far as its share of the time allows; then repeats runs in turn while time remains */
#ifndef BENCH_SETTING_SWEEP_H
#define BENCH_SETTING_SWEEP_H

#include "precision_methods.h"
#include "timing.h"

/* POINT_UNRESOLVED: the error is too close to that of the reference solution to be measured. */
enum { POINT_MEASURED, POINT_UNRESOLVED, POINT_FAILED };

typedef struct sweep_point {
  const precision_method *method;
  const run_context *context;
  double setting;
  int status;
  solution_errors errors;
  int64_t evaluations;
  double until; /* on the clock of clock_seconds: when a run is aborted */
  run_result *result;
} sweep_point;

typedef struct setting_sweep {
  run_context context;
  precision_methods methods;
  int count;
  sweep_point *points;   /* grouped by method, in the order of the settings */
  timing_candidate *all; /* timed runs: all[i] belongs to points[i] */
  run_result result;
} setting_sweep;

/* until: on the clock of clock_seconds. All runs are settled then. Returns 0 if out of memory. Call
 * setting_sweep_free in any case. */
int setting_sweep_run(const run_context *a, double until, setting_sweep *c);

/* Repeats the runs that are not settled. seconds: s, for all of them */
void setting_sweep_repeat(setting_sweep *c, double seconds, double until);
void setting_sweep_free(setting_sweep *c);

#endif
