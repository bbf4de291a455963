#include "step_report.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "linear_report.h"

/*------------------------------------- rows -----------------------------------------------------*/

static json_t *add_comparison_row(report *out, const step_comparison *r, const char *measure) {
  return add_step_row(out, measure, r->step.moving, r->step.h);
}

static void put_times(json_t *row, const timing_candidate *c, sample_value *value) {
  put_real(row, "ms", 1e3 * median_of(c, value));
  put_real(row, "spread", spread_of(c, value));
  put_integer(row, "repeats", c->nsamples > 1 ? c->nsamples - 1 : 1);
}

static void report_solution(report *out, const step_comparison *r) {
  json_t *row = add_comparison_row(out, r, "solution");
  put_text(row, "status", "ok");
  put_text(row, "solver", r->step.solver);
  put_integer(row, "iterations", r->step.iterations);
  put_real(row, "residual", r->step.residual);
}

static void report_factorization(report *out, const step_comparison *r) {
  json_t *row = add_comparison_row(out, r, "factor");
  put_text(row, "method", "cholmod, bare");
  put_text(row, "status", r->factor ? "ok" : "left out");
  if (r->factor) put_times(row, r->factor, factor_seconds);
  else put_text(row, "reason", r->no_factor.text);
}

/* "cloth64, L-BFGS" */
static void put_curve(json_t *row, const step_comparison *r, const accuracy_record *p) {
  char curve[80];
  snprintf(curve, sizeof curve, "%s, %s", r->step.moving->kind->name, p->name);
  put_text(row, "curve", curve);
}

static void report_arrival(report *out, const step_comparison *r, int method, int accuracy) {
  static const char *const ends[] = {[END_CUT_OFF] = "cut off",
                                     [END_OTHER_MINIMUM] = "other minimum",
                                     [END_FAILED] = "failed",
                                     [END_SKIPPED] = "left out"};
  const accuracy_record *p = r->records[method];
  const timing_candidate *c = r->reached[method][accuracy];
  const iterate_record *at = &p->reached[accuracy];
  json_t *row = add_comparison_row(out, r, "step");
  put_text(row, "method", p->name);
  put_curve(row, r, p);
  put_real(row, "accuracy", accuracies[accuracy]);
  put_text(row, "status", c ? "ok" : ends[p->end]);
  if (!c) {
    put_text(row, "reason", p->reason);
    if (p->end == END_CUT_OFF) put_real(row, "at_least_ms", 1e3 * p->seconds_unreached);
    return;
  }
  put_times(row, c, whole_seconds);
  put_integer(row, "iterations", at->iterations);
  put_real(row, "error", at->error);
  if (method <= BY_CHOLMOD) put_real(row, "newton_rtol", newton_sweep_rtol(at->rung));
}

/*------------------------------------- table ----------------------------------------------------*/

static void print_columns_of_accuracies(void) {
  printf(" %-21s", "milliseconds to");
  for (int a = 0; a < ACCURACIES; a++) printf(" %8.0e %4s", accuracies[a], "+-");
  putchar('\n');
}

static void print_median_time(const timing_candidate *c, sample_value *value) {
  const double spread = spread_of(c, value);
  printf(" %8.4g", 1e3 * median_of(c, value));
  if (isfinite(spread)) printf(" %3.0f%%", 100 * spread);
  else printf(" %4s", "-");
}

static void print_step_method(const step_comparison *r, int method) {
  const accuracy_record *p = r->records[method];
  printf(" %-21s", p->name);
  for (int a = 0; a < ACCURACIES; a++) {
    const timing_candidate *c = r->reached[method][a];
    if (c) print_median_time(c, whole_seconds);
    else printf(" %8s %4s", "-", "");
  }
  putchar('\n');
  if (p->end != END_REACHED) printf("   %s\n", p->reason);
}

void report_step_comparison(report *out, const step_comparison *r) {
  printf(" solution by %s in %" PRId64 " iterations, its residual %.1e of that at v' = v\n",
         r->step.solver, r->step.iterations, r->step.residual);
  print_columns_of_accuracies();
  report_solution(out, r);
  for (int method = 0; method < METHODS; method++) {
    print_step_method(r, method);
    for (int a = 0; a < ACCURACIES; a++) report_arrival(out, r, method, a);
  }
  report_factorization(out, r);
  printf(" %-21s", "one factorisation");
  if (r->factor) print_median_time(r->factor, factor_seconds);
  else printf("   %s", r->no_factor.text);
  putchar('\n');
  fflush(stdout);
}

void report_unsolved(report *out, const moving_scene *m, double h, const char *why) {
  json_t *row = add_step_row(out, "solution", m, h);
  put_text(row, "status", "failed");
  put_text(row, "reason", why);
  printf(" %s\n", why);
  fflush(stdout);
}

void report_step_ratio(report *out, const step_comparison *r, const char *name, int accuracy,
                       step_ratio ratio) {
  json_t *row = add_comparison_row(out, r, "ratio");
  const accuracy_record *without = isfinite(ratio.value) ? ratio.bound : r->records[BY_PCG];
  put_text(row, "name", name);
  put_real(row, "accuracy", accuracies[accuracy]);
  put_real(row, "ratio", ratio.value);
  json_object_set_new(row, "is_upper_bound", json_boolean(ratio.bound != NULL));
  if (isfinite(ratio.value)) printf(" %s to %.0e: %.3g", name, accuracies[accuracy], ratio.value);
  else printf(" %s to %.0e: no result", name, accuracies[accuracy]);
  if (without) {
    char reason[sizeof without->reason + 64];
    snprintf(reason, sizeof reason, "%s: %s", without->name, without->reason);
    put_text(row, "reason", reason);
    printf("%s; %s", ratio.bound ? " at most" : "", reason);
  }
  putchar('\n');
}
