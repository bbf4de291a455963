/* linear - benchmark of one linearly implicit step, from the same folded state, by every solver,
 * against the direct backends alone and libraries with default settings in child processes */
#include "linear.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/interrupt.h"
#include "machine.h"

typedef struct linear_plan {
  const char *scenes[6]; /* in this order */
  int everything;        /* 0: time the main case only (SOFT and MAIN_STEP) */
  int largest_compared;  /* largest side of a cloth in which solvers are compared */
  timing_limits first, others, busy, pairs; /* first: of the main case; pairs: of summary keys */
  /* Consecutive steps of cloths and of jellies in a paired timing: factorizations are never reused
   * in a cloth, but in a jelly, which swings through almost half a period in 48 steps. */
  int series[2];
  int variants;                       /* of a reference program */
  cost_limits limits, stock, compare; /* for timed solvers, SUNDIALS' own PCG, compared solvers */
} linear_plan;

static const linear_plan plans[] = {
    {.scenes = {"cloth32", "cloth64", "cloth100", "jelly16", "cloth200"}, /* expensive ones last */
     .everything = 1,
     .largest_compared = 64,
     .first = {.budget = 30, .min_rounds = 5, .max_rounds = MAX_ROUNDS - 1},
     .others = {.budget = 10, .min_rounds = 3, .max_rounds = MAX_ROUNDS - 1},
     .busy = {.budget = 20, .min_rounds = 5, .max_rounds = MAX_ROUNDS - 1},
     .pairs = {.budget = 16, .min_rounds = 5, .max_rounds = MAX_ROUNDS - 1},
     .series = {8, 48},
     .variants = REFERENCE_VARIANTS,
     .limits = {.flops = 2e9, .products = 40000, .restarted = 1000},
     .stock = {.products = 6000},
     .compare = {.flops = 2e9, .products = 100000, .restarted = 2000}},
    {.scenes = {"cloth100", "cloth32", "cloth64"}, /* the one that most keys need first */
     .largest_compared = 32,
     .first = {.budget = 1, .min_rounds = 1, .max_rounds = 20},
     .pairs = {.budget = 1.5, .min_rounds = 3, .max_rounds = 20},
     .series = {4, 16},
     .busy = {.budget = 3, .min_rounds = 2, .max_rounds = 10},
     .variants = 1,
     .limits = {.flops = 5e8, .products = 4000, .restarted = 400},
     .stock = {.products = 4000},
     .compare = {.flops = 5e8, .products = 100000, .restarted = 1000}},
};

/*------------------------------------- what there is --------------------------------------------*/

static void report_missing(report *r, const char *solver, const char *why) {
  report_add_row(r, "step",
                 FIELDS(TEXT("solver", solver), TEXT("status", "left out"), TEXT("reason", why)));
  printf("%s is skipped: %s\n", solver, why);
}

static void find_solvers(linear_bench *b) {
  msim_plugin_entry entry = {.size = sizeof entry};
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
    put_fields(libraries, FIELDS(TEXT(solver->name, entry.library)));
    msim_solver_backend(solver->name, NULL, &solver->table, &err); /* NULL: built in */
    b->nsolvers++;
  }
  json_object_set_new(b->report->machine, "solvers", libraries);
  machine_add_blas(b->report->machine);
}

static void start_reference(linear_bench *b, const char *library, const char *name,
                            reference_program *child, json_t *libraries) {
  reference_program_start(child, library);
  if (child->pid != 0) put_fields(libraries, FIELDS(TEXT(name, child->hello.library)));
  else report_missing(b->report, name, child->reason);
}

static void find_references(linear_bench *b) {
  json_t *libraries = json_object();
  start_reference(b, "cholmod", "default cholmod", &b->cholmod, libraries);
  start_reference(b, "sundials", "stock sundials", &b->sundials, libraries);
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
    const int factorizes = solver->table && !(solver->table->flags & MSIM_BACKEND_ITERATIVE);
    if (factorizes && is_step) solver_comparison_add_backend(r);
  }
}

/* Sends the system to a child. One that did not start was reported before. */
static int send_system(linear_bench *b, const solver_comparison *r, reference_program *child) {
  if (solver_comparison_send(r, child)) return 1;
  if (!*child->hello.library) return 0;
  report_left_out(b->report, "reference", r->moving, r->system.h, child->hello.library,
                  child->reason);
  return 0;
}

static void add_references(linear_bench *b, solver_comparison *r) {
  char text[128];
  if (send_system(b, r, &b->cholmod)) solver_comparison_add_reference(r, "default", &b->cholmod, 0);
  if (reason_to_skip("stock", r->moving, r->system.h, r->system.rtol, &b->plan->stock, text))
    return;
  if (!send_system(b, r, &b->sundials)) return;
  for (int i = 0; i < b->sundials.hello.nvariants && i < b->plan->variants; i++)
    solver_comparison_add_reference(r, "stock", &b->sundials, i);
}

/* Ratios of medians of pairs, of the fastest candidate of each family. */
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

/* A ratio that is in the summary is timed once more, in pairs. */
static void report_linear_ratio(const linear_bench *b, const solver_comparison *r,
                                const struct ratio *ratio) {
  const timing_candidate *over = fastest_candidate(r->all, r->count, ratio->over);
  const timing_candidate *under = fastest_candidate(r->all, r->count, ratio->under);
  const char *key =
      case_key(b->report, ratio->name, r->moving->kind->name, r->moving->k, r->system.h);
  timing_candidate pair[2];
  if (!over || !under) return;
  const double value =
      key ? time_pair(over, ratio->of_over, under, ratio->of_under, &b->pair_limits, pair)
          : median_ratio(over, ratio->of_over, under, ratio->of_under);
  if (!isfinite(value)) return;
  add_step_row(b->report, "ratio", r->moving, r->system.h,
               FIELDS(TEXT("name", ratio->name), TEXT("over", over->name),
                      TEXT("under", under->name), REAL("ratio", value)));
  printf(" %s %.3g (to %s)\n", ratio->name, value, under->name);
  if (key) report_key(b->report, key, value);
}

static void time_solvers(linear_bench *b, const moving_scene *m, double h, int is_main) {
  msim_error err;
  solver_comparison *r = solver_comparison_create(m, h, 1e-6, 1, &err);
  if (!r) {
    report_left_out(b->report, "step", m, h, "all", err.text);
    return;
  }
  const timing_limits p = limits_until(is_main ? b->plan->first : b->plan->others, b->run->until);
  add_solvers(b, r, &b->plan->limits, "step");
  add_references(b, r);
  time_in_turn(r->all, r->count, &p);
  if (!is_interrupted()) {
    solver_comparison_report(b->report, r, NULL);
    for (size_t i = 0; i < sizeof ratios / sizeof *ratios; i++)
      report_linear_ratio(b, r, &ratios[i]);
  }
  solver_comparison_free(r);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static int is_compared(const linear_bench *b, const bench_scene *scene) {
  return scene->side <= (scene->solid ? 16 : b->plan->largest_compared);
}

static void measure_linear_case(void *bench, moving_scene *m, double h) {
  linear_bench *b = bench;
  const int is_main = m->k == SOFT && h == MAIN_STEP;
  if (b->plan->everything || is_main) time_solvers(b, m, h, is_main);
  if (is_compared(b, m->kind) && !is_interrupted()) {
    struct disagreement_summary *d = &b->disagreement[m->k == STIFF];
    const double found = compare_solvers(b, m, h, &b->plan->compare);
    d->measured += !isnan(found);
    d->largest = fmax(d->largest, found);
  }
  const timing_limits busy = limits_until(b->plan->busy, b->run->until);
  if (is_main && strcmp(m->kind->name, "cloth64") == 0 && !is_interrupted())
    measure_slowdown(b, m, h, &busy);
}

/* With --quick, only what is compared has other cases than the main one. */
static void measure_linear_scene(linear_bench *b, const bench_scene *scene) {
  const int compared = is_compared(b, scene), all = b->plan->everything || compared;
  const double other = all ? 1.0 / 240 : 0;
  const bench_case cases[] = {{scene->name, SOFT, {MAIN_STEP, other}},
                              {scene->name, STIFF, {MAIN_STEP, other}}};
  for (int k = 0; k < 2; k++) b->disagreement[k].expected += 2 * compared;
  measure_cases(b->run, 1 + all, cases, b->run->options->threads, "step", measure_linear_case, b);
}

int bench_linear(bench_run *run) {
  static const char *const keys[] = {"max_disagreement", "max_disagreement_stiff"};
  const bench_options *options = run->options;
  linear_bench b = {.run = run, .report = run->report, .plan = &plans[options->quick]};
  b.pair_limits = limits_until(b.plan->pairs, run->until);
  b.pair_series = b.plan->series;
  background_load_start(&b.load);
  find_references(&b);
  find_solvers(&b);
  measure_paired_keys(&b);
  for (int i = 0; i < options->nscenes; i++)
    measure_linear_scene(&b, scene_named(options->scenes[i]));
  for (int i = 0; !options->nscenes && b.plan->scenes[i]; i++)
    measure_linear_scene(&b, scene_named(b.plan->scenes[i]));
  for (int k = 0; k < 2; k++) {
    const struct disagreement_summary *d = &b.disagreement[k];
    if (d->expected) report_key(run->report, keys[k], d->measured < d->expected ? NAN : d->largest);
  }
  reference_program_stop(&b.cholmod);
  reference_program_stop(&b.sundials);
  background_load_stop(&b.load);
  return 0;
}
