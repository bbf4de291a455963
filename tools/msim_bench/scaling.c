/* scaling - benchmark of implicit steps against the size and the stiffness of scenes, by `auto` and
 * by CHOLMOD */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/interrupt.h"
#include "cost_limits.h"
#include "solver_comparison.h"

typedef struct scaling_plan {
  timing_limits each, growth;
  cost_limits limits;
} scaling_plan;

static const scaling_plan plans[] = {
    {.each = {.budget = 20, .min_rounds = 3, .max_rounds = 15},
     .growth = {.budget = 40, .min_rounds = 5, .max_rounds = 15},
     .limits = {.dense = 6e11}},
    {.each = {.budget = 1, .min_rounds = 3, .max_rounds = 5},
     .growth = {.budget = 6, .min_rounds = 2, .max_rounds = 3},
     .limits = {.dense = 6e9}},
};

/* Scenes that the keys need come first, expensive ones last. */
static const bench_case cases[] = {
    {"cloth32", SOFT, {MAIN_STEP}},  {"cloth64", SOFT, {MAIN_STEP}},
    {"cloth100", SOFT, {MAIN_STEP}}, {"cloth100", STIFF, {MAIN_STEP}},
    {"cloth500", SOFT, {MAIN_STEP}}, {"jelly8", SOFT, {MAIN_STEP}},
    {"jelly16", SOFT, {MAIN_STEP}},  {"cloth200", SOFT, {MAIN_STEP}},
    {"jelly24", SOFT, {MAIN_STEP}},  {"jelly32", SOFT, {MAIN_STEP}},
    {"jelly46", SOFT, {MAIN_STEP}},  {"cloth316", SOFT, {MAIN_STEP}},
};

typedef struct scaling_bench {
  const bench_run *run;
  const scaling_plan *plan;
  double soft_iterations; /* of cloth100 with SOFT springs; NAN: unknown */
} scaling_bench;

/* Prepares a comparison without the matrix, with untimed steps that warm the caches. */
static solver_comparison *make_comparison(const moving_scene *m, msim_error *err) {
  solver_comparison *r = solver_comparison_create(m, MAIN_STEP, 1e-6, 0, err);
  if (r) r->warm = 0.02;
  return r;
}

static void add_candidates(const scaling_bench *s, solver_comparison *r) {
  const int32_t threads = s->run->options->threads;
  char why[128];
  solver_comparison_add_step(r, "auto", NULL, 1);
  if (threads > 1) {
    timing_candidate *c = solver_comparison_add_step(r, "auto", NULL, threads);
    snprintf(c->name, sizeof c->name, "auto, %d threads", (int)threads);
  }
  if (reason_to_skip("cholmod", r->moving, MAIN_STEP, r->system.rtol, &s->plan->limits, why))
    report_left_out(s->run->report, "step", r->moving, MAIN_STEP, "cholmod", why);
  else solver_comparison_add_step(r, "cholmod", NULL, 1);
}

/* Measures the time per particle relative to cloth64, by paired timing. */
static void measure_time_growth(scaling_bench *s, const timing_candidate *large,
                                const moving_scene *m) {
  const bench_run *b = s->run;
  const timing_limits p = limits_until(s->plan->growth, b->until);
  timing_candidate pair[2];
  moving_scene small;
  msim_error err;
  solver_comparison *r = NULL;
  if (moving_scene_create(scene_named("cloth64"), m->k, b->options->threads, b->fall, b->until,
                          &small))
    r = make_comparison(&small, &err);
  if (r) {
    const timing_candidate *c = solver_comparison_add_step(r, "auto", NULL, 1);
    const double growth = time_pair(large, whole_seconds, c, whole_seconds, &p, pair) *
                          small.view.nparticles / m->view.nparticles;
    report_key(b->report, "time_per_particle_growth_cloth64_to_cloth500", growth);
    if (isfinite(growth)) printf(" time per particle over that of cloth64: %.3g\n", growth);
  }
  solver_comparison_free(r);
  moving_scene_free(&small);
}

/* Iterations of the solver in a step; NAN for a direct solver. */
static double iterations_of(const timing_candidate *c) {
  const int64_t iterations = has_result(c) ? c->samples[c->nsamples - 1].iterations : 0;
  return iterations > 0 ? (double)iterations : NAN;
}

static void measure_keys(scaling_bench *s, const solver_comparison *r) {
  const char *scene = r->moving->kind->name;
  if (strcmp(scene, "cloth500") == 0) measure_time_growth(s, &r->all[0], r->moving);
  if (strcmp(scene, "cloth100") != 0) return;
  const double iterations = iterations_of(&r->all[0]);
  if (r->moving->k == SOFT) s->soft_iterations = iterations;
  else report_key(s->run->report, "iterations_growth_k_to_100k", iterations / s->soft_iterations);
}

static void measure_scaling_case(void *bench, moving_scene *m, double h) {
  scaling_bench *s = bench;
  const timing_limits p = limits_until(s->plan->each, s->run->until);
  msim_error err;
  solver_comparison *r = make_comparison(m, &err);
  if (!r) {
    report_left_out(s->run->report, "step", m, h, "all", err.text);
    return;
  }
  add_candidates(s, r);
  time_in_turn(r->all, r->count, &p);
  if (!is_interrupted()) {
    solver_comparison_report(s->run->report, r, NULL);
    measure_keys(s, r);
  }
  solver_comparison_free(r);
}

int bench_scaling(bench_run *b) {
  scaling_bench s = {.run = b, .plan = &plans[b->options->quick], .soft_iterations = NAN};
  measure_cases(b, (int)(sizeof cases / sizeof *cases), cases, b->options->threads, "step",
                measure_scaling_case, &s);
  return 0;
}
