/* step - benchmark of one nonlinear step of implicit Euler to relative velocity errors of 1e-2,
 * 1e-4 and 1e-6: Newton's method with pcg and CHOLMOD, prefactored methods, and one
 * factorization */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/message.h"
#include "benches.h"
#include "interrupt.h"
#include "linear_report.h"
#include "step_comparison.h"
#include "step_report.h"

typedef struct bench_plan {
  double seconds; /* s, limit for all scenes */
  double fall;    /* s, limit for advancing a scene */
  step_plan each;
} bench_plan;

static const bench_plan plan_full = {
    .seconds = 840,
    .fall = 60,
    .each = {.solution = 60,
             .ladder = 30,
             .descent = 10,
             .turns = {.budget = 15, .min_rounds = 3, .max_rounds = 30}},
};
static const bench_plan plan_quick = {
    .seconds = 45,
    .fall = 3,
    .each = {.solution = 3,
             .ladder = 4,
             .is_quick = 1,
             .descent = 0.5,
             .turns = {.budget = 1.2, .min_rounds = 2, .max_rounds = 9}},
};

enum { SOFT = 1000, STIFF = 100000 }; /* N/m */
#define LONG  (1.0 / 60)              /* s */
#define SHORT (1.0 / 240)

/* Scenes that the keys need come first, expensive ones last. */
static const struct step_case {
  const char *scene;
  double k, steps[2];
} subjects[] = {
    {"cloth32", SOFT, {LONG}},         {"cloth64", SOFT, {LONG}},
    {"cloth64", STIFF, {LONG}},        {"cloth100", SOFT, {SHORT, LONG}},
    {"cloth32", STIFF, {LONG, SHORT}}, {"cloth32", SOFT, {SHORT}},
    {"cloth64", SOFT, {SHORT}},        {"cloth64", STIFF, {SHORT}},
    {"jelly16", SOFT, {LONG, SHORT}},  {"cloth100", STIFF, {SHORT, LONG}},
    {"cloth200", STIFF, {LONG}},
};
enum { SUBJECTS = sizeof subjects / sizeof *subjects };

typedef struct step_bench {
  const bench_options *options;
  const bench_plan *plan;
  report *report;
  double until; /* on clock_seconds' clock */
  double soft;  /* s, of cloth64 with SOFT springs to SUMMARY_ACCURACY; NAN: unknown */
  struct {
    double worst;                /* NAN: no case; INFINITY: Newton's method failed in one */
    int cases, bounds, unsolved; /* numbers of cases, of upper bounds, of INFINITY */
  } prefactored;                 /* for newton_over_prefactored, over all cloths */
} step_bench;

enum { SUMMARY_ACCURACY = 1, LAST = ACCURACIES - 1 };

/*------------------------------------- ratios ---------------------------------------------------*/

/* Time of Newton's method with pcg over that of another method; an upper bound if the other one was
 * cut off. */
static step_ratio over_method(const step_comparison *r, int method) {
  const timing_candidate *ours = r->reached[BY_PCG][SUMMARY_ACCURACY];
  const timing_candidate *other = r->reached[method][SUMMARY_ACCURACY];
  const accuracy_record *p = r->records[method];
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
  const accuracy_record *p = r->records[method];
  const step_ratio ratio = over_method(r, method);
  if (!ours || isfinite(ratio.value) || p->end == END_SKIPPED) return ratio;
  return (step_ratio){median_of(ours, whole_seconds) / r->descent_limit, p};
}

/* Ratio to the faster prefactored method; INFINITY if Newton's method failed. */
static step_ratio over_prefactored(const step_comparison *r) {
  const int is_left_out = r->records[BY_PCG]->end == END_SKIPPED;
  if (!r->reached[BY_PCG][SUMMARY_ACCURACY])
    return (step_ratio){is_left_out ? NAN : INFINITY, NULL};
  const step_ratio a = over_descent(r, BY_PROJECTIVE_DYNAMICS), b = over_descent(r, BY_LBFGS);
  return isnan(b.value) || a.value > b.value ? a : b;
}

static step_ratio over_factor(const step_comparison *r) {
  const timing_candidate *ours = r->reached[BY_PCG][LAST];
  if (!ours || !r->factor) return (step_ratio){NAN, NULL};
  return (step_ratio){median_ratio(ours, whole_seconds, r->factor, factor_seconds), NULL};
}

/*------------------------------------- keys -----------------------------------------------------*/

static const struct step_key {
  const char *ratio, *scene;
  double h;
  const char *key;
} keys[] = {
    {"newton_over_tuned_factor", "cloth32", LONG, "newton_over_tuned_factor_cloth32"},
    {"newton_over_tuned_factor", "cloth64", LONG, "newton_over_tuned_factor_cloth64"},
    {"newton_over_tuned_factor", "cloth100", SHORT, "newton_over_tuned_factor_cloth100_h240"},
    {"newton_over_newton_cholmod", "cloth64", LONG, "newton_over_newton_cholmod_cloth64"},
    {"newton_over_newton_cholmod", "cloth100", LONG, "newton_over_newton_cholmod_cloth100"},
};

static void report_step_key(report *out, const char *ratio, const moving_scene *m, double h,
                            double value) {
  for (const struct step_key *k = keys; k < keys + sizeof keys / sizeof *keys; k++)
    if ((!ratio || strcmp(k->ratio, ratio) == 0) && strcmp(k->scene, m->kind->name) == 0 &&
        m->k == SOFT && k->h == h)
      report_key(out, k->key, value);
}

static void report_ratio_and_key(step_bench *b, const step_comparison *r, const char *name,
                                 int accuracy, step_ratio found) {
  if (isnan(found.value)) return;
  report_step_ratio(b->report, r, name, accuracy, found);
  report_step_key(b->report, name, r->step.moving, r->step.h, found.value);
}

/* Adds a case of newton_over_prefactored, if it is a cloth. */
static void count_case(step_bench *b, const moving_scene *m, step_ratio found) {
  if (m->kind->solid || isnan(found.value)) return;
  b->prefactored.cases++;
  b->prefactored.bounds += found.bound != NULL;
  b->prefactored.unsolved += isinf(found.value) != 0;
  b->prefactored.worst = fmax(b->prefactored.worst, found.value);
}

static int is_of_stiffness(const moving_scene *m, double h) {
  return strcmp(m->kind->name, "cloth64") == 0 && h == LONG;
}

static void measure_stiffness(step_bench *b, const step_comparison *r) {
  const moving_scene *m = r->step.moving;
  const timing_candidate *ours = r->reached[BY_PCG][SUMMARY_ACCURACY];
  if (!ours || !is_of_stiffness(m, r->step.h)) return;
  const double seconds = median_of(ours, whole_seconds);
  if (m->k == SOFT) b->soft = seconds;
  else report_key(b->report, "stiff_over_soft_cloth64", seconds / b->soft);
}

static void report_keys(step_bench *b, const step_comparison *r) {
  const step_ratio prefactored = over_prefactored(r);
  report_ratio_and_key(b, r, "newton_over_tuned_factor", LAST, over_factor(r));
  report_ratio_and_key(b, r, "newton_over_newton_cholmod", SUMMARY_ACCURACY,
                       over_method(r, BY_CHOLMOD));
  report_ratio_and_key(b, r, "newton_over_prefactored", SUMMARY_ACCURACY, prefactored);
  count_case(b, r->step.moving, prefactored);
  measure_stiffness(b, r);
}

/* Initializes the keys of a scene to "no result". */
static void init_step_keys(step_bench *b, const moving_scene *m, double h) {
  report_step_key(b->report, NULL, m, h, NAN);
  if (is_of_stiffness(m, h)) report_key(b->report, "stiff_over_soft_cloth64", NAN);
}

static void report_prefactored(const step_bench *b) {
  report_key(b->report, "newton_over_prefactored", b->prefactored.worst);
  report_key(b->report, "newton_over_prefactored_cases", b->prefactored.cases);
  report_key(b->report, "newton_over_prefactored_bounds", b->prefactored.bounds);
  report_key(b->report, "newton_over_prefactored_unsolved", b->prefactored.unsolved);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static void measure_step(step_bench *b, const moving_scene *m, double h) {
  msim_error err;
  step_comparison *r = NULL;
  if (clock_seconds() < b->until) r = step_comparison_run(m, h, &b->plan->each, b->until, &err);
  if (r && !is_interrupted()) {
    report_step_comparison(b->report, r);
    report_keys(b, r);
  } else if (clock_seconds() > b->until) {
    report_left_out(b->report, "solution", m, h, "all", "there was no time left");
  } else if (!is_interrupted()) {
    report_unsolved(b->report, m, h, err.text);
    count_case(b, m, (step_ratio){INFINITY, NULL});
  }
  step_comparison_free(r);
}

static void measure_subject(step_bench *b, const struct step_case *subject) {
  moving_scene m;
  const int made =
      moving_scene_create(scene_named(subject->scene), subject->k, 1, b->plan->fall, b->until, &m);
  for (int i = 0; i < 2 && subject->steps[i] > 0 && !is_interrupted(); i++) {
    print_heading(&m, subject->steps[i]);
    init_step_keys(b, &m, subject->steps[i]);
    if (made) nonlinear_step_settle(&m, subject->steps[i]);
    if (made) measure_step(b, &m, subject->steps[i]);
    else report_left_out(b->report, "solution", &m, subject->steps[i], "all", m.err.text);
  }
  moving_scene_free(&m);
}

static int is_step_scene(const bench_scene *scene) {
  for (int i = 0; i < SUBJECTS; i++)
    if (strcmp(subjects[i].scene, scene->name) == 0) return 1;
  return 0;
}

int bench_step(const bench_options *wishes, report *r) {
  const bench_plan *plan = wishes->quick ? &plan_quick : &plan_full;
  step_bench b = {.options = wishes,
                  .plan = plan,
                  .report = r,
                  .until = clock_seconds() + plan->seconds,
                  .soft = NAN,
                  .prefactored = {.worst = NAN}};
  if (wishes->threads)
    return report_usage_error("", "--threads means nothing to the bench 'step', which runs on one");
  for (int i = 0; i < wishes->nscenes; i++)
    if (!is_step_scene(wishes->scenes[i]))
      return report_usage_error("", "scene '%s' is not one of the bench 'step'",
                                wishes->scenes[i]->name);
  for (int i = 0; i < SUBJECTS && !is_interrupted(); i++)
    if (is_scene_selected(wishes, subjects[i].scene)) measure_subject(&b, &subjects[i]);
  report_prefactored(&b);
  return 0;
}
