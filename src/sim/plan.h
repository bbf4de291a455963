/* plan - length and number of steps and number of threads, decided once, from scene, options and
 * initial state only (never from timings, so that runs are reproducible) */
#ifndef MS_PLAN_H
#define MS_PLAN_H

#include "scene/options.h"

/* 2^52: numbers of steps up to here are exact as doubles. */
#define MS_PLAN_MAX_STEPS 4503599627370496.0

typedef struct ms_plan {
  double h;       /* s: the step; under error control the next one to try */
  int64_t steps;  /* -1: no end was given, or error control determines the number */
  double h_asked; /* s: h of the options */
  double t0;
  double t_end; /* s; -1: no end was given */
} ms_plan;

/* The length of the run, s; 1 s if it has no end. */
double ms_plan_span(const ms_plan *plan);

/* The number of threads for so many entries of half-edges: options.threads, or else as many as are
 * cost-effective, at most one per core. */
int32_t ms_plan_count_threads(const msim_options *opt, int64_t slots);

/* Plan the steps from t0 to the end. options.steps: that many. options.t_end: (t_end - t0)/h steps,
 * if that is a whole number to a relative 1e-9, else h is lowered to make it one. MSIM_ERR_ARG:
 * t_end is before t0, or there are too many steps or frames. */
msim_status ms_plan_create(const msim_options *opt, double t0, ms_plan *plan, msim_error *err);

#endif
