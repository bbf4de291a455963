#include "sim/plan.h"

#include <math.h>

#include "base/pool.h"

/* 2^52: numbers of steps up to here are exact as doubles. */
#define MOST_STEPS 4503599627370496.0

msim_status ms_plan_create(const msim_options *opt, double t0, ms_plan *plan, msim_error *err) {
  const double span = opt->t_end - t0;
  *plan = (ms_plan){.h = opt->h, .h_asked = opt->h, .steps = -1, .t0 = t0, .t_end = -1};
  if ((double)opt->steps > MOST_STEPS)
    return ms_error_set(err, MSIM_ERR_ARG, "steps = %lld exceeds the limit %g",
                        (long long)opt->steps, MOST_STEPS);
  if (opt->steps >= 0) {
    plan->steps = opt->steps;
  } else if (opt->t_end >= 0) {
    double ratio = span / opt->h;
    if (!(span >= 0))
      return ms_error_set(
          err, MSIM_ERR_ARG,
          "t_end = %g s lies before the time of the state, t = %g s; use a later t_end", opt->t_end,
          t0);
    plan->t_end = opt->t_end;
    if (ms_plan_has_times(opt) && span * opt->fps > MS_MAX_FRAMES)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "fps = %g requires %g frames, and the limit is %d; use a lower fps",
                          opt->fps, span * opt->fps, MS_MAX_FRAMES);
    if (opt->tol > 0) return MSIM_OK;
    if (ratio > MOST_STEPS)
      return ms_error_set(
          err, MSIM_ERR_ARG,
          "t_end / h = %g steps exceeds the limit %g; use a larger h or an earlier t_end", ratio,
          MOST_STEPS);
    double nearest = round(ratio);
    int whole = fabs(ratio - nearest) <= 1e-9 * ratio;
    plan->steps = (int64_t)(whole ? nearest : ceil(ratio));
    if (!whole) plan->h = span / (double)plan->steps;
  }
  if (plan->steps >= 0) plan->t_end = t0 + (double)plan->steps * plan->h;
  if (isfinite(plan->t_end)) return MSIM_OK;
  return ms_error_set(
      err, MSIM_ERR_ARG,
      "%lld steps of %g s: the end time is not a finite number; use fewer steps or a smaller h",
      (long long)plan->steps, plan->h);
}

double ms_plan_span(const ms_plan *plan) {
  const double span = plan->t_end - plan->t0;
  return plan->t_end >= 0 && span > 0 ? span : 1;
}

/* The least number of half-edge entries per thread, some 15 us of work: with fewer, one more thread
 * saves less than it costs to wake it and to wait for it. */
enum { LEAST_ENTRIES = 1500 };

int32_t ms_plan_count_threads(const msim_options *opt, int64_t slots) {
  if (opt->threads > 0) return opt->threads < MS_MAX_THREADS ? opt->threads : MS_MAX_THREADS;
  const int64_t worthwhile = slots / LEAST_ENTRIES;
  const int32_t cores = ms_pool_usable_cores();
  const int32_t threads = worthwhile < cores ? (int32_t)worthwhile : cores;
  return threads > 1 ? threads : 1;
}

/* Steps per frame; 0: frames follow fps. Default: about 200 frames in the run. */
static int64_t frame_steps(const ms_plan *plan, const msim_options *opt) {
  if (opt->every > 0) return opt->every;
  if (opt->fps > 0) return 0;
  return plan->steps > 200 ? (plan->steps + 199) / 200 : 1;
}

/* The first step s with s h >= k / fps, with a tolerance for rounding. */
static int64_t step_of_frame(double steps_per_frame, double k) {
  double at = k * steps_per_frame;
  return at < MOST_STEPS ? (int64_t)ceil(at - 1e-9 * fmax(1, at)) : (int64_t)MOST_STEPS;
}

int64_t ms_plan_next_frame(const ms_plan *plan, const msim_options *opt, int64_t step) {
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

int ms_plan_has_times(const msim_options *opt) { return opt->tol > 0 && opt->every <= 0; }

/* s; long enough for the times of successive frames to differ. */
static double frame_interval(const ms_plan *plan, const msim_options *opt) {
  const double span = ms_plan_span(plan), latest = fmax(fabs(plan->t0), fabs(plan->t_end));
  return fmax(opt->fps > 0 ? 1 / opt->fps : span / 200, 0x1p-50 * fmax(span, latest));
}

double ms_plan_frame_time(const ms_plan *plan, const msim_options *opt, int64_t k) {
  const double interval = frame_interval(plan, opt), t = plan->t0 + (double)k * interval;
  return plan->t_end >= 0 && t > plan->t_end - 1e-9 * interval ? plan->t_end : t;
}

int64_t ms_plan_frame_after(const ms_plan *plan, const msim_options *opt, double t) {
  const double k = fmax(0, floor((t - plan->t0) / frame_interval(plan, opt)));
  if (!(k < MOST_STEPS)) return (int64_t)MOST_STEPS; /* larger numbers are not exact as doubles */
  for (int64_t frame = (int64_t)k;; frame++) {
    const double at = ms_plan_frame_time(plan, opt, frame);
    if (at > t) return frame;
    if (at == plan->t_end) return frame + 1;
  }
}

/* The number of frames that have times of their own */
static int64_t count_timed_frames(const ms_plan *plan, const msim_options *opt, int64_t most) {
  const double count = ceil(ms_plan_span(plan) / frame_interval(plan, opt) - 1e-9) + 1;
  return count < (double)most ? (int64_t)count : most;
}

int64_t ms_plan_count_frames(const ms_plan *plan, const msim_options *opt, int64_t most) {
  int64_t frames = 1;
  if (ms_plan_has_times(opt))
    return plan->t_end > plan->t0 ? count_timed_frames(plan, opt, most) : 1;
  if (opt->tol > 0) return -1;
  for (int64_t step = 0; step < plan->steps && frames < most; frames++)
    step = ms_plan_next_frame(plan, opt, step);
  return frames;
}
