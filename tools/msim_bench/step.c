/* step - one nonlinear step of implicit Euler until its velocity is within 1e-2, 1e-4, 1e-6 of the
 * converged one: msim's Newton method, the same by CHOLMOD, what works with a prefactored matrix,
 * and beside them one factorisation */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/message.h"
#include "benches.h"
#include "interrupt.h"
#include "rows.h"
#include "step_race.h"
#include "step_rows.h"

typedef struct bench_plan {
  double seconds; /* for all */
  double fall;    /* s, of each scene */
  step_plan each;
} bench_plan;

static const bench_plan plan_full = {
    .seconds = 840,
    .fall = 60,
    .each = {.solution = 60,
             .ladder = 30,
             .descent = 10,
             .turns = {.budget = 15, .rounds = 3, .most = 30}},
};
static const bench_plan plan_quick = {
    .seconds = 45,
    .fall = 3,
    .each = {.solution = 3,
             .ladder = 4,
             .is_quick = 1,
             .descent = 0.5,
             .turns = {.budget = 1.2, .rounds = 2, .most = 9}},
};

enum { SOFT = 1000, STIFF = 100000 }; /* N/m */
#define LONG  (1.0 / 60)              /* s */
#define SHORT (1.0 / 240)

/* What the keys need comes before what is dear. */
static const struct subject {
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
  const bench_wishes *wishes;
  const bench_plan *plan;
  report *report;
  double until;       /* on wall_seconds' clock */
  double soft;        /* s, of cloth64 to SUMMARY_ACCURACY; NAN: not known */
  double prefactored; /* the largest of newton_over_prefactored; NAN: none */
  int missed;         /* a cloth that Newton's method did not solve */
} step_bench;

enum { SUMMARY_ACCURACY = 1, LAST = ACCURACIES - 1 };

/*------------------------------------- ratios ---------------------------------------------------*/

typedef struct ratio {
  double value; /* NAN: none */
  int is_bound; /* it is this at most */
} ratio;

/* Of our Newton method's time and another method's. */
static ratio over_method(const step_race *r, int method) {
  const contestant *ours = r->arrived[BY_PCG][SUMMARY_ACCURACY];
  const contestant *other = r->arrived[method][SUMMARY_ACCURACY];
  const pursuit *p = r->pursuits[method];
  if (ours && other) return (ratio){median_ratio(ours, whole_seconds, other, whole_seconds), 0};
  if (ours && p->end == CUT_OFF) return (ratio){median_of(ours, whole_seconds) / p->lasted, 1};
  return (ratio){NAN, 0};
}

static ratio over_prefactored(const step_race *r) {
  const ratio a = over_method(r, BY_PROJECTIVE_DYNAMICS), b = over_method(r, BY_LBFGS);
  return isnan(b.value) || a.value > b.value ? a : b;
}

static ratio over_factor(const step_race *r) {
  const contestant *ours = r->arrived[BY_PCG][LAST];
  if (!ours || !r->factor) return (ratio){NAN, 0};
  return (ratio){median_ratio(ours, whole_seconds, r->factor, factor_seconds), 0};
}

/*------------------------------------- keys -----------------------------------------------------*/

static const struct key {
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

static void report_ratio(step_bench *b, const step_race *r, const char *name, int accuracy,
                         ratio found) {
  const moving *m = r->step.moving;
  if (!isfinite(found.value)) return;
  report_step_ratio(b->report, r, name, accuracy, found.value, found.is_bound);
  for (const struct key *k = keys; k < keys + sizeof keys / sizeof *keys; k++)
    if (strcmp(k->ratio, name) == 0 && strcmp(k->scene, m->kind->name) == 0 && m->k == SOFT &&
        r->step.h == k->h)
      report_key(b->report, k->key, found.value);
}

static int is_cloth(const moving *m) { return !m->kind->solid; }

static void measure_prefactored(step_bench *b, const step_race *r) {
  const ratio found = over_prefactored(r);
  report_ratio(b, r, "newton_over_prefactored", SUMMARY_ACCURACY, found);
  if (is_cloth(r->step.moving)) b->prefactored = fmax(b->prefactored, found.value);
}

static void measure_stiffness(step_bench *b, const step_race *r) {
  const moving *m = r->step.moving;
  const contestant *ours = r->arrived[BY_PCG][SUMMARY_ACCURACY];
  if (!ours || strcmp(m->kind->name, "cloth64") != 0 || r->step.h != LONG) return;
  const double seconds = median_of(ours, whole_seconds);
  if (m->k == SOFT) b->soft = seconds;
  else report_key(b->report, "stiff_over_soft_cloth64", seconds / b->soft);
}

/* Whether Newton's method failed where the keys need it; that cloth200 cannot be solved is a
 * finding. */
static void note_failure(step_bench *b, const moving *m, int failed) {
  b->missed |= failed && is_cloth(m) && strcmp(m->kind->name, "cloth200") != 0;
}

static void report_keys(step_bench *b, const step_race *r) {
  const pursuit *ours = r->pursuits[BY_PCG];
  report_ratio(b, r, "newton_over_tuned_factor", LAST, over_factor(r));
  report_ratio(b, r, "newton_over_newton_cholmod", SUMMARY_ACCURACY, over_method(r, BY_CHOLMOD));
  measure_prefactored(b, r);
  measure_stiffness(b, r);
  note_failure(b, r->step.moving, !r->arrived[BY_PCG][SUMMARY_ACCURACY] && ours->end != LEFT_OUT);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static void measure(step_bench *b, const moving *m, double h) {
  msim_error err;
  if (wall_seconds() > b->until) {
    report_left_out(b->report, "solution", m, h, "all", "there was no time left");
    return;
  }
  step_race *r = step_race_run(m, h, &b->plan->each, b->until, &err);
  if (is_interrupted()) {
    step_race_free(r);
    return;
  }
  if (r) {
    report_step_race(b->report, r);
    report_keys(b, r);
  } else {
    report_unsolved(b->report, m, h, err.text);
    note_failure(b, m, 1);
  }
  step_race_free(r);
}

static void measure_subject(step_bench *b, const struct subject *subject) {
  moving m;
  const int made =
      moving_make(scene_named(subject->scene), subject->k, 1, b->plan->fall, b->until, &m);
  for (int i = 0; i < 2 && subject->steps[i] > 0 && !is_interrupted(); i++) {
    print_heading(&m, subject->steps[i]);
    if (made) nonlinear_settle(&m, subject->steps[i]);
    if (made) measure(b, &m, subject->steps[i]);
    else report_left_out(b->report, "solution", &m, subject->steps[i], "all", m.err.text);
  }
  moving_free(&m);
}

static int is_subject(const bench_scene *scene) {
  for (int i = 0; i < SUBJECTS; i++)
    if (strcmp(subjects[i].scene, scene->name) == 0) return 1;
  return 0;
}

int bench_step(const bench_wishes *wishes, report *r) {
  const bench_plan *plan = wishes->quick ? &plan_quick : &plan_full;
  step_bench b = {.wishes = wishes,
                  .plan = plan,
                  .report = r,
                  .until = wall_seconds() + plan->seconds,
                  .soft = NAN,
                  .prefactored = NAN};
  if (wishes->threads)
    return complain_usage("", "--threads means nothing to the bench 'step', which runs on one");
  for (int i = 0; i < wishes->nscenes; i++)
    if (!is_subject(wishes->scenes[i]))
      return complain_usage("", "scene '%s' is not one of the bench 'step'",
                            wishes->scenes[i]->name);
  for (int i = 0; i < SUBJECTS && !is_interrupted(); i++)
    if (is_wanted(wishes, subjects[i].scene)) measure_subject(&b, &subjects[i]);
  if (!b.missed) report_key(r, "newton_over_prefactored", b.prefactored);
  return 0;
}
