/* frames - when the frames of a run are due: the states that observers and recorders receive */
#ifndef MS_FRAMES_H
#define MS_FRAMES_H

#include "sim/plan.h"

/* The step at which the first frame after `step` is due, at the latest the end of the run: the
 * first step at or after the frame's time. Steps are counted from the start of the run. */
int64_t ms_frames_next_step(const ms_plan *plan, const msim_options *opt, int64_t step);

/* The time of frame k if frames have times of their own, s; t_end at the latest. */
double ms_frames_time(const ms_plan *plan, const msim_options *opt, int64_t k);

/* The first such frame after t; behind the frame of t_end, the number of one that is never due. */
int64_t ms_frames_after(const ms_plan *plan, const msim_options *opt, double t);

#define MS_FRAMES_MAX 10000000

/* The number of frames of a run, with the first and the last state; at most `most`. -1: unknown,
 * under error control with `every`. */
int64_t ms_frames_count(const ms_plan *plan, const msim_options *opt, int64_t most);

#endif
