/* Summary keys of paired timings: two candidates, on one thread each, alternate and make the same
 * series of steps from the same state of a scene in motion. A key is the ratio of the mean times of
 * a step in the series, which include factorizations that are reused within it. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "interrupt.h"
#include "linear.h"
#include "linear_report.h"

#define REFERENCE_NAME "default cholmod"
#define STEP           (1.0 / 60)

typedef struct pair_side {
  const char *name; /* value of option `solver`, or REFERENCE_NAME */
  sample_value *value;
} pair_side;

#define STEP_BY(name) \
  { name, whole_seconds }
#define ASSEMBLY_BY(name) \
  { name, assemble_seconds }
#define FORCE_BY(name) \
  { name, force_seconds }

/* Entries with the same scene and k are adjacent and share a state. */
static const struct timed_pair {
  const char *key, *scene;
  double k;
  pair_side over, under;
} matches[] = {
    {"auto_over_tuned_cholmod_cloth100", "cloth100", 1000, STEP_BY("auto"), STEP_BY("cholmod")},
    {"auto_over_default_cholmod_cloth100", "cloth100", 1000, STEP_BY("auto"),
     STEP_BY(REFERENCE_NAME)},
    {"jacobian_over_force", "cloth100", 1000, ASSEMBLY_BY("pcg"), FORCE_BY("pcg")},
    {"expanded_jacobian_over_force", "cloth100", 1000, ASSEMBLY_BY("cholmod"), FORCE_BY("cholmod")},
    {"auto_over_tuned_cholmod_stiff_cloth100", "cloth100", 1e5, STEP_BY("auto"),
     STEP_BY("cholmod")},
    {"auto_over_tuned_cholmod_cloth64", "cloth64", 1000, STEP_BY("auto"), STEP_BY("cholmod")},
    {"auto_over_tuned_cholmod_jelly16", "jelly16", 1000, STEP_BY("auto"), STEP_BY("cholmod")},
    {"auto_over_tuned_cholmod_cloth200", "cloth200", 1000, STEP_BY("auto"), STEP_BY("cholmod")},
};
enum { TIMED_PAIRS = sizeof matches / sizeof *matches };

/* Factorizations are never reused in a cloth, but in a jelly, which swings through almost half a
 * period in 0.8 s. */
enum { CLOTH_SERIES = 8, JELLY_SERIES = 48 };

static int share_state(const struct timed_pair *a, const struct timed_pair *b) {
  return strcmp(a->scene, b->scene) == 0 && a->k == b->k;
}

/*------------------------------------- one match ------------------------------------------------*/

static timing_candidate *add_pair_side(linear_bench *b, solver_comparison *r, const char *name) {
  for (int i = 0; i < r->count; i++)
    if (strcmp(r->all[i].name, name) == 0) return &r->all[i];
  if (strcmp(name, REFERENCE_NAME) != 0) return solver_comparison_add_step(r, name, NULL, 1);
  return reference_program_send_system(&b->cholmod, &r->system)
             ? solver_comparison_add_reference(r, "default", &b->cholmod, 0)
             : NULL;
}

static void put_pair_side(json_t *row, const char *role, const timing_candidate *c,
                          sample_value *value) {
  const struct timed_step *step = solver_comparison_step(c);
  msim_plan plan = {.size = sizeof plan};
  char key[32];
  put_text(row, role, c->name);
  snprintf(key, sizeof key, "%s_ms", role);
  put_real(row, key, 1e3 * median_of(c, value));
  if (!step || !step->sim) return;
  if (value == whole_seconds && c->nsamples > 0) {
    snprintf(key, sizeof key, "%s_median_ms", role);
    put_real(row, key, 1e3 * median_of(c, median_seconds));
    snprintf(key, sizeof key, "%s_least_kinetic", role);
    put_real(row, key, median_of(c, kinetic_energy));
  }
  msim_sim_plan(step->sim, &plan);
  snprintf(key, sizeof key, "%s_ran", role);
  put_text(row, key, plan.solver);
}

static const char *reason_of_failure(const timing_candidate pair[2]) {
  for (int i = 0; i < 2; i++)
    if (pair[i].failed) return pair[i].reason;
  return "there was no time left";
}

static void time_timed_pair(linear_bench *b, solver_comparison *r, const struct timed_pair *match,
                            const timing_limits *p) {
  timing_candidate *over = add_pair_side(b, r, match->over.name),
                   *under = add_pair_side(b, r, match->under.name);
  timing_candidate pair[2];
  if (!over || !under) return;
  const double ratio = time_pair(over, match->over.value, under, match->under.value, p, pair);
  if (is_interrupted()) return;
  json_t *row = add_step_row(b->report, "duel", r->moving, r->system.h);
  put_text(row, "name", match->key);
  put_pair_side(row, "over", &pair[0], match->over.value);
  put_pair_side(row, "under", &pair[1], match->under.value);
  put_integer(row, "repeats", pair[0].nsamples > 1 ? pair[0].nsamples - 1 : pair[0].nsamples);
  put_integer(row, "series", r->series);
  put_real(row, "ratio", ratio);
  if (isfinite(ratio)) {
    report_key(b->report, match->key, ratio);
    printf(" %-40s %.3g: %.3g ms over %.3g ms\n", match->key, ratio,
           1e3 * median_of(&pair[0], match->over.value),
           1e3 * median_of(&pair[1], match->under.value));
  } else {
    put_text(row, "reason", reason_of_failure(pair));
    printf(" %-40s left out: %s\n", match->key, reason_of_failure(pair));
  }
  fflush(stdout);
}

/*------------------------------------- all ------------------------------------------------------*/

/* Matches that share a state. */
static void time_all_pairs(linear_bench *b, const moving_scene *m, const struct timed_pair *first,
                           int count, const timing_limits *p) {
  msim_error err;
  solver_comparison *r = solver_comparison_create(m, STEP, 1e-6, 1, &err);
  if (!r) {
    report_left_out(b->report, "duel", m, STEP, "all", err.text);
    return;
  }
  r->series = m->kind->solid ? JELLY_SERIES : CLOTH_SERIES;
  r->until = p->until;
  for (int i = 0; i < count && !is_interrupted(); i++) time_timed_pair(b, r, &first[i], p);
  solver_comparison_free(r);
}

void measure_paired_keys(linear_bench *b, double seconds, const timing_limits *p) {
  int count;
  for (int i = 0; i < TIMED_PAIRS && !is_interrupted(); i += count) {
    const struct timed_pair *first = &matches[i];
    moving_scene m;
    for (count = 1; i + count < TIMED_PAIRS && share_state(first, first + count);) count++;
    if (!is_scene_selected(b->options, first->scene)) continue;
    for (int k = 0; k < count; k++) report_key(b->report, first[k].key, NAN); /* no result yet */
    const bench_scene *scene = scene_named(first->scene);
    const int made =
        moving_scene_create(scene, first->k, b->options->threads, seconds, b->until, &m);
    print_heading(&m, STEP);
    if (made) time_all_pairs(b, &m, first, count, p);
    else if (!is_interrupted()) report_left_out(b->report, "duel", &m, STEP, "all", m.err.text);
    moving_scene_free(&m);
  }
}
