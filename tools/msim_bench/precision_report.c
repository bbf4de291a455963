#include "precision_report.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

void report_no_reference(report *out, const precision_scene *kind, const char *why) {
  report_add_row(out, "truth",
                 FIELDS(TEXT("scene", kind->name), TEXT("status", "failed"), TEXT("reason", why)));
  printf(" failed: %s\n", why);
}

/*------------------------------------- the scene ------------------------------------------------*/

static void report_reference(report *out, const char *scene, const reference_solution *t) {
  report_add_row(
      out, "truth",
      FIELDS(TEXT("scene", scene), TEXT("status", "ok"), INTEGER("particles", t->view.nparticles),
             INTEGER("springs", t->view.nsprings), REAL("t_end", t->t_end),
             REAL("verlet_limit", t->limit), REAL("extent", t->extent), REAL("motion", t->motion),
             REAL("speed", t->speed), TEXT("beside", t->comparison_method),
             INTEGER("steps", t->steps), REAL("error", t->error), REAL("growth", t->growth)));
  printf(
      " %d particles, %d springs, t_end = %g s; motion %.2g m, stability limit of Verlet %.2g s\n",
      (int)t->view.nparticles, (int)t->view.nsprings, t->t_end, t->motion, t->limit);
  printf(" reference solution: dop853 compared with %s, %" PRId64
         " steps, estimated error %.1e; growth of disturbances %.2g\n",
         t->comparison_method, t->steps, t->error, t->growth);
}

static void report_forces(report *out, const char *scene, const ode_forces *k,
                          const ode_forces *parts) {
  const char *const used = k->by_runs ? "component arrays" : "flat arrays";
  report_add_row(
      out, "kernel",
      FIELDS(TEXT("scene", scene), TEXT("sundials_gets", used), REAL("flat_us", 1e6 * k->flat_s),
             REAL("loop_us", 1e6 * k->runs_s), REAL("step_us", 1e6 * k->step_s),
             REAL("create_ms", 1e3 * k->create_s), REAL("stiff_part_us", 1e6 * parts->stiff_s),
             REAL("other_part_us", 1e6 * parts->others_s), REAL("difference", k->difference),
             REAL("split_difference", parts->split_difference)));
  printf(
      " forces: %.3g us by msim_sim_force, %.3g us by a loop on component arrays; SUNDIALS uses "
      "%s\n",
      1e6 * k->flat_s, 1e6 * k->runs_s, used);
  if (parts->split.by)
    printf(
        " split in two for MRIStep and IMEX methods: %.3g us the stiff part, %.3g us the others\n",
        1e6 * parts->stiff_s, 1e6 * parts->others_s);
  printf(" a step of Verlet takes %.3g us, creating the sim %.2g ms\n", 1e6 * k->step_s,
         1e3 * k->create_s);
}

/*------------------------------------- runs -----------------------------------------------------*/

static const char *library_of(const precision_method *m) {
  static const char *const names[] = {
      [LIBRARY] = "sundials", [DOUBLE] = "msim", [SINGLE] = "msim single"};
  return names[group_of_method(m)];
}

/* Only methods that are near the best one at some error are plotted. */
static int is_plotted(const setting_sweep *c, const precision_method *m) {
  for (int l = 0; l < ERROR_LEVELS; l++)
    if (is_near_best(c, m, levels[l])) return 1;
  return 0;
}

static void report_point(report *out, const setting_sweep *c, int i) {
  static const char *const statuses[] = {
      [POINT_MEASURED] = "ok", [POINT_UNRESOLVED] = "refused", [POINT_FAILED] = "failed"};
  const sweep_point *r = &c->points[i];
  json_t *row = report_add_row(
      out, "point",
      FIELDS(TEXT("scene", c->context.kind->name), TEXT("method", r->method->name),
             TEXT("of", library_of(r->method)), REAL(r->method->by_tol ? "tol" : "h", r->setting)));
  const char *unresolved = "the error is too close to that of the reference solution";
  const char *const reasons[] = {
      [POINT_UNRESOLVED] = unresolved, [POINT_FAILED] = c->all[i].reason, [POINT_MEASURED] = NULL};
  put_fields(row, FIELDS(TEXT("status", statuses[r->status]), TEXT("reason", reasons[r->status])));
  if (r->status == POINT_FAILED) return;
  put_times(row, &c->all[i], whole_seconds, "ms", 1e3);
  put_fields(row, FIELDS(BOOLEAN("near_best", is_plotted(c, r->method)),
                         INTEGER("evaluations", r->evaluations), REAL("error", r->errors.error),
                         REAL("energy_drift", r->errors.energy),
                         REAL("momentum_drift", r->errors.momentum)));
}

/*------------------------------------- methods --------------------------------------------------*/

enum { DRIFT_LEVEL = 1 }; /* drifts and evaluations: at 1e-4, or of the most accurate run */

/* The run whose drifts are printed; NULL: none. */
static const sweep_point *find_typical_point(const setting_sweep *c, const precision_method *m) {
  const sweep_point *best = NULL;
  for (const sweep_point *r = c->points; r < c->points + c->count; r++) {
    if (r->method != m || r->status == POINT_FAILED) continue;
    if (!best || r->errors.error < best->errors.error) best = r;
    if (best->errors.error <= levels[DRIFT_LEVEL]) break;
  }
  return best;
}

static void print_number(const char *format, double value) {
  if (isfinite(value)) printf(format, value);
  else printf(" %8s", "-");
}

/* Why a method has no result: the reason of its last run. */
static const char *last_reason(const setting_sweep *c, const precision_method *m) {
  const char *reason = NO_TIME;
  for (int i = 0; i < c->count; i++)
    if (c->points[i].method == m) reason = c->all[i].reason;
  return reason;
}

/* A row for each error level, a line for all. */
static void report_method(report *out, const setting_sweep *c, const precision_method *m) {
  const sweep_point *r = find_typical_point(c, m);
  printf(" %-28.28s", m->name);
  if (!r) printf(" failed: %s\n", last_reason(c, m));
  for (int l = 0; l < ERROR_LEVELS && r; l++) {
    const cost found = cost_at_error(c, m, levels[l]);
    print_number(" %8.4g", 1e3 * found.seconds);
    if (isfinite(found.seconds))
      report_add_row(
          out, "level",
          FIELDS(TEXT("scene", c->context.kind->name), TEXT("method", m->name),
                 TEXT("of", library_of(m)), REAL("error", levels[l]),
                 REAL("ms", 1e3 * found.seconds), REAL("evaluations", found.evaluations)));
  }
  if (!r) return;
  print_number(" %8.2g", r->errors.error);
  printf(" %9" PRId64, r->evaluations);
  print_number(" %8.1g", r->errors.energy);
  print_number(" %8.1g", r->errors.momentum);
  putchar('\n');
}

void report_sweep(report *out, const setting_sweep *c) {
  report_reference(out, c->context.kind->name, c->context.reference);
  report_forces(out, c->context.kind->name, c->context.kernel, c->context.parts);
  for (int i = 0; i < c->count; i++) report_point(out, c, i);
  printf(" %-28s", "milliseconds to error");
  for (int l = 0; l < ERROR_LEVELS; l++) printf(" %8.0e", levels[l]);
  printf(" %8s %9s %8s %8s\n", "at error", "evaluat.", "energy", "momentum");
  for (int i = 0; i < c->methods.count; i++) report_method(out, c, &c->methods.all[i]);
  fflush(stdout);
}
