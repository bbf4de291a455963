/* Summary keys of paired timings: two candidates, on one thread each, alternate and make the same
 * series of steps from the same state of a scene in motion. A key is the ratio of the mean times of
 * a step in the series, which include factorizations that are reused within it. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/interrupt.h"
#include "linear.h"

#define REFERENCE_NAME "default cholmod"

/* A ratio is measured in each case of which it is in the summary. */
static const struct timed_pair {
  const char *ratio, *over, *under; /* values of option `solver`, or REFERENCE_NAME */
  sample_value *of_over, *of_under;
} pairs[] = {
    {"auto_over_tuned_cholmod", "auto", "cholmod", whole_seconds, whole_seconds},
    {"auto_over_default_cholmod", "auto", REFERENCE_NAME, whole_seconds, whole_seconds},
    {"jacobian_over_force", "pcg", "pcg", assemble_seconds, force_seconds},
    {"expanded_jacobian_over_force", "cholmod", "cholmod", assemble_seconds, force_seconds},
};

static const bench_case cases[] = {{"cloth100", SOFT, {MAIN_STEP}},
                                   {"cloth100", STIFF, {MAIN_STEP}},
                                   {"cloth64", SOFT, {MAIN_STEP}},
                                   {"jelly16", SOFT, {MAIN_STEP}},
                                   {"cloth200", SOFT, {MAIN_STEP}}};

static timing_candidate *add_pair_side(linear_bench *b, solver_comparison *r, const char *name) {
  for (int i = 0; i < r->count; i++)
    if (strcmp(r->all[i].name, name) == 0) return &r->all[i];
  if (strcmp(name, REFERENCE_NAME) != 0) return solver_comparison_add_step(r, name, NULL, 1);
  return solver_comparison_send(r, &b->cholmod)
             ? solver_comparison_add_reference(r, "default", &b->cholmod, 0)
             : NULL;
}

static void put_pair_side(json_t *row, const char *role, const timing_candidate *c,
                          sample_value *value) {
  const struct timed_step *step = solver_comparison_step(c);
  msim_plan plan = {.size = sizeof plan};
  char ms[32], median[32], kinetic[32], ran[32];
  snprintf(ms, sizeof ms, "%s_ms", role);
  snprintf(median, sizeof median, "%s_median_ms", role);
  snprintf(kinetic, sizeof kinetic, "%s_least_kinetic", role);
  snprintf(ran, sizeof ran, "%s_ran", role);
  put_fields(row, FIELDS(TEXT(role, c->name), REAL(ms, 1e3 * median_of(c, value))));
  if (!step || !step->sim) return;
  msim_sim_plan(step->sim, &plan);
  put_fields(row, FIELDS(TEXT(ran, plan.solver)));
  if (value == whole_seconds && c->nsamples > 0)
    put_fields(row, FIELDS(REAL(median, 1e3 * median_of(c, median_seconds)),
                           REAL(kinetic, median_of(c, kinetic_energy))));
}

static const char *reason_of_failure(const timing_candidate pair[2]) {
  for (int i = 0; i < 2; i++)
    if (pair[i].failed) return pair[i].reason;
  return NO_TIME;
}

static void measure_pair(linear_bench *b, solver_comparison *r, const struct timed_pair *p,
                         const char *key) {
  timing_candidate *over = add_pair_side(b, r, p->over), *under = add_pair_side(b, r, p->under);
  timing_candidate pair[2];
  if (!over || !under) return;
  const double ratio = time_pair(over, p->of_over, under, p->of_under, &b->pair_limits, pair);
  if (is_interrupted()) return;
  const char *reason = isfinite(ratio) ? NULL : reason_of_failure(pair);
  const int repeats = pair[0].nsamples > 1 ? pair[0].nsamples - 1 : pair[0].nsamples;
  json_t *row = add_step_row(
      b->report, "pair", r->moving, r->system.h,
      FIELDS(TEXT("name", key), INTEGER("repeats", repeats), INTEGER("series", r->series),
             REAL("ratio", ratio), TEXT("reason", reason)));
  put_pair_side(row, "over", &pair[0], p->of_over);
  put_pair_side(row, "under", &pair[1], p->of_under);
  if (reason) {
    printf(" %-40s no result: %s\n", key, reason);
  } else {
    report_key(b->report, key, ratio);
    printf(" %-40s %.3g: %.3g ms over %.3g ms\n", key, ratio, row_number(row, "over_ms"),
           row_number(row, "under_ms"));
  }
  fflush(stdout);
}

static void measure_pairs(void *bench, moving_scene *m, double h) {
  linear_bench *b = bench;
  msim_error err;
  solver_comparison *r = solver_comparison_create(m, h, 1e-6, 1, &err);
  if (!r) {
    report_left_out(b->report, "pair", m, h, "all", err.text);
    return;
  }
  r->series = b->pair_series[m->kind->solid];
  r->until = b->run->until;
  for (size_t i = 0; i < sizeof pairs / sizeof *pairs && !is_interrupted(); i++) {
    const char *key = case_key(b->report, pairs[i].ratio, m->kind->name, m->k, h);
    if (key) measure_pair(b, r, &pairs[i], key);
  }
  solver_comparison_free(r);
}

void measure_paired_keys(linear_bench *b) {
  measure_cases(b->run, (int)(sizeof cases / sizeof *cases), cases, b->run->options->threads,
                "pair", measure_pairs, b);
}
