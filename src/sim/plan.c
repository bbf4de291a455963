#include "sim/plan.h"

#include <math.h>

#include "base/pool.h"
#include "sim/frames.h"

msim_status ms_plan_create(const msim_options *opt, double t0, ms_plan *plan, msim_error *err) {
  const double span = opt->t_end - t0;
  *plan = (ms_plan){.h = opt->h, .h_asked = opt->h, .steps = -1, .t0 = t0, .t_end = -1};
  if ((double)opt->steps > MS_PLAN_MAX_STEPS)
    return ms_error_set(err, MSIM_ERR_ARG, "steps = %lld exceeds the limit %g",
                        (long long)opt->steps, MS_PLAN_MAX_STEPS);
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
    if (ms_options_have_frame_times(opt) && span * opt->fps > MS_FRAMES_MAX)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "fps = %g requires %g frames, and the limit is %d; use a lower fps",
                          opt->fps, span * opt->fps, MS_FRAMES_MAX);
    if (opt->tol > 0) return MSIM_OK;
    if (ratio > MS_PLAN_MAX_STEPS)
      return ms_error_set(
          err, MSIM_ERR_ARG,
          "t_end / h = %g steps exceeds the limit %g; use a larger h or an earlier t_end", ratio,
          MS_PLAN_MAX_STEPS);
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
