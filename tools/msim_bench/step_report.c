#include "step_report.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

static const column times[] = {{"", "ms", 8, "%.4g", 0}, {"+-", "spread", 4, "%.0f%%", 100}};

static void print_times(const json_t *row) {
  for (int i = 0; i < 2; i++) print_value(&times[i], row);
}

static void report_factorization(report *out, const step_comparison *r) {
  json_t *row = add_step_row(out, "factor", r->step.moving, r->step.h,
                             FIELDS(TEXT("method", "cholmod, bare")));
  printf(" %-21s", "one factorisation");
  if (r->factor) {
    put_result(row, r->factor, factor_seconds, "ms", 1e3);
    print_times(row);
  } else {
    put_fields(row, FIELDS(TEXT("status", "left out"), TEXT("reason", r->no_factor.text)));
    printf("   %s", r->no_factor.text);
  }
  putchar('\n');
}

static void report_accuracy(report *out, const step_comparison *r, int method, int accuracy) {
  static const char *const ends[] = {[END_CUT_OFF] = "cut off",
                                     [END_OTHER_MINIMUM] = "other minimum",
                                     [END_FAILED] = "failed",
                                     [END_SKIPPED] = "left out"};
  const accuracy_record *p = &r->records[method];
  const timing_candidate *c = r->reached[method][accuracy];
  const iterate_record *at = &p->reached[accuracy];
  char curve[80]; /* "cloth64, L-BFGS" */
  snprintf(curve, sizeof curve, "%s, %s", r->step.moving->kind->name, p->name);
  json_t *row = add_step_row(out, "step", r->step.moving, r->step.h,
                             FIELDS(TEXT("method", p->name), TEXT("curve", curve),
                                    REAL("accuracy", accuracies[accuracy])));
  if (c) {
    put_result(row, c, whole_seconds, "ms", 1e3);
    put_fields(row, FIELDS(INTEGER("iterations", at->iterations), REAL("error", at->error),
                           REAL("newton_rtol",
                                method <= BY_CHOLMOD ? newton_sweep_rtol(at->setting) : NAN)));
  } else {
    put_fields(
        row, FIELDS(TEXT("status", ends[p->end]), TEXT("reason", p->reason),
                    REAL("at_least_ms", p->end == END_CUT_OFF ? 1e3 * p->seconds_unreached : NAN)));
  }
  print_times(row);
}

void report_step_comparison(report *out, const step_comparison *r) {
  const nonlinear_step *s = &r->step;
  printf(" converged solution by %s in %" PRId64 " iterations, relative residual %.1e\n", s->solver,
         s->iterations, s->residual);
  add_step_row(out, "solution", s->moving, s->h,
               FIELDS(TEXT("status", "ok"), TEXT("solver", s->solver),
                      INTEGER("iterations", s->iterations), REAL("residual", s->residual)));
  printf(" %-21s", "milliseconds to");
  for (int a = 0; a < ACCURACIES; a++) printf(" %8.0e %4s", accuracies[a], "+-");
  putchar('\n');
  for (int method = 0; method < METHODS; method++) {
    const accuracy_record *p = &r->records[method];
    printf(" %-21s", p->name);
    for (int a = 0; a < ACCURACIES; a++) report_accuracy(out, r, method, a);
    putchar('\n');
    if (p->end != END_REACHED) printf("   %s\n", p->reason);
  }
  report_factorization(out, r);
}

void report_step_ratio(report *out, const step_comparison *r, const char *name, int accuracy,
                       step_ratio ratio) {
  const int found = isfinite(ratio.value);
  const accuracy_record *without = found ? ratio.bound : &r->records[BY_PCG];
  char reason[sizeof without->reason + 64], value[32] = "no result";
  if (without) snprintf(reason, sizeof reason, "%s: %s", without->name, without->reason);
  if (found) snprintf(value, sizeof value, "%.3g", ratio.value);
  add_step_row(out, "ratio", r->step.moving, r->step.h,
               FIELDS(TEXT("name", name), REAL("accuracy", accuracies[accuracy]),
                      REAL("ratio", ratio.value), BOOLEAN("is_upper_bound", ratio.bound != NULL),
                      TEXT("reason", without ? reason : NULL)));
  printf(" %s to %.0e: %s%s%s%s\n", name, accuracies[accuracy], value,
         ratio.bound ? " at most" : "", without ? "; " : "", without ? reason : "");
}
