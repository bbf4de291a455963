/* scaling - benchmark of implicit steps against the size and the stiffness of scenes, by `auto` and
 * by CHOLMOD: time, set-up, memory, and iterations against the memory bandwidth */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../bench_reference/triad.h"
#include "../common/clock.h"
#include "../common/interrupt.h"
#include "batch.h"
#include "cost_limits.h"
#include "counted_memory.h"
#include "solver_comparison.h"

typedef struct scaling_plan {
  timing_limits each, growth;
  cost_limits limits;
  int batch; /* small scenes that are stepped together */
} scaling_plan;

static const scaling_plan plans[] = {
    {.each = {.budget = 20, .min_rounds = 3, .max_rounds = 15},
     .growth = {.budget = 40, .min_rounds = 5, .max_rounds = 15},
     .limits = {.dense = 6e11},
     .batch = 1000},
    {.each = {.budget = 1, .min_rounds = 3, .max_rounds = 5},
     .growth = {.budget = 6, .min_rounds = 2, .max_rounds = 3},
     .limits = {.dense = 6e9},
     .batch = 100},
};

/* Scenes that the keys need come first, expensive ones last; --quick leaves out the first one,
 * unless it is selected. */
static const bench_case cases[] = {
    {"cloth1000", SOFT, {MAIN_STEP}}, {"cloth32", SOFT, {MAIN_STEP}},
    {"cloth64", SOFT, {MAIN_STEP}},   {"cloth100", SOFT, {MAIN_STEP}},
    {"cloth100", STIFF, {MAIN_STEP}}, {"cloth500", SOFT, {MAIN_STEP}},
    {"jelly8", SOFT, {MAIN_STEP}},    {"jelly16", SOFT, {MAIN_STEP}},
    {"cloth200", SOFT, {MAIN_STEP}},  {"jelly24", SOFT, {MAIN_STEP}},
    {"jelly32", SOFT, {MAIN_STEP}},   {"jelly46", SOFT, {MAIN_STEP}},
    {"cloth316", SOFT, {MAIN_STEP}},
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

/*------------------------------------- keys -----------------------------------------------------*/

/* Reports a key that ends in the name of the scene. */
static void report_scene_key(const scaling_bench *s, const char *key, const moving_scene *m,
                             double value) {
  char name[96];
  snprintf(name, sizeof name, "%s_%s", key, m->kind->name);
  report_key(s->run->report, name, value);
  if (isfinite(value)) printf(" %s: %.3g\n", name, value);
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
  double growth = NAN;
  if (moving_scene_create(scene_named("cloth64"), m->k, b->options->threads, b->fall, b->until,
                          &small))
    r = make_comparison(&small, &err);
  if (r) {
    const timing_candidate *c = solver_comparison_add_step(r, "auto", NULL, 1);
    growth = time_pair(large, whole_seconds, c, whole_seconds, &p, pair) * small.view.nparticles /
             m->view.nparticles;
  }
  report_scene_key(s, "time_per_particle_growth_cloth64_to", m, growth);
  solver_comparison_free(r);
  moving_scene_free(&small);
}

static int run_setup(timing_candidate *c, timing_sample *sample) {
  const moving_scene *m = c->data;
  const msim_options options = implicit_options(MAIN_STEP, 1e-6, "auto", 1);
  msim_sim *sim = NULL;
  msim_error err;
  const double start = clock_seconds();
  const msim_status status = msim_sim_create(m->scene, &options, &sim, &err);
  sample->whole = clock_seconds() - start;
  msim_sim_destroy(sim);
  return status ? candidate_fail(c, err.text) : 1;
}

/* Measures the creation of a sim relative to a step, on one thread. */
static void measure_setup(scaling_bench *s, moving_scene *m, const timing_candidate *step) {
  const timing_limits p = limits_until(s->plan->each, s->run->until);
  timing_candidate setup, pair[2];
  candidate_init(&setup, "setup", "setup", run_setup, m);
  report_scene_key(s, "setup_over_step", m,
                   time_pair(&setup, whole_seconds, step, whole_seconds, &p, pair));
}

/* Measures the bytes a particle at the peak of creation and a step, with those of the scene. */
static void measure_bytes(scaling_bench *s, const moving_scene *m) {
  const msim_options options = implicit_options(MAIN_STEP, 1e-6, "auto", 1);
  counted_memory memory;
  moving_scene own;
  msim_sim *sim = NULL;
  counted_memory_begin(&memory);
  const int made = !moving_scene_build(m->kind, m->k, &memory.allocator, &own) &&
                   !msim_sim_create(own.scene, &options, &sim, &own.err) &&
                   !msim_sim_step(sim, 1, &own.err);
  msim_sim_destroy(sim);
  moving_scene_free(&own);
  report_scene_key(s, "bytes_a_particle", m,
                   made ? (double)atomic_load(&memory.peak) / m->view.nparticles : NAN);
}

/* Bytes that an iteration of pcg must transfer, without its coarse factor; vectors are floats but
 * for y. A particle: p, q and the inertia in the product; r, q, z and D^-1 in the update of the
 * residual; the modes of its aggregate there and back; p, y, z in that of the solution. A
 * half-edge, as a spring is read from both ends: four floats, and a neighbour index of 4 bytes for
 * 8 of them. */
static double bytes_of_iteration(const moving_scene *m) {
  const double particle = 32 + 72 + 36 + 84, half = 16.5;
  return particle * m->view.nparticles + 2 * half * m->view.nsprings;
}

static int run_iteration_triad(timing_candidate *c, timing_sample *sample) {
  sample->whole = triad_seconds(c->data, 1, 10);
  return 1;
}

/* Measures the triad of these bytes relative to an iteration, on one thread. */
static void measure_iteration(scaling_bench *s, const moving_scene *m,
                              const timing_candidate *step) {
  const timing_limits p = limits_until(s->plan->each, s->run->until);
  timing_candidate memory, pair[2];
  triad t = {0};
  candidate_init(&memory, "triad", "triad", run_iteration_triad, &t);
  if (!triad_make(&t, (size_t)bytes_of_iteration(m))) candidate_fail(&memory, "out of memory");
  report_scene_key(s, "pcg_iteration_triad_fraction", m,
                   time_pair(&memory, whole_seconds, step, solve_per_iteration, &p, pair));
  triad_free(&t);
}

static void measure_batch(scaling_bench *s, const moving_scene *m) {
  const timing_limits p = limits_until(s->plan->each, s->run->until);
  const int n = s->plan->batch;
  report_scene_key(s, "batch_efficiency_explicit", m, batch_measure_efficiency(m, n, 0, &p));
  report_scene_key(s, "batch_efficiency_implicit", m, batch_measure_efficiency(m, n, 1, &p));
}

/* Iterations of the solver in a step; NAN for a direct solver. */
static double iterations_of(const timing_candidate *c) {
  const int64_t iterations = has_result(c) ? c->samples[c->nsamples - 1].iterations : 0;
  return iterations > 0 ? (double)iterations : NAN;
}

static void measure_keys(scaling_bench *s, moving_scene *m, const solver_comparison *r) {
  const char *scene = m->kind->name;
  if (strcmp(scene, "cloth32") == 0) measure_batch(s, m);
  if (strcmp(scene, "cloth1000") == 0) {
    measure_time_growth(s, &r->all[0], m);
    measure_setup(s, m, &r->all[0]);
    measure_bytes(s, m);
  }
  if (strcmp(scene, "cloth500") == 0) {
    measure_time_growth(s, &r->all[0], m);
    measure_iteration(s, m, &r->all[0]);
    if (s->run->options->threads == 2)
      report_scene_key(s, "two_threads_implicit", m,
                       median_ratio(&r->all[0], whole_seconds, &r->all[1], whole_seconds));
  }
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
    measure_keys(s, m, r);
  }
  solver_comparison_free(r);
}

int bench_scaling(bench_run *b) {
  scaling_bench s = {.run = b, .plan = &plans[b->options->quick], .soft_iterations = NAN};
  const int left_out = b->options->quick && b->options->nscenes == 0;
  measure_cases(b, (int)(sizeof cases / sizeof *cases) - left_out, cases + left_out,
                b->options->threads, "step", measure_scaling_case, &s);
  return 0;
}
