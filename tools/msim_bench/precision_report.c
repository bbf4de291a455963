#include "precision_report.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

static json_t *add_precision_row(report *out, const char *measure, const precision_scene *kind) {
  json_t *row = report_add_row(out, measure);
  put_text(row, "scene", kind->name);
  return row;
}

void print_scene(const precision_scene *kind) {
  printf("\n%s: %s\n", kind->name, kind->doc);
  fflush(stdout);
}

void report_no_truth(report *out, const precision_scene *kind, const char *why) {
  json_t *row = add_precision_row(out, "truth", kind);
  put_text(row, "status", "failed");
  put_text(row, "reason", why);
  printf(" failed: %s\n", why);
}

/*------------------------------------- the scene ------------------------------------------------*/

static void report_truth(report *out, const reference_solution *t) {
  json_t *row = add_precision_row(out, "truth", t->kind);
  put_text(row, "status", "ok");
  put_integer(row, "particles", t->view.nparticles);
  put_integer(row, "springs", t->view.nsprings);
  put_real(row, "t_end", t->t_end);
  put_real(row, "verlet_limit", t->limit);
  put_real(row, "extent", t->extent);
  put_real(row, "motion", t->motion);
  put_real(row, "speed", t->speed);
  put_text(row, "beside", t->comparison_method);
  put_integer(row, "steps", t->steps);
  put_real(row, "error", t->error);
  put_real(row, "growth", t->growth);
  printf(" %d particles, %d springs, %g s; they move %.2g m, Verlet is stable up to %.2g s\n",
         (int)t->view.nparticles, (int)t->view.nsprings, t->t_end, t->motion, t->limit);
  printf(" truth: dop853 beside %s, %" PRId64
         " steps, known to %.1e; a disturbance grows by a factor of %.2g\n",
         t->comparison_method, t->steps, t->error, t->growth);
}

static void report_kernel(report *out, const ode_forces *k) {
  const char *const names[] = {"flat arrays", "a loop of our own"};
  json_t *row = add_precision_row(out, "kernel", k->truth->kind);
  put_text(row, "sundials_gets", names[k->by_runs]);
  put_real(row, "flat_us", 1e6 * k->flat_s);
  put_real(row, "loop_us", 1e6 * k->runs_s);
  put_real(row, "step_us", 1e6 * k->step_s);
  put_real(row, "create_ms", 1e3 * k->create_s);
  put_real(row, "stiff_part_us", 1e6 * k->stiff_s);
  put_real(row, "other_part_us", 1e6 * k->others_s);
  put_real(row, "difference", k->difference);
  put_real(row, "split_difference", k->split_difference);
  printf(" forces: %.3g us through flat arrays, %.3g us by a loop of our own; SUNDIALS gets %s\n",
         1e6 * k->flat_s, 1e6 * k->runs_s, names[k->by_runs]);
  if (k->split.by)
    printf(
        " split in two for MRIStep and IMEX methods: %.3g us the stiff part, %.3g us the others\n",
        1e6 * k->stiff_s, 1e6 * k->others_s);
  printf(" a whole step of Verlet takes %.3g us, making the sim %.2g ms\n", 1e6 * k->step_s,
         1e3 * k->create_s);
}

/*------------------------------------- rungs ----------------------------------------------------*/

static const char *const statuses[] = {
    [POINT_MEASURED] = "ok", [POINT_UNRESOLVED] = "refused", [POINT_FAILED] = "failed"};

/* Whether it is, at some error, within a factor of 1.5 of the best method of its library; only
 * these are plotted. */
static int is_near_best(const setting_sweep *c, const precision_method *who) {
  for (int l = 0; l < ERROR_LEVELS; l++) {
    const precision_method *best = fastest_method(c, who->integrator != NULL, levels[l]);
    if (best &&
        cost_at_error(c, who, levels[l]).seconds <= 1.5 * cost_at_error(c, best, levels[l]).seconds)
      return 1;
  }
  return 0;
}

static void report_rung(report *out, const setting_sweep *c, int i) {
  const sweep_point *r = &c->rungs[i];
  const timing_candidate *run = &c->all[i];
  json_t *row = add_precision_row(out, "rung", c->arena.truth->kind);
  put_text(row, "method", r->method->name);
  put_text(row, "of", r->method->integrator ? "msim" : "sundials");
  put_real(row, r->method->by_tol ? "tol" : "h", r->setting);
  put_text(row, "status", statuses[r->status]);
  if (r->status == POINT_FAILED) put_text(row, "reason", run->reason);
  if (r->status == POINT_UNRESOLVED) put_text(row, "reason", "the truth is not known well enough");
  if (r->status == POINT_FAILED) return;
  json_object_set_new(row, "near_best", json_boolean(is_near_best(c, r->method)));
  put_real(row, "ms", 1e3 * median_of(run, whole_seconds));
  put_real(row, "spread", spread_of(run, whole_seconds));
  put_integer(row, "repeats", run->nsamples > 1 ? run->nsamples - 1 : 1);
  put_integer(row, "evaluations", r->evaluations);
  put_real(row, "error", r->verdict.error);
  put_real(row, "energy_drift", r->verdict.energy);
  put_real(row, "momentum_drift", r->verdict.momentum);
}

/*------------------------------------- methods --------------------------------------------------*/

enum { DRIFT_LEVEL = 1 }; /* drifts and evaluations: at 1e-4, or of the most accurate run */

/* The run whose drifts are printed; NULL: none. */
static const sweep_point *find_typical_point(const setting_sweep *c, const precision_method *who) {
  const sweep_point *best = NULL;
  for (const sweep_point *r = c->rungs; r < c->rungs + c->count; r++) {
    if (r->method != who || r->status == POINT_FAILED) continue;
    if (!best || r->verdict.error < best->verdict.error) best = r;
    if (best->verdict.error <= levels[DRIFT_LEVEL]) break;
  }
  return best;
}

static void print_level_number(const char *format, double value) {
  if (isfinite(value)) printf(format, value);
  else printf(" %8s", "-");
}

/* Why a method has no result: the reason of its last run. */
static const char *last_reason(const setting_sweep *c, const precision_method *who) {
  const char *reason = "there was no time left";
  for (int i = 0; i < c->count; i++)
    if (c->rungs[i].method == who) reason = c->all[i].reason;
  return reason;
}

static void print_precision_method(const setting_sweep *c, const precision_method *who) {
  const sweep_point *r = find_typical_point(c, who);
  printf(" %-28.28s", who->name);
  if (!r) {
    printf(" failed: %s\n", last_reason(c, who));
    return;
  }
  for (int l = 0; l < ERROR_LEVELS; l++)
    print_level_number(" %8.4g", 1e3 * cost_at_error(c, who, levels[l]).seconds);
  print_level_number(" %8.2g", r->verdict.error);
  printf(" %9" PRId64, r->evaluations);
  print_level_number(" %8.1g", r->verdict.energy);
  print_level_number(" %8.1g", r->verdict.momentum);
  putchar('\n');
}

static void report_levels(report *out, const setting_sweep *c, const precision_method *who) {
  for (int l = 0; l < ERROR_LEVELS; l++) {
    const cost found = cost_at_error(c, who, levels[l]);
    if (!isfinite(found.seconds)) continue;
    json_t *row = add_precision_row(out, "level", c->arena.truth->kind);
    put_text(row, "method", who->name);
    put_text(row, "of", who->integrator ? "msim" : "sundials");
    put_real(row, "error", levels[l]);
    put_real(row, "ms", 1e3 * found.seconds);
    put_real(row, "evaluations", found.evaluations);
  }
}

static void print_precision_columns(void) {
  printf(" %-28s", "milliseconds to error");
  for (int l = 0; l < ERROR_LEVELS; l++) printf(" %8.0e", levels[l]);
  printf(" %8s %9s %8s %8s\n", "at error", "evaluat.", "energy", "momentum");
}

void report_climb(report *out, const setting_sweep *c) {
  const precision_methods *list = &c->entrants;
  report_truth(out, c->arena.truth);
  report_kernel(out, c->arena.kernel);
  print_precision_columns();
  for (int i = 0; i < c->count; i++) report_rung(out, c, i);
  for (int i = 0; i < list->count; i++) {
    print_precision_method(c, &list->all[i]);
    report_levels(out, c, &list->all[i]);
  }
  fflush(stdout);
}
