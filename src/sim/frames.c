#include "sim/frames.h"

#include <math.h>

/* Steps per frame; 0: frames follow fps. Default: about 200 frames in the run. */
static int64_t frame_steps(const ms_plan *plan, const msim_options *opt) {
  if (opt->every > 0) return opt->every;
  if (opt->fps > 0) return 0;
  return plan->steps > 200 ? (plan->steps + 199) / 200 : 1;
}

/* The first step s with s h >= k / fps, with a tolerance for rounding. */
static int64_t step_of_frame(double steps_per_frame, double k) {
  double at = k * steps_per_frame;
  return at < MS_PLAN_MAX_STEPS ? (int64_t)ceil(at - 1e-9 * fmax(1, at))
                                : (int64_t)MS_PLAN_MAX_STEPS;
}

int64_t ms_frames_next_step(const ms_plan *plan, const msim_options *opt, int64_t step) {
  int64_t every = frame_steps(plan, opt), next;
  if (every) {
    next = every > INT64_MAX - step ? INT64_MAX : (step / every + 1) * every;
  } else {
    double steps_per_frame = 1 / (opt->fps * plan->h);
    double k = floor((double)step / steps_per_frame);
    next = step + 1; /* each step is a frame where frames are as frequent as steps */
    if (steps_per_frame > 1) do
        next = step_of_frame(steps_per_frame, k++);
      while (next <= step);
  }
  return plan->steps > step && next > plan->steps ? plan->steps : next;
}

/* s; long enough for the times of successive frames to differ, and no longer than the run: where
 * fps asks for longer ones, the frames are its start and its end in any case. */
static double frame_interval(const ms_plan *plan, const msim_options *opt) {
  const double span = ms_plan_span(plan), latest = fmax(fabs(plan->t0), fabs(plan->t_end));
  const double interval = opt->fps > 0 ? fmin(1 / opt->fps, span) : span / 200;
  return fmax(interval, 0x1p-50 * fmax(span, latest));
}

double ms_frames_time(const ms_plan *plan, const msim_options *opt, int64_t k) {
  const double interval = frame_interval(plan, opt), t = plan->t0 + (double)k * interval;
  return plan->t_end >= 0 && t > plan->t_end - 1e-9 * interval ? plan->t_end : t;
}

int64_t ms_frames_after(const ms_plan *plan, const msim_options *opt, double t) {
  const double k = fmax(0, floor((t - plan->t0) / frame_interval(plan, opt)));
  if (!(k < MS_PLAN_MAX_STEPS))
    return (int64_t)MS_PLAN_MAX_STEPS; /* larger numbers are not exact as doubles */
  for (int64_t frame = (int64_t)k;; frame++) {
    const double at = ms_frames_time(plan, opt, frame);
    if (at > t) return frame;
    if (at == plan->t_end) return frame + 1;
  }
}

/* The number of frames that have times of their own */
static int64_t count_timed_frames(const ms_plan *plan, const msim_options *opt, int64_t most) {
  const double count = ceil(ms_plan_span(plan) / frame_interval(plan, opt) - 1e-9) + 1;
  return count < (double)most ? (int64_t)count : most;
}

int64_t ms_frames_count(const ms_plan *plan, const msim_options *opt, int64_t most) {
  int64_t frames = 1;
  if (ms_options_have_frame_times(opt))
    return plan->t_end > plan->t0 ? count_timed_frames(plan, opt, most) : 1;
  if (opt->tol > 0) return -1;
  for (int64_t step = 0; step < plan->steps && frames < most; frames++)
    step = ms_frames_next_step(plan, opt, step);
  return frames;
}
