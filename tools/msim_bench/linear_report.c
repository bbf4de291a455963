#include "linear_report.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

/*------------------------------------- table ----------------------------------------------------*/

void print_heading(const moving_scene *m, double h) {
  printf("\n%s at t = %.2g s, k = %g N/m, h = 1/%.0f s, %d unknowns\n", m->kind->name, m->state.t,
         m->k, 1 / h, (int)m->unknowns);
  fflush(stdout);
}

void print_columns(void) {
  printf(" %-19s %7s %4s %6s %6s %7s %7s %6s %8s\n", "milliseconds", "all", "+-", "force", "matrix",
         "factor", "solve", "iter", "residual");
}

static void print_ms(int width, double seconds) {
  if (seconds > 0) printf(" %*.*g", width, width < 7 ? 3 : 4, 1e3 * seconds);
  else printf(" %*s", width, "-");
}

static void print_contestant(const timing_candidate *c) {
  const double spread = spread_of(c, whole_seconds);
  const int64_t iterations = c->samples[c->nsamples - 1].iterations;
  printf(" %-19s", c->name);
  print_ms(7, median_of(c, whole_seconds));
  if (isfinite(spread)) printf(" %3.0f%%", 100 * spread);
  else printf(" %4s", "-");
  print_ms(6, median_of(c, force_seconds));
  print_ms(6, median_of(c, assemble_seconds));
  print_ms(7, median_of(c, factor_seconds));
  print_ms(7, median_of(c, solve_seconds));
  if (iterations > 0) printf(" %6" PRId64, iterations);
  else printf(" %6s", "-");
  if (isfinite(c->residual)) printf(" %8.1e\n", c->residual);
  else printf(" %8s\n", "-");
}

/*------------------------------------- rows -----------------------------------------------------*/

json_t *add_step_row(report *out, const char *measure, const moving_scene *m, double h) {
  json_t *row = report_add_row(out, measure);
  put_text(row, "scene", m->kind->name);
  put_integer(row, "particles", m->view.nparticles);
  put_real(row, "t", m->state.t);
  put_real(row, "k", m->k);
  put_real(row, "h", h);
  return row;
}

static void put_ms(json_t *row, const char *key, double seconds) {
  if (seconds > 0) put_real(row, key, 1e3 * seconds);
}

/* Adds the solver that ran and its number of threads. */
static void put_plan(json_t *row, const timing_candidate *c) {
  const struct timed_step *step = solver_comparison_step(c);
  msim_plan plan = {.size = sizeof plan};
  if (!step) return;
  msim_sim_plan(step->sim, &plan);
  put_text(row, "ran", plan.solver);
  put_integer(row, "threads", plan.threads);
}

static void report_contestant(report *out, const solver_comparison *r, const timing_candidate *c) {
  const int64_t iterations = c->samples[c->nsamples - 1].iterations;
  json_t *row = add_step_row(out, c->measure, r->moving, r->system.h);
  put_text(row, "solver", c->name);
  put_text(row, "status", "ok");
  put_plan(row, c);
  put_integer(row, "unknowns", r->moving->unknowns);
  put_integer(row, "repeats", c->nsamples > 1 ? c->nsamples - 1 : 1);
  put_real(row, "spread", spread_of(c, whole_seconds));
  put_ms(row, "ms", median_of(c, whole_seconds));
  put_ms(row, "force_ms", median_of(c, force_seconds));
  put_ms(row, "assemble_ms", median_of(c, assemble_seconds));
  put_ms(row, "factor_ms", median_of(c, factor_seconds));
  put_ms(row, "solve_ms", median_of(c, solve_seconds));
  if (iterations > 0) put_integer(row, "iterations", iterations);
  put_real(row, "residual", c->residual);
}

static void report_without(report *out, const char *measure, const moving_scene *m, double h,
                           const char *solver, const char *status, const char *reason) {
  json_t *row = add_step_row(out, measure, m, h);
  put_text(row, "solver", solver);
  put_text(row, "status", status);
  put_text(row, "reason", reason);
  printf(" %-19s %s: %s\n", solver, status, reason);
}

void report_left_out(report *out, const char *measure, const moving_scene *m, double h,
                     const char *solver, const char *why) {
  report_without(out, measure, m, h, solver, "left out", why);
}

static void report_failure(report *out, const solver_comparison *r, const timing_candidate *c,
                           const char *measure) {
  if (c->failed) report_without(out, measure, r->moving, r->system.h, c->name, "failed", c->reason);
  else report_left_out(out, measure, r->moving, r->system.h, c->name, "there was no time left");
}

static int has_result(const timing_candidate *c) { return !c->failed && c->nsamples > 0; }

void report_failures(report *out, const solver_comparison *r, const char *measure) {
  for (const timing_candidate *c = r->all; c < r->all + r->count; c++)
    if (!has_result(c)) report_failure(out, r, c, measure);
}

void report_comparison(report *out, const solver_comparison *r) {
  for (const timing_candidate *c = r->all; c < r->all + r->count; c++) {
    if (has_result(c)) {
      report_contestant(out, r, c);
      print_contestant(c);
    } else {
      report_failure(out, r, c, c->measure);
    }
  }
  fflush(stdout);
}
