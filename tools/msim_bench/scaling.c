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
#include "rows.h"
#include "rules.h"

#define STEP (1.0 / 60)
enum { SOFT = 1000, STIFF = 100000 }; /* N/m */

typedef struct scaling_plan {
  double seconds; /* s, limit for all scenes */
  double fall;    /* s, limit for advancing a scene */
  patience each, growth;
  thrift thrift;
} scaling_plan;

static const scaling_plan plan_full = {
    .seconds = 840,
    .fall = 60,
    .each = {.budget = 20, .rounds = 3, .most = 15},
    .growth = {.budget = 40, .rounds = 5, .most = 15},
    .thrift = {.dense = 6e11},
};
static const scaling_plan plan_quick = {
    .seconds = 46,
    .fall = 3,
    .each = {.budget = 1, .rounds = 3, .most = 5},
    .growth = {.budget = 6, .rounds = 2, .most = 3},
    .thrift = {.dense = 6e9},
};

/* Scenes that the keys need come first, expensive ones last. */
static const struct subject {
  const char *scene;
  double k;
} subjects[] = {
    {"cloth32", SOFT},  {"cloth64", SOFT}, {"cloth100", SOFT}, {"cloth100", STIFF},
    {"cloth500", SOFT}, {"jelly8", SOFT},  {"jelly16", SOFT},  {"cloth200", SOFT},
    {"jelly24", SOFT},  {"jelly32", SOFT}, {"jelly46", SOFT},  {"cloth316", SOFT},
};
enum { SUBJECTS = sizeof subjects / sizeof *subjects };

typedef struct scaling {
  const bench_wishes *wishes;
  const scaling_plan *plan;
  report *report;
  double until;           /* on wall_seconds' clock */
  double soft_iterations; /* of cloth100 with SOFT springs; NAN: unknown */
} scaling;

static patience limited(const scaling *s, patience p) {
  p.until = s->until;
  return p;
}

/*------------------------------------- one scene ------------------------------------------------*/

/* Prepares a comparison without the matrix, with untimed steps that warm the caches. */
static race *make_race(const moving *m, msim_error *err) {
  race *r = race_new(m, STEP, 1e-6, 0, err);
  if (r) r->warm = 0.02;
  return r;
}

static void enter_all(const scaling *s, race *r) {
  const int32_t threads = s->wishes->threads;
  char why[128];
  race_add_step(r, "auto", NULL, 1);
  if (threads > 1) {
    contestant *c = race_add_step(r, "auto", NULL, threads);
    snprintf(c->name, sizeof c->name, "auto, %d threads", (int)threads);
  }
  if (leave_out("cholmod", r->moving, STEP, r->system.rtol, &s->plan->thrift, why))
    report_left_out(s->report, "step", r->moving, STEP, "cholmod", why);
  else race_add_step(r, "cholmod", NULL, 1);
}

/* Measures the time per particle relative to cloth64, by paired timing. */
static void measure_growth(scaling *s, const contestant *large, const moving *m) {
  const bench_scene *scene = scene_named("cloth64");
  const patience p = limited(s, s->plan->growth);
  contestant pair[2];
  moving small;
  msim_error err;
  race *r = NULL;
  if (moving_make(scene, m->k, s->wishes->threads, s->plan->fall, s->until, &small))
    r = make_race(&small, &err);
  if (r) {
    const contestant *c = race_add_step(r, "auto", NULL, 1);
    const double growth = duel(large, whole_seconds, c, whole_seconds, &p, pair) *
                          small.view.nparticles / m->view.nparticles;
    report_key(s->report, "time_per_particle_growth_cloth64_to_cloth500", growth);
    if (isfinite(growth))
      printf(" in turn with cloth64: %.3g times the time for a particle\n", growth);
  }
  race_free(r);
  moving_free(&small);
}

/* Iterations of the solver in a step; NAN for a direct solver. */
static double iterations_of(const contestant *c) {
  const int64_t iterations = c->failed || c->n == 0 ? 0 : c->samples[c->n - 1].iterations;
  return iterations > 0 ? (double)iterations : NAN;
}

static void measure_keys(scaling *s, const race *r) {
  const char *scene = r->moving->kind->name;
  if (strcmp(scene, "cloth500") == 0) measure_growth(s, &r->all[0], r->moving);
  if (strcmp(scene, "cloth100") != 0) return;
  const double iterations = iterations_of(&r->all[0]);
  if (r->moving->k == SOFT) s->soft_iterations = iterations;
  else report_key(s->report, "iterations_growth_k_to_100k", iterations / s->soft_iterations);
}

static void measure(scaling *s, const moving *m) {
  const patience p = limited(s, s->plan->each);
  msim_error err;
  race *r = make_race(m, &err);
  if (!r) {
    report_left_out(s->report, "step", m, STEP, "all", err.text);
    return;
  }
  enter_all(s, r);
  contest(r->all, r->count, &p);
  if (!is_interrupted()) {
    print_columns();
    report_race(s->report, r);
    measure_keys(s, r);
  }
  race_free(r);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static int is_subject(const bench_scene *scene) {
  for (int i = 0; i < SUBJECTS; i++)
    if (strcmp(subjects[i].scene, scene->name) == 0) return 1;
  return 0;
}

int bench_scaling(const bench_wishes *wishes, report *r) {
  const scaling_plan *plan = wishes->quick ? &plan_quick : &plan_full;
  scaling s = {.wishes = wishes,
               .plan = plan,
               .report = r,
               .until = wall_seconds() + plan->seconds,
               .soft_iterations = NAN};
  for (int i = 0; i < wishes->nscenes; i++)
    if (!is_subject(wishes->scenes[i]))
      return complain_usage("", "scene '%s' is not one of the bench 'scaling'",
                            wishes->scenes[i]->name);
  for (int i = 0; i < SUBJECTS && !is_interrupted(); i++) {
    const struct subject *subject = &subjects[i];
    moving m;
    if (!is_wanted(wishes, subject->scene)) continue;
    const int made = moving_make(scene_named(subject->scene), subject->k, wishes->threads,
                                 plan->fall, s.until, &m);
    print_heading(&m, STEP);
    if (made) measure(&s, &m);
    else if (!is_interrupted()) report_left_out(r, "step", &m, STEP, "all", m.err.text);
    moving_free(&m);
  }
  return 0;
}
