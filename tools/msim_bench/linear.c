/* linear - benchmark of one linearly implicit step, from the same folded state, by every solver,
 * against the direct backends alone and libraries with default settings in child processes */
#include "linear.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "interrupt.h"
#include "machine.h"
#include "linear_report.h"

typedef struct linear_plan {
  const char *const *scenes;         /* in this order */
  int everything;                    /* 0: time the main case only (MAIN_K and MAIN_H) */
  double seconds;                    /* s, limit for all scenes */
  double fall;                       /* s, limit for advancing a scene */
  int largest_compared;              /* largest side of a cloth in which solvers are compared */
  timing_limits first, others, busy; /* first: of the main case */
  timing_limits duel;                /* of the paired timing for a summary key */
  int variants;                      /* of a reference program */
  cost_limits limits, stock,
      compare; /* limits for timed solvers, SUNDIALS' own PCG, compared solvers */
} linear_plan;

/* expensive scenes last */
static const char *const all_scenes[] = {"cloth32", "cloth64",  "cloth100",
                                         "jelly16", "cloth200", NULL};
/* the scene that most keys need first */
static const char *const quick_scenes[] = {"cloth100", "cloth32", "cloth64", NULL};

static const linear_plan plan_full = {
    .scenes = all_scenes,
    .everything = 1,
    .seconds = 840,
    .fall = 60,
    .largest_compared = 64,
    .first = {.budget = 30, .min_rounds = 5, .max_rounds = MAX_ROUNDS - 1},
    .others = {.budget = 10, .min_rounds = 3, .max_rounds = MAX_ROUNDS - 1},
    .busy = {.budget = 20, .min_rounds = 5, .max_rounds = MAX_ROUNDS - 1},
    .duel = {.budget = 16, .min_rounds = 5, .max_rounds = MAX_ROUNDS - 1},
    .variants = REFERENCE_VARIANTS,
    .limits = {.flops = 2e9, .products = 40000, .restarted = 1000},
    .stock = {.products = 6000},
    .compare = {.flops = 2e9, .products = 100000, .restarted = 2000},
};
static const linear_plan plan_quick = {
    .scenes = quick_scenes,
    .seconds = 54,
    .fall = 3,
    .largest_compared = 32,
    .first = {.budget = 1, .min_rounds = 1, .max_rounds = 20},
    .duel = {.budget = 1.5, .min_rounds = 3, .max_rounds = 20},
    .busy = {.budget = 3, .min_rounds = 2, .max_rounds = 10},
    .variants = 1,
    .limits = {.flops = 5e8, .products = 4000, .restarted = 400},
    .stock = {.products = 4000},
    .compare = {.flops = 5e8, .products = 100000, .restarted = 1000},
};

static const double stiffnesses[] = {1000, 100000}, steps[] = {1.0 / 60, 1.0 / 240};
enum { MAIN_K, STIFF_K, NK, MAIN_H = 0, NH = 2 }; /* the summary uses MAIN_K, MAIN_H */

/*------------------------------------- what there is --------------------------------------------*/

static void report_missing(report *r, const char *solver, const char *why) {
  json_t *row = report_add_row(r, "step");
  put_text(row, "solver", solver);
  put_text(row, "status", "left out");
  put_text(row, "reason", why);
  printf("%s is left out: %s\n", solver, why);
}

static void find_solvers(linear_bench *b) {
  msim_plugin_entry entry;
  msim_error err;
  json_t *libraries = json_object();
  for (int32_t i = 0; msim_solver_info(i, NULL, &entry, &err); i++) {
    struct bench_solver *solver = &b->solvers[b->nsolvers];
    if (b->nsolvers == MOST_STEPS) continue;
    if (!entry.available) {
      report_missing(b->report, entry.name, entry.note);
      continue;
    }
    *solver = (struct bench_solver){.table = NULL};
    snprintf(solver->name, sizeof solver->name, "%s", entry.name);
    put_text(libraries, entry.name, entry.library);
    msim_solver_backend(solver->name, NULL, &solver->table, &err); /* NULL: built in */
    b->nsolvers++;
  }
  json_object_set_new(b->report->machine, "solvers", libraries);
  machine_add_blas(b->report->machine);
}

static void find_references(linear_bench *b) {
  json_t *libraries = json_object();
  reference_program_start(&b->cholmod, "cholmod");
  reference_program_start(&b->sundials, "sundials");
  const struct {
    const char *name;
    const reference_program *reference;
  } all[] = {{"default cholmod", &b->cholmod}, {"stock sundials", &b->sundials}};
  for (int i = 0; i < 2; i++) {
    if (all[i].reference->pid != 0)
      put_text(libraries, all[i].name, all[i].reference->hello.library);
    else report_missing(b->report, all[i].name, all[i].reference->reason);
  }
  json_object_set_new(b->report->machine, "references", libraries);
}

/*------------------------------------- times ----------------------------------------------------*/

void add_solvers(const linear_bench *b, solver_comparison *r, const cost_limits *t,
                 const char *measure) {
  const int is_step = strcmp(measure, "step") == 0;
  for (int i = 0; i < b->nsolvers; i++) {
    const struct bench_solver *solver = &b->solvers[i];
    char text[128];
    if (strcmp(solver->name, "auto") == 0 && !is_step) continue; /* it selects one of the others */
    const char *why = reason_to_skip(solver->name, r->moving, r->system.h, r->system.rtol, t, text);
    if (why) {
      report_left_out(b->report, measure, r->moving, r->system.h, solver->name, why);
      continue;
    }
    solver_comparison_add_step(r, solver->name, solver->table, r->moving->threads);
    const int factorises = solver->table && !(solver->table->flags & MSIM_BACKEND_ITERATIVE);
    if (factorises && is_step) solver_comparison_add_backend(r);
  }
}

/* Sends the system to a child. One that did not start was reported before. */
static int send_system(linear_bench *b, const solver_comparison *r, reference_program *child) {
  if (reference_program_send_system(child, &r->system)) return 1;
  if (!*child->hello.library) return 0;
  report_left_out(b->report, "reference", r->moving, r->system.h, child->hello.library,
                  child->reason);
  return 0;
}

static void enter_references(linear_bench *b, solver_comparison *r) {
  char text[128];
  if (send_system(b, r, &b->cholmod)) solver_comparison_add_reference(r, "default", &b->cholmod, 0);
  if (reason_to_skip("stock", r->moving, r->system.h, r->system.rtol, &b->plan->stock, text))
    return;
  if (!send_system(b, r, &b->sundials)) return;
  for (int i = 0; i < b->sundials.hello.nvariants && i < b->plan->variants; i++)
    solver_comparison_add_reference(r, "stock", &b->sundials, i);
}

/* Ratios of medians of pairs; NAME_SCENE is a summary key if is_key lists it. */
static const struct ratio {
  const char *name, *over;
  sample_value *of_over;
  const char *under;
  sample_value *of_under;
} ratios[] = {
    {"cholmod_step_over_bare", "cholmod", whole_seconds, "cholmod, bare", whole_seconds},
    {"cholmod_step_over_default", "cholmod", whole_seconds, "default", whole_seconds},
    {"sundials_pcg_over_stock", "sundials-pcg", linear_seconds, "stock", linear_seconds},
    {"sundials_pcg_over_builtin_per_iteration", "sundials-pcg", solve_per_iteration, "pcg",
     solve_per_iteration},
};

static int is_key(const char *name) {
  static const char *const keys[] = {
      "cholmod_step_over_bare_cloth100",   "cholmod_step_over_default_cloth32",
      "cholmod_step_over_default_cloth64", "cholmod_step_over_default_cloth100",
      "sundials_pcg_over_stock_cloth100",  "sundials_pcg_over_builtin_per_iteration_cloth100"};
  for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
    if (strcmp(keys[i], name) == 0) return 1;
  return 0;
}

/* Limits that end with the time for the whole benchmark. */
static timing_limits until_linear_end(const linear_bench *b, timing_limits p) {
  p.until = b->until;
  return p;
}

static void report_linear_ratio(const linear_bench *b, const solver_comparison *r,
                                const struct ratio *ratio, int is_main) {
  report *out = b->report;
  const timing_candidate *over = fastest_candidate(r->all, r->count, ratio->over);
  const timing_candidate *under = fastest_candidate(r->all, r->count, ratio->under);
  if (!over || !under) return;
  char key[80];
  snprintf(key, sizeof key, "%s_%s", ratio->name, r->moving->kind->name);
  const int is_reported = is_main && is_key(key);
  const timing_limits p = until_linear_end(b, b->plan->duel);
  timing_candidate pair[2];
  const double value = is_reported
                           ? time_pair(over, ratio->of_over, under, ratio->of_under, &p, pair)
                           : median_ratio(over, ratio->of_over, under, ratio->of_under);
  if (!isfinite(value)) return;
  json_t *row = add_step_row(out, "ratio", r->moving, r->system.h);
  put_text(row, "name", ratio->name);
  put_text(row, "over", over->name);
  put_text(row, "under", under->name);
  put_real(row, "ratio", value);
  printf(" %s %.3g (to %s)\n", ratio->name, value, under->name);
  if (is_reported) report_key(out, key, value);
}

static void time_solvers(linear_bench *b, const moving_scene *m, double h, int is_main) {
  msim_error err;
  solver_comparison *r = solver_comparison_create(m, h, 1e-6, 1, &err);
  if (!r) {
    report_left_out(b->report, "step", m, h, "all", err.text);
    return;
  }
  const timing_limits p = until_linear_end(b, is_main ? b->plan->first : b->plan->others);
  add_solvers(b, r, &b->plan->limits, "step");
  enter_references(b, r);
  time_in_turn(r->all, r->count, &p);
  if (!is_interrupted()) {
    print_columns();
    report_comparison(b->report, r);
    for (size_t i = 0; i < sizeof ratios / sizeof *ratios; i++)
      report_linear_ratio(b, r, &ratios[i], is_main);
  }
  solver_comparison_free(r);
}

/*------------------------------------- all scenes -----------------------------------------------*/

/* The largest disagreement for each k; missed: some were not measured. */
typedef struct disagreement_summary {
  double largest[NK];
  int missed[NK], compared[NK]; /* some scenes were to be compared */
} disagreement_summary;

static int is_compared(const linear_bench *b, const bench_scene *scene) {
  return scene->side <= (scene->solid ? 16 : b->plan->largest_compared);
}

static void record_disagreement(linear_bench *b, const moving_scene *m, int k, double h,
                                disagreement_summary *w) {
  const double found = compare_solvers(b, m, h, &b->plan->compare);
  w->missed[k] |= isnan(found);
  w->largest[k] = fmax(w->largest[k], found);
}

/* Whether steps of this scene are also timed with the other cores busy. */
static int is_slowed_down(const linear_bench *b, const bench_scene *scene) {
  return strcmp(scene->name, "cloth64") == 0 && b->spinner.count > 0;
}

static void measure_moving(linear_bench *b, const moving_scene *m, int k, disagreement_summary *w) {
  for (int i = 0; i < NH && !is_interrupted(); i++) {
    const int is_main = k == MAIN_K && i == MAIN_H;
    const int timed = b->plan->everything || is_main, compared = is_compared(b, m->kind);
    if (timed || compared) print_heading(m, steps[i]);
    if (timed) time_solvers(b, m, steps[i], is_main);
    if (compared && !is_interrupted()) record_disagreement(b, m, k, steps[i], w);
  }
  if (k != MAIN_K || !is_slowed_down(b, m->kind) || is_interrupted()) return;
  const timing_limits p = until_linear_end(b, b->plan->busy);
  measure_slowdown(b, m, steps[MAIN_H], &p);
}

/* Initializes the keys of a scene to "no result". */
static void init_linear_keys(const linear_bench *b, const bench_scene *scene,
                             disagreement_summary *w) {
  report *r = b->report;
  char key[80];
  for (int k = 0; k < NK; k++) w->compared[k] |= is_compared(b, scene);
  if (is_slowed_down(b, scene)) init_slowdown_keys(r, scene);
  for (size_t i = 0; i < sizeof ratios / sizeof *ratios; i++) {
    snprintf(key, sizeof key, "%s_%s", ratios[i].name, scene->name);
    if (is_key(key)) report_key(r, key, NAN);
  }
}

static void measure_linear_scene(linear_bench *b, const bench_scene *scene,
                                 disagreement_summary *w) {
  init_linear_keys(b, scene, w);
  for (int k = 0; k < NK && !is_interrupted(); k++) {
    moving_scene m;
    if (!b->plan->everything && k != MAIN_K && !is_compared(b, scene)) continue;
    if (moving_scene_create(scene, stiffnesses[k], b->options->threads, b->plan->fall, b->until,
                            &m)) {
      measure_moving(b, &m, k, w);
    } else if (!is_interrupted()) {
      w->missed[k] |= is_compared(b, scene);
      print_heading(&m, steps[MAIN_H]);
      report_left_out(b->report, "step", &m, steps[MAIN_H], "all", m.err.text);
    }
    moving_scene_free(&m);
  }
}

static void measure_all(linear_bench *b) {
  static const char *const keys[NK] = {"max_disagreement", "max_disagreement_stiff"};
  const bench_options *wishes = b->options;
  disagreement_summary w = {{0}, {0}, {0}};
  for (int i = 0; i < wishes->nscenes; i++) measure_linear_scene(b, wishes->scenes[i], &w);
  for (int i = 0; !wishes->nscenes && b->plan->scenes[i]; i++)
    measure_linear_scene(b, scene_named(b->plan->scenes[i]), &w);
  for (int k = 0; k < NK; k++)
    if (w.compared[k]) report_key(b->report, keys[k], w.missed[k] ? NAN : w.largest[k]);
}

int bench_linear(const bench_options *wishes, report *r) {
  linear_bench b = {
      .options = wishes, .report = r, .plan = wishes->quick ? &plan_quick : &plan_full};
  b.until = clock_seconds() + b.plan->seconds;
  background_load_start(&b.spinner);
  find_references(&b);
  find_solvers(&b);
  const timing_limits p = until_linear_end(&b, b.plan->duel);
  measure_paired_keys(&b, b.plan->fall, &p);
  measure_all(&b);
  reference_program_stop(&b.cholmod);
  reference_program_stop(&b.sundials);
  background_load_stop(&b.spinner);
  return 0;
}
