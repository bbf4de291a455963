#include "solver_comparison.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"

solver_comparison *solver_comparison_create(const moving_scene *m, double h, double rtol,
                                            int with_system, msim_error *err) {
  solver_comparison *r = calloc(1, sizeof *r);
  if (!r) {
    snprintf(err->text, sizeof err->text, "out of memory for the comparison");
    return NULL;
  }
  r->moving = m;
  r->series = 1;
  r->until = INFINITY;
  r->system = (linear_system){.h = h, .rtol = rtol};
  if (!with_system || linear_system_create(m, h, rtol, &r->system, err)) return r;
  solver_comparison_free(r);
  return NULL;
}

void solver_comparison_free(solver_comparison *r) {
  if (!r) return;
  for (int i = 0; i < r->nsteps; i++) {
    msim_sim_destroy(r->steps[i].sim);
    backend_proxy_free(&r->steps[i].proxy);
  }
  linear_system_free(&r->system);
  free(r);
}

static timing_candidate *add_candidate(solver_comparison *r, const char *name, const char *measure,
                                       int (*run)(timing_candidate *, timing_sample *),
                                       void *data) {
  timing_candidate *c = &r->all[r->count++];
  candidate_init(c, name, measure, run, data);
  return c;
}

/*------------------------------------- whole steps ----------------------------------------------*/

static int run_steps(timing_candidate *c, timing_sample *s) {
  struct timed_step *step = c->data;
  const solver_comparison *r = step->comparison;
  const int is_first = c->nsamples == 0;
  msim_state end = {.size = sizeof end};
  msim_error err;
  step->proxy.copy_next = is_first;
  const double start = clock_seconds();
  do
    if (time_steps(step->sim, &r->moving->state, r->series, r->until, s, &err))
      return candidate_fail(c, err.text);
  while (clock_seconds() - start < r->warm);
  if (!is_first || r->series > 1 || r->system.n == 0) return 1;
  msim_sim_state(step->sim, &end);
  c->residual = linear_system_residual(&r->system, end.v);
  return 1;
}

/* Only `auto` may select another solver. */
static void check_solver(timing_candidate *c, const char *solver, const msim_sim *sim) {
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(sim, &plan);
  c->failed = strcmp(solver, "auto") != 0 && strcmp(solver, plan.solver) != 0;
  if (c->failed) snprintf(c->reason, sizeof c->reason, "%s would run instead", plan.solver);
}

timing_candidate *solver_comparison_add_step(solver_comparison *r, const char *solver,
                                             const msim_backend *table, int32_t threads) {
  struct timed_step *step = &r->steps[r->nsteps++];
  timing_candidate *c = add_candidate(r, solver, "step", run_steps, step);
  msim_options options = implicit_options(r->system.h, r->system.rtol, solver, threads);
  msim_error err;
  step->comparison = r;
  if (table) {
    backend_proxy_init(&step->proxy, table);
    step->backends[0] = &step->proxy.table;
    options.backends = step->backends;
  }
  c->failed = msim_sim_create(r->moving->scene, &options, &step->sim, &err) != MSIM_OK;
  if (c->failed) candidate_fail(c, err.text);
  else check_solver(c, solver, step->sim);
  return c;
}

const struct timed_step *solver_comparison_step(const timing_candidate *c) {
  return c->run == run_steps ? c->data : NULL;
}

/*------------------------------------- backends alone -------------------------------------------*/

static int run_backend(timing_candidate *c, timing_sample *s) {
  struct timed_step *step = c->data;
  const msim_status status = backend_proxy_repeat(&step->proxy, &s->factor, &s->solve);
  s->whole = s->factor + s->solve;
  return status ? candidate_fail(c, msim_status_text(status)) : 1;
}

timing_candidate *solver_comparison_add_backend(solver_comparison *r) {
  struct timed_step *step = &r->steps[r->nsteps - 1];
  char name[sizeof r->all[0].name];
  snprintf(name, sizeof name, "%s, bare", step->proxy.table.name);
  timing_candidate *c = add_candidate(r, name, "bare", run_backend, step);
  c->failed = !step->sim;
  if (c->failed) candidate_fail(c, "its sim could not be created");
  return c;
}

/*------------------------------------- references -----------------------------------------------*/

static int run_reference(timing_candidate *c, timing_sample *s) {
  const struct timed_reference *entry = c->data;
  reference_reply reply;
  if (!reference_program_solve(entry->child, entry->variant, &reply))
    return candidate_fail(c, reply.reason);
  s->factor = reply.factor_s;
  s->solve = reply.solve_s;
  s->whole = s->factor + s->solve;
  s->iterations = reply.iterations;
  c->residual = reply.residual;
  return 1;
}

int solver_comparison_send(const solver_comparison *r, reference_program *child) {
  const linear_system *s = &r->system;
  return reference_program_send_system(child, &s->A, s->b, s->rtol, MAX_ITERATIONS);
}

timing_candidate *solver_comparison_add_reference(solver_comparison *r, const char *measure,
                                                  reference_program *child, int variant) {
  struct timed_reference *entry = &r->references[r->nreferences++];
  *entry = (struct timed_reference){child, variant};
  timing_candidate *c =
      add_candidate(r, child->hello.variants[variant], measure, run_reference, entry);
  c->family = measure;
  return c;
}

/*------------------------------------- results --------------------------------------------------*/

static const column columns[] = {
    {"milliseconds", "solver", -19, NULL, 0}, {"all", "ms", 7, "%.4g", 0},
    {"+-", "spread", 4, "%.0f%%", 100},       {"force", "force_ms", 6, "%.3g", 0},
    {"matrix", "assemble_ms", 6, "%.3g", 0},  {"factor", "factor_ms", 7, "%.4g", 0},
    {"solve", "solve_ms", 7, "%.4g", 0},      {"iter", "iterations", 6, "%.0f", 0},
    {"residual", "residual", 8, "%.1e", 0},   {.key = NULL}};

/* NAN for a phase that took no time */
static double phase_ms(const timing_candidate *c, sample_value *value) {
  const double seconds = median_of(c, value);
  return seconds > 0 ? 1e3 * seconds : NAN;
}

/* The solver that ran, its threads, and what the phases took. */
static void put_phases(json_t *row, const solver_comparison *r, const timing_candidate *c) {
  const struct timed_step *step = solver_comparison_step(c);
  const int64_t iterations = c->samples[c->nsamples - 1].iterations;
  msim_plan plan = {.size = sizeof plan};
  if (step) {
    msim_sim_plan(step->sim, &plan);
    put_fields(row, FIELDS(TEXT("ran", plan.solver), INTEGER("threads", plan.threads)));
  }
  put_fields(
      row,
      FIELDS(INTEGER("unknowns", r->moving->unknowns), REAL("force_ms", phase_ms(c, force_seconds)),
             REAL("assemble_ms", phase_ms(c, assemble_seconds)),
             REAL("factor_ms", phase_ms(c, factor_seconds)),
             REAL("solve_ms", phase_ms(c, solve_seconds)), REAL("residual", c->residual)));
  if (iterations > 0) put_fields(row, FIELDS(INTEGER("iterations", iterations)));
}

void solver_comparison_report(report *out, const solver_comparison *r, const char *failures) {
  if (!failures) print_titles(columns);
  for (const timing_candidate *c = r->all; c < r->all + r->count; c++) {
    if (failures && has_result(c)) continue;
    json_t *row = add_step_row(out, failures ? failures : c->measure, r->moving, r->system.h,
                               FIELDS(TEXT("solver", c->name)));
    put_result(row, c, "ms", 1e3);
    if (has_result(c)) put_phases(row, r, c);
    print_row(columns, row);
  }
  fflush(stdout);
}
