#include "work_precision.h"

#include <math.h>
#include <string.h>

const double levels[ERROR_LEVELS] = {1e-2, 1e-4, 1e-6, 1e-8, 1e-10};

/* The cost of a run, and its error as far as it is measurable. */
typedef struct cost_point {
  double error;
  cost cost;
} cost_point;

static cost_point point_of(const setting_sweep *c, int i) {
  const sweep_point *r = &c->points[i];
  const double error = fmax(r->errors.error, 10 * c->context.reference->error);
  return (cost_point){.error = r->status == POINT_FAILED ? INFINITY : error,
                      .cost = {median_of(&c->all[i], whole_seconds), (double)r->evaluations, i, i}};
}

static double interpolate_log(double a, double b, double share) { return a * pow(b / a, share); }

/* The cost at an error between those of two settings. */
static cost interpolate_cost(const cost_point *above, const cost_point *below, double error) {
  const double share = log(above->error / error) / log(above->error / below->error);
  return (cost){interpolate_log(above->cost.seconds, below->cost.seconds, share),
                interpolate_log(above->cost.evaluations, below->cost.evaluations, share),
                above->cost.first, below->cost.last};
}

cost cost_at_error(const setting_sweep *c, const precision_method *m, double error) {
  cost best = {.seconds = NAN, .evaluations = NAN, .last = -1};
  cost_point before = {.error = INFINITY};
  if (!reference_solution_supports(c->context.reference, error)) return best;
  for (int i = 0; i < c->count; i++) {
    if (c->points[i].method != m) continue;
    const cost_point here = point_of(c, i);
    if (here.error <= error) {
      const int bracketed = before.error > error && isfinite(before.error);
      const cost found = bracketed ? interpolate_cost(&before, &here, error) : here.cost;
      if (!(best.seconds <= found.seconds)) best = found;
    }
    before = here;
  }
  return best;
}

method_group group_of_method(const precision_method *m) {
  if (!m->integrator) return LIBRARY;
  return m->precision == MSIM_PRECISION_SINGLE ? SINGLE : DOUBLE;
}

static int is_auto(const precision_method *m) {
  return m->integrator && strcmp(m->integrator, "auto") == 0;
}

static int is_in_group(const precision_method *m, method_group group) {
  return group_of_method(m) == group && !is_auto(m);
}

const precision_method *fastest_method(const setting_sweep *c, method_group group, double error) {
  const precision_method *best = NULL;
  double least = INFINITY;
  for (const precision_method *m = c->methods.all; m < c->methods.all + c->methods.count; m++) {
    const double seconds = is_in_group(m, group) ? cost_at_error(c, m, error).seconds : NAN;
    if (seconds < least) best = m, least = seconds;
  }
  return best;
}

int is_near_best(const setting_sweep *c, const precision_method *m, double error) {
  const double NEAR = 1.5;
  const precision_method *best = fastest_method(c, group_of_method(m), error);
  return best && cost_at_error(c, m, error).seconds <= NEAR * cost_at_error(c, best, error).seconds;
}

void unsettle_deciding_runs(setting_sweep *c, double error) {
  for (const precision_method *m = c->methods.all; m < c->methods.all + c->methods.count; m++) {
    const cost of = cost_at_error(c, m, error);
    const int counts = is_auto(m) || is_near_best(c, m, error);
    for (int i = of.first; i <= of.last && counts; i++) c->all[i].settled = 0;
  }
}
