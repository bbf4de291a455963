/* scaling - benchmark of implicit steps against the size and the stiffness of scenes, by `auto` and
 * by CHOLMOD */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/message.h"
#include "benches.h"
#include "interrupt.h"
#include "linear_report.h"
#include "cost_limits.h"

#define STEP (1.0 / 60)
enum { SOFT = 1000, STIFF = 100000 }; /* N/m */

typedef struct scaling_plan {
  double seconds; /* s, limit for all scenes */
  double fall;    /* s, limit for advancing a scene */
  timing_limits each, growth;
  cost_limits limits;
} scaling_plan;

static const scaling_plan plan_full = {
    .seconds = 840,
    .fall = 60,
    .each = {.budget = 20, .min_rounds = 3, .max_rounds = 15},
    .growth = {.budget = 40, .min_rounds = 5, .max_rounds = 15},
    .limits = {.dense = 6e11},
};
static const scaling_plan plan_quick = {
    .seconds = 46,
    .fall = 3,
    .each = {.budget = 1, .min_rounds = 3, .max_rounds = 5},
    .growth = {.budget = 6, .min_rounds = 2, .max_rounds = 3},
    .limits = {.dense = 6e9},
};

/* Scenes that the keys need come first, expensive ones last. */
static const struct scaling_case {
  const char *scene;
  double k;
} subjects[] = {
    {"cloth32", SOFT},  {"cloth64", SOFT}, {"cloth100", SOFT}, {"cloth100", STIFF},
    {"cloth500", SOFT}, {"jelly8", SOFT},  {"jelly16", SOFT},  {"cloth200", SOFT},
    {"jelly24", SOFT},  {"jelly32", SOFT}, {"jelly46", SOFT},  {"cloth316", SOFT},
};
enum { SUBJECTS = sizeof subjects / sizeof *subjects };

typedef struct scaling {
  const bench_options *options;
  const scaling_plan *plan;
  report *report;
  double until;           /* on clock_seconds' clock */
  double soft_iterations; /* of cloth100 with SOFT springs; NAN: unknown */
} scaling;

static timing_limits until_scaling_end(const scaling *s, timing_limits p) {
  p.until = s->until;
  return p;
}

/*------------------------------------- one scene ------------------------------------------------*/

/* Prepares a comparison without the matrix, with untimed steps that warm the caches. */
static solver_comparison *make_race(const moving_scene *m, msim_error *err) {
  solver_comparison *r = solver_comparison_create(m, STEP, 1e-6, 0, err);
  if (r) r->warm = 0.02;
  return r;
}

static void enter_all(const scaling *s, solver_comparison *r) {
  const int32_t threads = s->options->threads;
  char why[128];
  solver_comparison_add_step(r, "auto", NULL, 1);
  if (threads > 1) {
    timing_candidate *c = solver_comparison_add_step(r, "auto", NULL, threads);
    snprintf(c->name, sizeof c->name, "auto, %d threads", (int)threads);
  }
  if (reason_to_skip("cholmod", r->moving, STEP, r->system.rtol, &s->plan->limits, why))
    report_left_out(s->report, "step", r->moving, STEP, "cholmod", why);
  else solver_comparison_add_step(r, "cholmod", NULL, 1);
}

/* Measures the time per particle relative to cloth64, by paired timing. */
static void measure_time_growth(scaling *s, const timing_candidate *large, const moving_scene *m) {
  const bench_scene *scene = scene_named("cloth64");
  const timing_limits p = until_scaling_end(s, s->plan->growth);
  timing_candidate pair[2];
  moving_scene small;
  msim_error err;
  solver_comparison *r = NULL;
  if (moving_scene_create(scene, m->k, s->options->threads, s->plan->fall, s->until, &small))
    r = make_race(&small, &err);
  if (r) {
    const timing_candidate *c = solver_comparison_add_step(r, "auto", NULL, 1);
    const double growth = time_pair(large, whole_seconds, c, whole_seconds, &p, pair) *
                          small.view.nparticles / m->view.nparticles;
    report_key(s->report, "time_per_particle_growth_cloth64_to_cloth500", growth);
    if (isfinite(growth))
      printf(" in turn with cloth64: %.3g times the time for a particle\n", growth);
  }
  solver_comparison_free(r);
  moving_scene_free(&small);
}

/* Iterations of the solver in a step; NAN for a direct solver. */
static double iterations_of(const timing_candidate *c) {
  const int64_t iterations =
      c->failed || c->nsamples == 0 ? 0 : c->samples[c->nsamples - 1].iterations;
  return iterations > 0 ? (double)iterations : NAN;
}

static void measure_keys(scaling *s, const solver_comparison *r) {
  const char *scene = r->moving->kind->name;
  if (strcmp(scene, "cloth500") == 0) measure_time_growth(s, &r->all[0], r->moving);
  if (strcmp(scene, "cloth100") != 0) return;
  const double iterations = iterations_of(&r->all[0]);
  if (r->moving->k == SOFT) s->soft_iterations = iterations;
  else report_key(s->report, "iterations_growth_k_to_100k", iterations / s->soft_iterations);
}

static void measure_scaling_scene(scaling *s, const moving_scene *m) {
  const timing_limits p = until_scaling_end(s, s->plan->each);
  msim_error err;
  solver_comparison *r = make_race(m, &err);
  if (!r) {
    report_left_out(s->report, "step", m, STEP, "all", err.text);
    return;
  }
  enter_all(s, r);
  time_in_turn(r->all, r->count, &p);
  if (!is_interrupted()) {
    print_columns();
    report_comparison(s->report, r);
    measure_keys(s, r);
  }
  solver_comparison_free(r);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static int is_scaling_scene(const bench_scene *scene) {
  for (int i = 0; i < SUBJECTS; i++)
    if (strcmp(subjects[i].scene, scene->name) == 0) return 1;
  return 0;
}

int bench_scaling(const bench_options *wishes, report *r) {
  const scaling_plan *plan = wishes->quick ? &plan_quick : &plan_full;
  scaling s = {.options = wishes,
               .plan = plan,
               .report = r,
               .until = clock_seconds() + plan->seconds,
               .soft_iterations = NAN};
  for (int i = 0; i < wishes->nscenes; i++)
    if (!is_scaling_scene(wishes->scenes[i]))
      return report_usage_error("", "scene '%s' is not one of the bench 'scaling'",
                                wishes->scenes[i]->name);
  for (int i = 0; i < SUBJECTS && !is_interrupted(); i++) {
    const struct scaling_case *subject = &subjects[i];
    moving_scene m;
    if (!is_scene_selected(wishes, subject->scene)) continue;
    const int made = moving_scene_create(scene_named(subject->scene), subject->k, wishes->threads,
                                         plan->fall, s.until, &m);
    print_heading(&m, STEP);
    if (made) measure_scaling_scene(&s, &m);
    else if (!is_interrupted()) report_left_out(r, "step", &m, STEP, "all", m.err.text);
    moving_scene_free(&m);
  }
  return 0;
}
