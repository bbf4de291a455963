/* step - benchmark of one nonlinear step of implicit Euler to relative velocity errors of 1e-2,
 * 1e-4 and 1e-6: Newton's method with pcg and CHOLMOD, prefactored methods, and one
 * factorization */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"
#include "step_comparison.h"

static const step_plan plans[] = {
    {.solution = 60,
     .newton = 30,
     .descent = 10,
     .turns = {.budget = 15, .min_rounds = 3, .max_rounds = 30}},
    {.solution = 3,
     .newton = 4,
     .is_quick = 1,
     .descent = 0.5,
     .turns = {.budget = 1.2, .min_rounds = 2, .max_rounds = 9}},
};

#define SHORT_STEP (1.0 / 240) /* s */

/* Scenes that the keys need come first, expensive ones last. */
static const bench_case cases[] = {
    {"cloth32", SOFT, {MAIN_STEP}},
    {"cloth64", SOFT, {MAIN_STEP}},
    {"cloth64", STIFF, {MAIN_STEP}},
    {"cloth100", SOFT, {SHORT_STEP, MAIN_STEP}},
    {"cloth32", STIFF, {MAIN_STEP, SHORT_STEP}},
    {"cloth32", SOFT, {SHORT_STEP}},
    {"cloth64", SOFT, {SHORT_STEP}},
    {"cloth64", STIFF, {SHORT_STEP}},
    {"jelly16", SOFT, {MAIN_STEP, SHORT_STEP}},
    {"cloth100", STIFF, {SHORT_STEP, MAIN_STEP}},
    {"cloth200", STIFF, {MAIN_STEP}},
};

typedef struct step_bench {
  const bench_run *run;
  double soft; /* s, of cloth64 with SOFT springs to SUMMARY_ACCURACY; NAN: unknown */
  struct {
    double worst;                /* NAN: no case; INFINITY: Newton's method failed in one */
    int cases, bounds, unsolved; /* numbers of cases, of upper bounds, of INFINITY */
  } prefactored;                 /* for newton_over_prefactored, over all cloths */
} step_bench;

enum { SUMMARY_ACCURACY = 1, LAST = ACCURACIES - 1 };

/*------------------------------------- results --------------------------------------------------*/

static const column times[] = {{"", "ms", 8, "%.4g", 0}, {"+-", "spread", 4, "%.0f%%", 100}};

static void print_times(const json_t *row) {
  for (int i = 0; i < 2; i++) print_value(&times[i], row);
}

static void report_factorization(report *out, const step_comparison *r) {
  json_t *row = add_step_row(out, "factor", r->step.moving, r->step.h,
                             FIELDS(TEXT("method", "cholmod, bare")));
  printf(" %-21s", "one factorization");
  if (r->factor) {
    put_fields(row, FIELDS(TEXT("status", "ok")));
    put_times(row, r->factor, factor_seconds, "ms", 1e3);
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
    put_times(row, c, whole_seconds, "ms", 1e3);
    put_fields(row, FIELDS(TEXT("status", "ok"), INTEGER("iterations", at->iterations),
                           REAL("error", at->error),
                           REAL("newton_rtol",
                                method <= BY_CHOLMOD ? newton_sweep_rtol(at->setting) : NAN)));
  } else {
    put_fields(
        row, FIELDS(TEXT("status", ends[p->end]), TEXT("reason", p->reason),
                    REAL("at_least_ms", p->end == END_CUT_OFF ? 1e3 * p->seconds_unreached : NAN)));
  }
  print_times(row);
}

static void report_step_comparison(report *out, const step_comparison *r) {
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

/* Ratio of the times of two methods to an accuracy. */
typedef struct step_ratio {
  double value;                 /* NAN: not measured; INFINITY: msim's Newton method failed */
  const accuracy_record *bound; /* of the other method, which failed, so that `value` is an upper
                                   bound; NULL: exact */
} step_ratio;

static void report_step_ratio(report *out, const step_comparison *r, const char *name, int accuracy,
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

/*------------------------------------- ratios ---------------------------------------------------*/

/* Time of Newton's method with pcg over that of another method; an upper bound if the other one was
 * cut off. */
static step_ratio over_method(const step_comparison *r, int method) {
  const timing_candidate *ours = r->reached[BY_PCG][SUMMARY_ACCURACY];
  const timing_candidate *other = r->reached[method][SUMMARY_ACCURACY];
  const accuracy_record *p = &r->records[method];
  if (ours && other)
    return (step_ratio){median_ratio(ours, whole_seconds, other, whole_seconds), NULL};
  if (ours && p->end == END_CUT_OFF)
    return (step_ratio){median_of(ours, whole_seconds) / p->seconds_unreached, p};
  return (step_ratio){NAN, NULL};
}

/* Ratio to a prefactored method; one that failed or found another minimum counts with all of its
 * time. */
static step_ratio over_descent(const step_comparison *r, int method) {
  const timing_candidate *ours = r->reached[BY_PCG][SUMMARY_ACCURACY];
  const accuracy_record *p = &r->records[method];
  const step_ratio ratio = over_method(r, method);
  if (!ours || isfinite(ratio.value) || p->end == END_SKIPPED) return ratio;
  return (step_ratio){median_of(ours, whole_seconds) / r->descent_limit, p};
}

/* Ratio to the faster prefactored method; INFINITY if Newton's method failed. */
static step_ratio over_prefactored(const step_comparison *r) {
  if (!r->reached[BY_PCG][SUMMARY_ACCURACY])
    return (step_ratio){r->records[BY_PCG].end == END_SKIPPED ? NAN : INFINITY, NULL};
  const step_ratio a = over_descent(r, BY_PROJECTIVE_DYNAMICS), b = over_descent(r, BY_LBFGS);
  return isnan(b.value) || a.value > b.value ? a : b;
}

static step_ratio over_factor(const step_comparison *r) {
  const timing_candidate *ours = r->reached[BY_PCG][LAST];
  if (!ours || !r->factor) return (step_ratio){NAN, NULL};
  return (step_ratio){median_ratio(ours, whole_seconds, r->factor, factor_seconds), NULL};
}

/*------------------------------------- keys -----------------------------------------------------*/

/* Adds a case of newton_over_prefactored, if it is a cloth. */
static void count_case(step_bench *b, const moving_scene *m, step_ratio found) {
  if (m->kind->solid || isnan(found.value)) return;
  b->prefactored.cases++;
  b->prefactored.bounds += found.bound != NULL;
  b->prefactored.unsolved += isinf(found.value) != 0;
  b->prefactored.worst = fmax(b->prefactored.worst, found.value);
}

static void measure_stiffness(step_bench *b, const step_comparison *r) {
  const moving_scene *m = r->step.moving;
  const timing_candidate *ours = r->reached[BY_PCG][SUMMARY_ACCURACY];
  if (!ours || strcmp(m->kind->name, "cloth64") != 0 || r->step.h != MAIN_STEP) return;
  const double seconds = median_of(ours, whole_seconds);
  if (m->k == SOFT) b->soft = seconds;
  else
    report_case_key(b->run->report, "stiff_over_soft", m->kind->name, m->k, r->step.h,
                    seconds / b->soft);
}

static void report_ratios(step_bench *b, const step_comparison *r) {
  const moving_scene *m = r->step.moving;
  const struct {
    const char *name;
    int accuracy;
    step_ratio found;
  } ratios[] = {
      {"newton_over_tuned_factor", LAST, over_factor(r)},
      {"newton_over_newton_cholmod", SUMMARY_ACCURACY, over_method(r, BY_CHOLMOD)},
      {"newton_over_prefactored", SUMMARY_ACCURACY, over_prefactored(r)},
  };
  for (int i = 0; i < 3; i++) {
    const double value = ratios[i].found.value;
    if (isnan(value)) continue;
    report_step_ratio(b->run->report, r, ratios[i].name, ratios[i].accuracy, ratios[i].found);
    report_case_key(b->run->report, ratios[i].name, m->kind->name, m->k, r->step.h, value);
  }
  count_case(b, m, ratios[2].found);
  measure_stiffness(b, r);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static void measure_step_case(void *bench, moving_scene *m, double h) {
  step_bench *b = bench;
  const bench_run *run = b->run;
  msim_error err;
  step_comparison *r = NULL;
  nonlinear_step_settle(m, h);
  if (clock_seconds() < run->until)
    r = step_comparison_run(m, h, &plans[run->options->quick], run->until, &err);
  if (r && !is_interrupted()) {
    report_step_comparison(run->report, r);
    report_ratios(b, r);
  } else if (clock_seconds() > run->until) {
    report_left_out(run->report, "solution", m, h, "all", NO_TIME);
  } else if (!is_interrupted()) {
    add_step_row(run->report, "solution", m, h,
                 FIELDS(TEXT("status", "failed"), TEXT("reason", err.text)));
    printf(" %s\n", err.text);
    count_case(b, m, (step_ratio){INFINITY, NULL});
  }
  fflush(stdout);
  step_comparison_free(r);
}

int bench_step(bench_run *run) {
  step_bench b = {.run = run, .soft = NAN, .prefactored = {.worst = NAN}};
  measure_cases(run, (int)(sizeof cases / sizeof *cases), cases, 1, "solution", measure_step_case,
                &b);
  report_key(run->report, "newton_over_prefactored", b.prefactored.worst);
  report_key(run->report, "newton_over_prefactored_cases", b.prefactored.cases);
  report_key(run->report, "newton_over_prefactored_bounds", b.prefactored.bounds);
  report_key(run->report, "newton_over_prefactored_unsolved", b.prefactored.unsolved);
  return 0;
}
