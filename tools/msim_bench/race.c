#include "race.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"

race *race_new(const moving *m, double h, double rtol, int with_system, msim_error *err) {
  race *r = calloc(1, sizeof *r);
  if (!r) {
    snprintf(err->text, sizeof err->text, "out of memory for a race");
    return NULL;
  }
  r->moving = m;
  r->until = INFINITY;
  r->system = (linear_system){.h = h, .rtol = rtol};
  if (!with_system || system_make(m, h, rtol, &r->system, err)) return r;
  race_free(r);
  return NULL;
}

void race_free(race *r) {
  if (!r) return;
  for (int i = 0; i < r->nsteps; i++) {
    msim_sim_destroy(r->steps[i].sim);
    probe_free(&r->steps[i].probe);
  }
  system_free(&r->system);
  free(r);
}

static contestant *enter(race *r, const char *name, const char *family, const char *measure,
                         int (*run)(contestant *, sample *), void *data) {
  contestant *c = &r->all[r->count++];
  *c = (contestant){.family = family, .measure = measure, .run = run, .data = data};
  c->residual = NAN;
  snprintf(c->name, sizeof c->name, "%s", name);
  return c;
}

static int fail(contestant *c, const char *why) {
  snprintf(c->reason, sizeof c->reason, "%s", why);
  return 0;
}

/*------------------------------------- whole steps ----------------------------------------------*/

/* Stores the mean change of the statistics over `steps`. */
static void take_phases(const msim_stats *before, const msim_stats *after, int steps, sample *s) {
  s->force = (after->force_s - before->force_s) / steps;
  s->assemble = (after->assemble_s - before->assemble_s) / steps;
  s->factor = (after->factor_s - before->factor_s) / steps;
  s->solve = (after->solve_s - before->solve_s) / steps;
  s->iterations = (after->iterations - before->iterations) / steps;
}

/* Makes a step from the state of `moving`. */
static msim_status run_one(struct racing_step *step, sample *s, msim_error *err) {
  msim_stats before = {.size = sizeof before}, after = {.size = sizeof after};
  msim_status status = msim_sim_set_state(step->sim, &step->race->moving->state, err);
  if (status) return status;
  msim_sim_stats(step->sim, &before);
  const double start = wall_seconds();
  status = msim_sim_step(step->sim, 1, err);
  s->whole = wall_seconds() - start;
  msim_sim_stats(step->sim, &after);
  if (!status) take_phases(&before, &after, 1, s);
  return status;
}

static int run_step(contestant *c, sample *s) {
  struct racing_step *step = c->data;
  const race *r = step->race;
  msim_state end = {.size = sizeof end};
  msim_error err;
  step->probe.listens = c->n == 0;
  const double start = wall_seconds();
  do
    if (run_one(step, s, &err) != MSIM_OK) return fail(c, err.text);
  while (wall_seconds() - start < r->warm);
  if (c->n > 0 || r->system.n == 0) return 1;
  msim_sim_state(step->sim, &end);
  c->residual = system_residual(&r->system, end.v);
  return 1;
}

/* Makes a series of steps from the state of `moving`. Setting it discards lagged factorizations, so
 * that each sample includes making them. */
static int run_series(contestant *c, sample *s) {
  const struct racing_step *step = c->data;
  msim_stats before = {.size = sizeof before}, after = {.size = sizeof after};
  msim_error err;
  if (msim_sim_set_state(step->sim, &step->race->moving->state, &err)) return fail(c, err.text);
  msim_sim_stats(step->sim, &before);
  if (!time_series(step->sim, step->race->series, step->race->until, s, &err))
    return fail(c, err.text);
  msim_sim_stats(step->sim, &after);
  take_phases(&before, &after, step->race->series, s);
  return 1;
}

/* Only `auto` may select another solver. */
static void check_solver(contestant *c, const char *solver, const msim_sim *sim) {
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(sim, &plan);
  c->failed = strcmp(solver, "auto") != 0 && strcmp(solver, plan.solver) != 0;
  if (c->failed) snprintf(c->reason, sizeof c->reason, "%s would run in its place", plan.solver);
}

contestant *race_add_step(race *r, const char *solver, const msim_backend *table, int32_t threads) {
  struct racing_step *step = &r->steps[r->nsteps++];
  contestant *c = enter(r, solver, solver, "step", r->series ? run_series : run_step, step);
  msim_options options = implicit_options(r->system.h, r->system.rtol, solver, threads);
  msim_error err;
  step->race = r;
  if (table) {
    probe_init(&step->probe, table);
    step->own[0] = &step->probe.table;
    options.backends = step->own;
  }
  c->failed = msim_sim_create(r->moving->scene, &options, &step->sim, &err) != MSIM_OK;
  if (c->failed) fail(c, err.text);
  else check_solver(c, solver, step->sim);
  return c;
}

const struct racing_step *race_step_of(const contestant *c) {
  return c->run == run_step || c->run == run_series ? c->data : NULL;
}

/*------------------------------------- backends alone -------------------------------------------*/

static int run_bare(contestant *c, sample *s) {
  struct racing_step *step = c->data;
  const msim_status status = probe_replay(&step->probe, &s->factor, &s->solve);
  s->whole = s->factor + s->solve;
  return status ? fail(c, msim_status_text(status)) : 1;
}

contestant *race_add_bare(race *r) {
  struct racing_step *step = &r->steps[r->nsteps - 1];
  char name[sizeof r->all[0].name];
  snprintf(name, sizeof name, "%s, bare", step->probe.table.name);
  contestant *c = enter(r, name, NULL, "bare", run_bare, step);
  c->family = c->name;
  c->failed = !step->sim;
  if (c->failed) fail(c, "the sim that it is a part of was not made");
  return c;
}

/*------------------------------------- references -----------------------------------------------*/

static int run_reference(contestant *c, sample *s) {
  const struct racing_reference *entered = c->data;
  reference_reply reply;
  if (!reference_solve(entered->child, entered->variant, &reply)) return fail(c, reply.reason);
  s->factor = reply.factor_s;
  s->solve = reply.solve_s;
  s->whole = s->factor + s->solve;
  s->iterations = reply.iterations;
  c->residual = reply.residual;
  return 1;
}

contestant *race_add_reference(race *r, const char *measure, reference *child, int variant) {
  struct racing_reference *entered = &r->references[r->nreferences++];
  *entered = (struct racing_reference){child, variant};
  return enter(r, child->hello.variants[variant], measure, measure, run_reference, entered);
}
