/* plan - what is decided once, from scene, options and initial state, never from a clock */
#ifndef MS_PLAN_H
#define MS_PLAN_H

#include "scene/options.h"

typedef struct ms_plan {
  double h;       /* the step actually made; under error control the next one to try */
  int64_t steps;  /* -1: no end was given, or error control will find their number */
  double h_asked; /* what the options said */
  double t0;
  double t_end; /* -1: no end was given */
} ms_plan;

/* The length of the run, s; 1 s where it has no end. */
double ms_plan_span(const ms_plan *plan);

/* How many threads for so many slots of half springs: as many as asked for, or as many as pay, one
 * for each core at most. */
int32_t ms_plan_threads(const msim_options *opt, int64_t slots);

/* The steps from t0 to the end. options.steps: that many. options.t_end: (t_end - t0)/h of them,
 * if that is a whole number to a relative 1e-9, else h is lowered to make it one. */
msim_status ms_plan_create(const msim_options *opt, double t0, ms_plan *plan, msim_error *err);

/* Steps are counted from the start of the run. The next one after `step` at which a frame is due:
 * the first at or after the frame's time; at the latest the end of the run. */
int64_t ms_plan_next_frame(const ms_plan *plan, const msim_options *opt, int64_t step);

/* Under error control frames may be at times of their own, from `fps` or by default. */
int ms_plan_has_times(const msim_options *opt);

/* The time of frame k of those, t_end at the latest. */
double ms_plan_frame_time(const ms_plan *plan, const msim_options *opt, int64_t k);

/* The first of them after t; after that of t_end, one that is never due. */
int64_t ms_plan_frame_after(const ms_plan *plan, const msim_options *opt, double t);

/* A trajectory has no more frames than this. */
#define MS_MOST_FRAMES 10000000

/* All frames of a run, the first state and the last included; `most` at most. -1: nobody knows,
 * under error control with `every`. */
int64_t ms_plan_count_frames(const ms_plan *plan, const msim_options *opt, int64_t most);

#endif
