/* plan - what is decided once, from scene, options and initial state, never from a clock */
#ifndef MS_PLAN_H
#define MS_PLAN_H

#include "scene/scene.h"

typedef struct ms_plan {
  double h;       /* the step actually made */
  int64_t steps;  /* -1: no end was given */
  double h_asked; /* what the options said */
} ms_plan;

/* How many threads for so many slots of half springs: as many as asked for, or as many as pay, one
 * for each core at most. */
int32_t ms_plan_threads(const msim_options *opt, int64_t slots);

/* The steps from t0 to the end. options.steps: that many. options.t_end: (t_end - t0)/h of them,
 * if that is a whole number to a relative 1e-9, else h is lowered to make it one. */
msim_status ms_plan_create(const msim_options *opt, double t0, ms_plan *plan, msim_error *err);

/* Steps are counted from the start of the run. The next one after `step` at which a frame is due:
 * the first at or after the frame's time; at the latest the end of the run. */
int64_t ms_plan_next_frame(const ms_plan *plan, const msim_options *opt, int64_t step);

/* A trajectory has no more frames than this. */
#define MS_MOST_FRAMES 10000000

/* All frames of a run, the first state and the last included; `most` at most. */
int64_t ms_plan_count_frames(const ms_plan *plan, const msim_options *opt, int64_t most);

#endif
