/* precision - benchmark of run time against error: every method at several settings, on scenes that
 * each pose one difficulty, against CVODE and ARKODE on the same forces */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"
#include "benches.h"
#include "precision_cells.h"
#include "precision_report.h"
#include "../bench_reference/reference_program.h"

/* Time limits for one scene, s; in a full run, with --quick. */
static const struct scene_plan {
  double reference, turns, whole;
} plans[] = {{.reference = 16, .turns = 16, .whole = 80},
             {.reference = 1.2, .turns = 0.7, .whole = 5}};

/*------------------------------------- keys of one scene ----------------------------------------*/

/* The largest error over tol, both relative to the extent, over runs by tol whose error is
 * measurable and well above rounding, in scenes that are not chaotic. */
static void report_error_over_tol(const setting_sweep *c, double *over_tol) {
  const double LEAST = 0.9e-8, CHAOTIC = 100;
  const reference_solution *t = c->context.reference;
  const double scale = t->motion / t->extent;
  const sweep_point *worst = NULL;
  for (const sweep_point *r = c->points; r < c->points + c->count; r++) {
    const int counts = r->status == POINT_MEASURED && r->method->by_tol && r->method->integrator;
    if (!counts || r->setting < LEAST || t->growth > CHAOTIC) continue;
    if (!worst || r->errors.error / r->setting > worst->errors.error / worst->setting) worst = r;
  }
  if (!worst) return;
  const double over = scale * worst->errors.error / worst->setting;
  printf(" largest ratio of error to tol: %.3g (%s, tol = %.0e)\n", over, worst->method->name,
         worst->setting);
  *over_tol = fmax(*over_tol, over);
}

static void report_respa_key(const setting_sweep *c, report *out) {
  if (strcmp(c->context.kind->name, "cord") != 0) return;
  const cost respa = cost_at_error(c, precision_methods_find(&c->methods, "respa"), 1e-2);
  const cost verlet =
      cost_at_error(c, precision_methods_find(&c->methods, "velocity-verlet"), 1e-2);
  report_key(out, "respa_over_velocity_verlet", ratio_of_results(respa.seconds, verlet.seconds));
}

enum { SINGLE_KEYS = 3 };
static const double single_errors[SINGLE_KEYS] = {1e-2, 1e-3, 1e-4};

/* The best method in single precision over the best one in double, at these errors; over[]: the
 * largest in the scenes so far, NAN: none */
static void add_single_over_double(const setting_sweep *c, report *out, double over[SINGLE_KEYS]) {
  static const char *const scenes[] = {"trampoline", "folding", "stiff"};
  const char *scene = c->context.kind->name;
  int counts = 0;
  for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++)
    counts |= strcmp(scene, scenes[i]) == 0;
  for (int i = 0; i < SINGLE_KEYS && counts; i++) {
    const precision_method *of_single = fastest_method(c, SINGLE, single_errors[i]),
                           *of_double = fastest_method(c, DOUBLE, single_errors[i]);
    const double ratio = ratio_of_results(cost_at_error(c, of_single, single_errors[i]).seconds,
                                          cost_at_error(c, of_double, single_errors[i]).seconds);
    report_add_row(out, "single",
                   FIELDS(TEXT("scene", scene), REAL("error", single_errors[i]),
                          REAL("ratio", ratio), TEXT("single", of_single ? of_single->name : NULL),
                          TEXT("double", of_double ? of_double->name : NULL)));
    printf(" single over double precision at %.0e: %.3g (%s; %s)\n", single_errors[i], ratio,
           of_single ? of_single->name : "none", of_double ? of_double->name : "none");
    if (!(over[i] >= ratio)) over[i] = ratio;
  }
}

static void report_single_keys(const double over[SINGLE_KEYS], report *out) {
  static const char *const keys[SINGLE_KEYS] = {"single_over_double_1e2", "single_over_double_1e3",
                                                "single_over_double_1e4"};
  for (int i = 0; i < SINGLE_KEYS; i++) report_key(out, keys[i], over[i]);
}

/*------------------------------------- all scenes -----------------------------------------------*/

typedef struct precision_summary {
  cells cells;
  double single[SINGLE_KEYS];
  double over_tol; /* the largest error of msim over tol; NAN: none was measured */
} precision_summary;

static int split_of(const precision_scene *kind) {
  if (kind->impacts) return 0;
  if (kind->stiff > 0) return SPLIT_SPRINGS;
  return kind->damped ? SPLIT_DAMPING : 0;
}

/* Returns 0 if out of memory. */
static int run_sweep(const run_context *a, const struct scene_plan *plan, double until,
                     setting_sweep *c) {
  if (!setting_sweep_run(a, until - plan->turns, c)) return 0;
  for (int i = 0; i < ERROR_LEVELS; i++) unsettle_deciding_runs(c, levels[i]);
  for (int i = 0; i < SINGLE_KEYS; i++) unsettle_deciding_runs(c, single_errors[i]);
  setting_sweep_repeat(c, plan->turns, until);
  return 1;
}

static void measure_precision_scene(const bench_run *b, const precision_scene *kind,
                                    const ode_methods *ode, precision_summary *f) {
  const int quick = b->options->quick;
  const int32_t threads = b->options->threads;
  const struct scene_plan *plan = &plans[quick];
  const double until = clock_seconds() + plan->whole;
  msim_scene *scene = NULL;
  reference_solution t = {.scene = NULL};
  ode_forces k = {.by_runs = 0}, parts = {.stiff_s = NAN, .others_s = NAN, .split_difference = NAN};
  const int split = split_of(kind);
  setting_sweep c = {.count = 0};
  const run_context a = {
      .kind = kind, .reference = &t, .kernel = &k, .parts = &parts, .ode = ode, .threads = threads};
  printf("\n%s: %s\n", kind->name, kind->doc);
  fflush(stdout);
  if (msim_scene_create(NULL, &scene, &t.err) || kind->build(kind->sides[quick], scene, &t.err) ||
      !reference_solution_compute(scene, kind->ends[quick], kind->impacts, kind->damped, threads,
                                  plan->reference, until, &t)) {
    if (!is_interrupted()) report_no_reference(b->report, kind, t.err.text);
  } else if (!ode_forces_create(scene, t.sim, 0, 0, t.end.x, t.end.v, t.limit / 4, &k) ||
             (split && !ode_forces_create(scene, t.sim, split, kind->stiff, t.end.x, t.end.v,
                                          t.limit / 4, &parts)) ||
             !run_sweep(&a, plan, until, &c)) {
    report_no_reference(b->report, kind, "out of memory");
  } else if (!is_interrupted()) {
    report_sweep(b->report, &c);
    cells_add(&c, b->report, &f->cells);
    report_error_over_tol(&c, &f->over_tol);
    report_respa_key(&c, b->report);
    add_single_over_double(&c, b->report, f->single);
  }
  setting_sweep_free(&c);
  ode_forces_free(&k);
  ode_forces_free(&parts);
  reference_solution_free(&t);
  msim_scene_destroy(scene);
}

int bench_precision(bench_run *b) {
  precision_summary f = {.over_tol = NAN, .single = {NAN, NAN, NAN}};
  const precision_scene *kind;
  char reason[256];
  const ode_methods *ode = ode_load(reason);
  if (ode) printf("compared with %s\n", ode->library);
  else printf("SUNDIALS is not compared: %s\n", reason);
  if (ode) put_fields(b->report->machine, FIELDS(TEXT("ode", ode->library)));
  for (int i = 0; (kind = precision_scene_info(i)) != NULL && !is_interrupted(); i++)
    if (is_scene_selected(b->options, kind->name)) measure_precision_scene(b, kind, ode, &f);
  if (is_interrupted()) return 0;
  report_cell_keys(&f.cells, ode != NULL, b->report);
  report_key(b->report, "error_over_tol_worst", f.over_tol);
  report_single_keys(f.single, b->report);
  return 0;
}
