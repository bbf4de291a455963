#include "cases.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/interrupt.h"
#include "background_load.h"

/*------------------------------------- keys -----------------------------------------------------*/

/* Which ratio of which case is in the summary. */
static const struct summary_key {
  const char *bench, *ratio, *scene;
  double k, h;
  const char *key;
  int two_cores; /* it needs them */
} summary_keys[] = {
#define FORCES_KEY(ratio, scene, key, two) \
  { "forces", ratio, scene, SOFT, 0, key, two }
    FORCES_KEY("speedup", "cloth100", "explicit_step_speedup_cloth100", 0),
    FORCES_KEY("fraction of triad", "cloth500", "triad_fraction_cloth500", 0),
    FORCES_KEY("two threads", "cloth500", "two_threads_cloth500", 1),
    FORCES_KEY("speedup", "mesh500", "irregular_speedup", 0),
    FORCES_KEY("single", "cloth100", "single_speedup_cloth100", 0),
    FORCES_KEY("single", "cloth500", "single_speedup_cloth500", 0),
    FORCES_KEY("single", "mesh500", "single_speedup_random", 0),
#define LINEAR_KEY(ratio, scene) \
  { "linear", ratio, scene, SOFT, MAIN_STEP, ratio "_" scene, 0 }
#define SLOWDOWN_KEY(ratio, scene) \
  { "linear", ratio, scene, SOFT, MAIN_STEP, ratio "_when_other_core_busy_" scene, 1 }
    LINEAR_KEY("auto_over_tuned_cholmod", "cloth100"),
    LINEAR_KEY("auto_over_default_cholmod", "cloth100"),
    {"linear", "jacobian_over_force", "cloth100", SOFT, MAIN_STEP, "jacobian_over_force", 0},
    {"linear", "expanded_jacobian_over_force", "cloth100", SOFT, MAIN_STEP,
     "expanded_jacobian_over_force", 0},
    {"linear", "auto_over_tuned_cholmod", "cloth100", STIFF, MAIN_STEP,
     "auto_over_tuned_cholmod_stiff_cloth100", 0},
    LINEAR_KEY("auto_over_tuned_cholmod", "cloth64"),
    LINEAR_KEY("auto_over_tuned_cholmod", "jelly16"),
    LINEAR_KEY("auto_over_tuned_cholmod", "cloth200"),
    LINEAR_KEY("cholmod_step_over_bare", "cloth100"),
    LINEAR_KEY("cholmod_step_over_default", "cloth32"),
    LINEAR_KEY("cholmod_step_over_default", "cloth64"),
    LINEAR_KEY("cholmod_step_over_default", "cloth100"),
    LINEAR_KEY("sundials_pcg_over_stock", "cloth100"),
    LINEAR_KEY("sundials_pcg_over_builtin_per_iteration", "cloth100"),
    SLOWDOWN_KEY("auto_slowdown", "cloth64"),
    SLOWDOWN_KEY("cholmod_slowdown", "cloth64"),
#define STEP_KEY(ratio, scene, h, key) \
  { "step", ratio, scene, SOFT, h, ratio "_" key, 0 }
    STEP_KEY("newton_over_tuned_factor", "cloth32", MAIN_STEP, "cloth32"),
    STEP_KEY("newton_over_tuned_factor", "cloth64", MAIN_STEP, "cloth64"),
    STEP_KEY("newton_over_tuned_factor", "cloth100", 1.0 / 240, "cloth100_h240"),
    STEP_KEY("newton_over_newton_cholmod", "cloth64", MAIN_STEP, "cloth64"),
    STEP_KEY("newton_over_newton_cholmod", "cloth100", MAIN_STEP, "cloth100"),
    {"step", "stiff_over_soft", "cloth64", STIFF, MAIN_STEP, "stiff_over_soft_cloth64", 0},
};
enum { SUMMARY_KEYS = sizeof summary_keys / sizeof *summary_keys };

static int is_key_of(const struct summary_key *s, const report *r, const char *scene, double k,
                     double h) {
  return strcmp(s->bench, r->bench) == 0 && strcmp(s->scene, scene) == 0 && s->k == k && s->h == h;
}

const char *case_key(const report *r, const char *ratio, const char *scene, double k, double h) {
  for (const struct summary_key *s = summary_keys; s < summary_keys + SUMMARY_KEYS; s++)
    if (is_key_of(s, r, scene, k, h) && strcmp(s->ratio, ratio) == 0) return s->key;
  return NULL;
}

void report_case_key(report *r, const char *ratio, const char *scene, double k, double h,
                     double value) {
  const char *key = case_key(r, ratio, scene, k, h);
  if (key) report_key(r, key, value);
}

void init_case_keys(report *r, const char *scene, double k, double h) {
  const int two = usable_cores() > 1;
  for (const struct summary_key *s = summary_keys; s < summary_keys + SUMMARY_KEYS; s++)
    if (is_key_of(s, r, scene, k, h) && (two || !s->two_cores) &&
        !json_object_get(r->summary, s->key))
      report_key(r, s->key, NAN);
}

/*------------------------------------- rows -----------------------------------------------------*/

json_t *add_step_row(report *out, const char *measure, const moving_scene *m, double h,
                     const field *fields) {
  json_t *row =
      report_add_row(out, measure,
                     FIELDS(TEXT("scene", m->kind->name), INTEGER("particles", m->view.nparticles),
                            REAL("t", m->state.t), REAL("k", m->k), REAL("h", h)));
  put_fields(row, fields);
  return row;
}

void report_left_out(report *out, const char *measure, const moving_scene *m, double h,
                     const char *solver, const char *why) {
  add_step_row(out, measure, m, h,
               FIELDS(TEXT("solver", solver), TEXT("status", "left out"), TEXT("reason", why)));
  printf(" %-19s left out: %s\n", solver, why);
}

/*------------------------------------- cases ----------------------------------------------------*/

static void print_heading(const moving_scene *m, double h) {
  printf("\n%s at t = %.2g s, k = %g N/m, h = 1/%.0f s, %d unknowns\n", m->kind->name, m->state.t,
         m->k, 1 / h, (int)m->unknowns);
  fflush(stdout);
}

void measure_cases(const bench_run *b, int count, const bench_case *cases, int32_t threads,
                   const char *measure, case_function *function, void *bench) {
  for (const bench_case *c = cases; c < cases + count && !is_interrupted(); c++) {
    moving_scene m;
    if (!is_scene_selected(b->options, c->scene)) continue;
    const int made =
        moving_scene_create(scene_named(c->scene), c->k, threads, b->fall, b->until, &m);
    for (int i = 0; i < 2 && c->steps[i] > 0 && !is_interrupted(); i++) {
      print_heading(&m, c->steps[i]);
      init_case_keys(b->report, c->scene, c->k, c->steps[i]);
      if (made) function(bench, &m, c->steps[i]);
      else report_left_out(b->report, measure, &m, c->steps[i], "all", m.err.text);
    }
    moving_scene_free(&m);
  }
}
