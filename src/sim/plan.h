/* plan - length and number of steps, times of frames and number of threads, decided once, from
 * scene, options and initial state only (never from timings, so that runs are reproducible) */
#ifndef MS_PLAN_H
#define MS_PLAN_H

#include "scene/options.h"

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

/* The step at which the first frame after `step` is due, at the latest the end of the run: the
 * first step at or after the frame's time. Steps are counted from the start of the run. */
int64_t ms_plan_next_frame(const ms_plan *plan, const msim_options *opt, int64_t step);

/* 1: frames have times of their own, between steps: with error control and without `every`. */
int ms_plan_has_times(const msim_options *opt);

/* The time of frame k if frames have times of their own, s; t_end at the latest. */
double ms_plan_frame_time(const ms_plan *plan, const msim_options *opt, int64_t k);

/* The first such frame after t; behind the frame of t_end, the number of one that is never due. */
int64_t ms_plan_frame_after(const ms_plan *plan, const msim_options *opt, double t);

#define MS_MAX_FRAMES 10000000

/* The number of frames of a run, with the first and the last state; at most `most`. -1: unknown,
 * under error control with `every`. */
int64_t ms_plan_count_frames(const ms_plan *plan, const msim_options *opt, int64_t most);

#endif
