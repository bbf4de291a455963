#include "precision_methods.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"

/*------------------------------------- methods --------------------------------------------------*/

static precision_method *add_method_entry(precision_methods *list, const char *name,
                                          const char *suffix) {
  if (list->count == MAX_PRECISION_METHODS) return NULL;
  precision_method *m = &list->all[list->count++];
  *m = (precision_method){.ode = -1, .collision = MSIM_COLLISION_REFLECT};
  snprintf(m->name, sizeof m->name, "%s%s", name, suffix);
  return m;
}

static void set_tol_settings(precision_method *m) {
  m->by_tol = 1;
  m->first = m->ratio = 0.1;
}

static void set_step_settings(const reference_solution *t, precision_method *m) {
  const int multirate = !m->integrator || strcmp(m->integrator, "respa") == 0;
  const double own = multirate ? INFINITY : longest_step(t->scene, m->integrator, NULL);
  const int limited = isfinite(own);
  m->first = limited ? own : 64 * t->limit;
  m->ratio = 0.5;
}

/* Methods that are also run under error control, by step doubling or by an embedded estimate. */
static int is_worth_control(const char *integrator) {
  static const char *const names[] = {
      "velocity-verlet", "force-gradient",    "rk4",    "ssprk102", "ssprk104", "rk6", "rkn6",
      "dop853",          "implicit-midpoint", "sdirk2", "auto"};
  for (size_t i = 0; i < sizeof names / sizeof *names; i++)
    if (strcmp(names[i], integrator) == 0) return 1;
  return 0;
}

static void add_method(const reference_solution *t, const char *integrator, int32_t collision,
                       const char *suffix, precision_methods *list) {
  char controlled[24];
  snprintf(controlled, sizeof controlled, "%s, tol", suffix);
  for (int control = 0; control < 2; control++) {
    if (control ? !is_worth_control(integrator) : strcmp(integrator, "auto") == 0) continue;
    if (control && collision == MSIM_COLLISION_EVENT)
      continue; /* error control always locates impacts, so a second run would be the same */
    precision_method *m = add_method_entry(list, integrator, control ? controlled : suffix);
    if (!m) return;
    m->integrator = integrator;
    m->collision = collision;
    if (control) set_tol_settings(m);
    else set_step_settings(t, m);
  }
}

/* The methods that are the fastest of those in double precision where floats are sufficient; single
 * precision takes no planes. */
static void add_single_methods(const reference_solution *t, precision_methods *list) {
  static const char *const names[] = {"verlet", "velocity-verlet", "rk4",
                                      "rkc",    "takahashi-imada", "force-gradient"};
  for (size_t i = 0; i < sizeof names / sizeof *names && !t->impacts; i++) {
    precision_method *m = add_method_entry(list, names[i], ", single");
    if (!m) return;
    m->integrator = names[i];
    m->precision = MSIM_PRECISION_SINGLE;
    set_step_settings(t, m);
  }
}

void precision_methods_collect(const reference_solution *t, int split_by, const ode_methods *ode,
                               precision_methods *list) {
  const msim_integrator_entry *entry;
  const ode_method *method;
  list->count = 0;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++) {
    add_method(t, entry->name, MSIM_COLLISION_REFLECT, "", list);
    if (t->impacts) add_method(t, entry->name, MSIM_COLLISION_EVENT, ", event", list);
  }
  add_single_methods(t, list);
  for (int i = 0; ode && !t->impacts && (method = ode->info(i)) != NULL; i++) {
    if (method->split_mask && !(method->split_mask & split_by)) continue;
    precision_method *m = add_method_entry(list, method->name, "");
    if (!m) return;
    m->ode = i;
    if (method->by_step) set_step_settings(t, m);
    else set_tol_settings(m);
  }
}

const precision_method *precision_methods_find(const precision_methods *list, const char *name) {
  for (const precision_method *m = list->all; m < list->all + list->count; m++)
    if (strcmp(m->name, name) == 0) return m;
  return NULL;
}

/*------------------------------------- runs -----------------------------------------------------*/

/* Data of the force callback. */
typedef struct force_call {
  const ode_forces *kernel;
  double until;
  int64_t evaluations; /* each part of split forces counts as one */
  int stopped;
} force_call;

static int call_force(void *data, int part, const double *x, const double *v, double *f) {
  force_call *c = data;
  c->evaluations++;
  c->stopped = is_interrupted() || clock_seconds() > c->until;
  if (!c->stopped) ode_forces_evaluate(c->kernel, part, x, v, f);
  return !c->stopped;
}

static const ode_forces *forces_of(const run_context *a, const precision_method *m) {
  return a->ode->info(m->ode)->split_mask ? a->parts : a->kernel;
}

/* Times the library only: its input arrays are prepared beforehand. x, v: the final state. */
static void time_ode(const run_context *a, const precision_method *m, double setting, double until,
                     double *x, double *v, run_result *e) {
  const reference_solution *t = a->reference;
  const ode_forces *kernel = forces_of(a, m);
  force_call c = {.kernel = kernel, .until = until};
  const ode_problem problem = {.n = 3 * (size_t)t->view.nparticles,
                               .x = kernel->x,
                               .v = kernel->v,
                               .inverse = kernel->inverse,
                               .t_end = t->t_end,
                               .scales = {t->motion, t->speed},
                               .split = kernel->split.by,
                               .force = call_force,
                               .data = &c};
  const double start = clock_seconds();
  const int status = a->ode->solve(m->ode, &problem, setting, x, v);
  e->seconds = clock_seconds() - start;
  e->evaluations = c.evaluations;
  e->reason[0] = '\0';
  if (c.stopped)
    snprintf(e->reason, sizeof e->reason, "aborted after %.3g s (time limit)", e->seconds);
  else if (status) snprintf(e->reason, sizeof e->reason, "SUNDIALS failed with status %d", status);
}

static int run_ode(const run_context *a, const precision_method *m, double setting, double until,
                   run_result *e) {
  const size_t n = 3 * (size_t)a->reference->view.nparticles;
  double *x = malloc(2 * n * sizeof *x);
  snprintf(e->reason, sizeof e->reason, "out of memory");
  e->refused = x == NULL;
  if (!x) return 0;
  time_ode(a, m, setting, until, x, x + n, e);
  ode_forces_interleave(forces_of(a, m), x, e->x);
  ode_forces_interleave(forces_of(a, m), x + n, e->v);
  free(x);
  return e->reason[0] == '\0';
}

int precision_method_run(const run_context *a, const precision_method *m, double setting,
                         double until, run_result *e) {
  const reference_solution *t = a->reference;
  if (!m->integrator) return run_ode(a, m, setting, until, e);
  scene_run run = {.scene = t->scene,
                   .integrator = m->integrator,
                   .t_end = t->t_end,
                   .threads = a->threads,
                   .collision = m->collision,
                   .precision = m->precision,
                   .until = until};
  if (m->by_tol) run.tol = setting;
  else run.steps = (int64_t)fmax(1, ceil(t->t_end / setting * (1 - 1e-12)));
  return scene_run_execute(&run, e);
}
