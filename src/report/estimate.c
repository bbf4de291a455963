/* estimate - the cost of the rest of a run, by the first steps of a clone (msim_sim_estimate) */
#include <math.h>

#include "base/sized.h"
#include "choose/pilot_run.h"
#include "sim/sim.h"
#include "sim/rank_sim.h"

/* The steps tried: the first ones differ from the later ones by the start of the method, and under
 * error control by the search for the length of a step. */
typedef struct trial {
  int64_t first, later;
} trial;

/* Work of a sim up to a state */
typedef struct work_done {
  double t, steps, evaluations, solves, iterations, factorizations, total;
} work_done;

static work_done get_work(const msim_sim *sim) {
  const msim_stats *s = &sim->stats;
  return (work_done){.t = ms_sim_has_control(sim) ? sim->run.t : ms_sim_time(sim),
                     .steps = (double)s->steps,
                     .evaluations = (double)s->force_evaluations,
                     .solves = (double)s->solves,
                     .iterations = (double)s->iterations,
                     .factorizations = (double)s->factorizations,
                     .total = ms_pilot_run_count_work(sim)};
}

static double end_time(const msim_sim *sim, double now) {
  const double t_end = sim->config.plan.t_end;
  return t_end >= 0 ? t_end : now + 1;
}

static msim_status make_trial_steps(msim_sim *sim, double end, int64_t n, msim_error *err) {
  msim_status status = MSIM_OK;
  for (int64_t i = 0; i < n && !status; i++) {
    const work_done done = get_work(sim);
    const double rounding = 1e-9 * sim->run.h;
    if (done.t >= end - rounding) break;
    status = ms_sim_make_steps(sim, 1, err);
  }
  return status;
}

/* What was done up to b, and from there on what was done from a to b for each step. */
static double continue_count(double start, double a, double b, double steps, double left) {
  return b - start + (steps > 0 ? left * (b - a) / steps : 0);
}

static msim_estimate extrapolate(const work_done *start, const work_done *a, const work_done *b,
                                 double h, double end) {
  const double made = b->steps - a->steps;
  const double mean = made > 0 && b->t > a->t ? (b->t - a->t) / made : h;
  const double left = fmax(0, round((end - b->t) / mean));
  return (msim_estimate){
      .tried = (int64_t)(b->steps - start->steps),
      .steps = b->steps - start->steps + left,
      .force_evaluations =
          continue_count(start->evaluations, a->evaluations, b->evaluations, made, left),
      .solves = continue_count(start->solves, a->solves, b->solves, made, left),
      .iterations = continue_count(start->iterations, a->iterations, b->iterations, made, left),
      .factorizations =
          continue_count(start->factorizations, a->factorizations, b->factorizations, made, left),
      .work = continue_count(start->total, a->total, b->total, made, left)};
}

static msim_status estimate_by_clone(msim_sim *clone, msim_estimate *found, msim_error *err) {
  const trial n = ms_sim_has_control(clone) ? (trial){8, 16} : (trial){1, 3};
  const work_done start = get_work(clone);
  const double end = end_time(clone, start.t);
  msim_status status = make_trial_steps(clone, end, n.first, err);
  const work_done a = get_work(clone);
  if (!status) status = make_trial_steps(clone, end, n.later, err);
  const work_done b = get_work(clone);
  *found = extrapolate(&start, &a, &b, clone->run.h, end);
  return status;
}

msim_status msim_sim_estimate(msim_sim *sim, msim_estimate *estimate, msim_error *err) {
  if (!sim || !estimate) return ms_error_set(err, MSIM_ERR_ARG, "sim or estimate is NULL");
  const msim_status refused = ms_rank_sim_refuse(sim, "msim_sim_estimate", err);
  if (refused) return refused;
  msim_sim *clone;
  msim_estimate found = {0};
  msim_status status = msim_sim_clone(sim, &clone, err);
  if (status) return status;
  msim_sim_set_warn(clone, NULL, NULL);
  status = estimate_by_clone(clone, &found, err);
  msim_sim_destroy(clone);
  if (status) return status;
  return ms_sized_write(estimate, &found, sizeof found) == MSIM_OK
             ? ms_error_clear(err)
             : ms_error_set(err, MSIM_ERR_SIZE,
                            "estimate.size is 0; it must be sizeof(msim_estimate)");
}
