/* precision - benchmark of run time against error: every method at several settings, on scenes that
 * each pose one difficulty, against CVODE and ARKODE on the same forces */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/message.h"
#include "benches.h"
#include "interrupt.h"
#include "precision_cells.h"
#include "precision_report.h"
#include "reference_program.h"

/* Time limits for one scene, s. */
typedef struct scene_plan {
  double truth, turns, whole;
} scene_plan;

static const scene_plan plan_full = {.truth = 20, .turns = 20, .whole = 98};
static const scene_plan plan_quick = {.truth = 1.2, .turns = 1, .whole = 6};

/*------------------------------------- keys of one scene ----------------------------------------*/

/* The largest error over tol, both relative to the extent, over runs by tol whose error is
 * measurable and well above rounding, in scenes that are not chaotic. */
static void report_error_over_tol(const setting_sweep *c, double *over_tol) {
  const double LEAST = 0.9e-8, CHAOTIC = 100;
  const reference_solution *t = c->arena.truth;
  const double scale = t->motion / t->extent;
  const sweep_point *worst = NULL;
  for (const sweep_point *r = c->rungs; r < c->rungs + c->count; r++) {
    const int counts = r->status == POINT_MEASURED && r->method->by_tol && r->method->integrator;
    if (!counts || r->setting < LEAST || t->growth > CHAOTIC) continue;
    if (!worst || r->verdict.error / r->setting > worst->verdict.error / worst->setting) worst = r;
  }
  if (!worst) return;
  const double over = scale * worst->verdict.error / worst->setting;
  printf(" largest error over tol: %.3g, %s at %.0e\n", over, worst->method->name, worst->setting);
  *over_tol = fmax(*over_tol, over);
}

static void report_respa_key(const setting_sweep *c, report *out) {
  if (strcmp(c->arena.truth->kind->name, "cord") != 0) return;
  const cost respa = cost_at_error(c, precision_methods_find(&c->entrants, "respa"), 1e-2);
  const cost verlet =
      cost_at_error(c, precision_methods_find(&c->entrants, "velocity-verlet"), 1e-2);
  report_key(out, "respa_over_velocity_verlet", ratio_of_results(respa.seconds, verlet.seconds));
}

/*------------------------------------- all scenes -----------------------------------------------*/

typedef struct precision_summary {
  cells cells;
  double over_tol; /* the largest error of msim over tol; NAN: none was measured */
} precision_summary;

static void measure_precision_scene(const bench_options *wishes, const precision_scene *kind,
                                    const ode_methods *ode, report *out, precision_summary *f) {
  const scene_plan *plan = wishes->quick ? &plan_quick : &plan_full;
  const double until = clock_seconds() + plan->whole;
  const sweep_limits limits = {.repeat_seconds = plan->turns, .until = until};
  reference_solution t;
  ode_forces k = {.by_runs = 0};
  setting_sweep c = {.count = 0};
  const run_context a = {.truth = &t, .kernel = &k, .ode = ode, .threads = wishes->threads};
  print_scene(kind);
  if (!reference_solution_compute(kind, wishes->quick, wishes->threads, plan->truth, until, &t)) {
    if (!is_interrupted()) report_no_truth(out, kind, t.err.text);
  } else if (!ode_forces_create(&t, &k) || !setting_sweep_run(&a, &limits, &c)) {
    report_no_truth(out, kind, "out of memory");
  } else if (!is_interrupted()) {
    report_climb(out, &c);
    cells_add(&c, out, &f->cells);
    report_error_over_tol(&c, &f->over_tol);
    report_respa_key(&c, out);
  }
  setting_sweep_free(&c);
  ode_forces_free(&k);
  reference_solution_free(&t);
}

int bench_precision(const bench_options *wishes, report *r) {
  precision_summary f = {.over_tol = NAN};
  const precision_scene *kind;
  char reason[256];
  if (wishes->nscenes)
    return report_usage_error(
        "", "--scene is not for the bench 'precision', which has scenes of its own");
  const ode_methods *ode = ode_load(reason);
  if (ode) printf("beside %s\n", ode->library);
  else printf("without SUNDIALS: %s\n", reason);
  if (ode) json_object_set_new(r->machine, "ode", json_string(ode->library));
  for (int i = 0; (kind = precision_scene_info(i)) != NULL && !is_interrupted(); i++)
    measure_precision_scene(wishes, kind, ode, r, &f);
  if (is_interrupted()) return 0;
  report_cell_keys(&f.cells, ode != NULL, r);
  report_key(r, "error_over_tol_worst", f.over_tol);
  return 0;
}
