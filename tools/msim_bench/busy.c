#include <math.h>
#include <stdio.h>
#include <string.h>

#include "interrupt.h"
#include "linear.h"
#include "rows.h"

/* A contestant of another race, while the other cores are idle or busy. */
typedef struct condition {
  contestant *inner;
  const spinner *spinner; /* NULL: idle */
} condition;

/* The mean of a few runs in a row: one alone would show a lucky slice of time. */
static int run_condition(contestant *c, sample *s) {
  enum { RUNS = 2 };
  const condition *run = c->data;
  int good = 1;
  if (run->spinner) spinner_turn(run->spinner);
  for (int i = 0; i < RUNS && good; i++) {
    sample one = {0};
    good = run->inner->run(run->inner, &one);
    run->inner->n = 1; /* it is warm */
    s->whole += one.whole / RUNS;
  }
  if (run->spinner) spinner_turn(run->spinner);
  if (!good) memcpy(c->reason, run->inner->reason, sizeof c->reason);
  return good;
}

static double report_slowdown(report *out, const race *r, const contestant *idle,
                              const contestant *busy, int spinners) {
  const double slowdown = median_ratio(busy, whole_seconds, idle, whole_seconds);
  json_t *row = step_row(out, "busy", r->moving, r->system.h);
  put_text(row, "solver", idle->name);
  put_text(row, "status", busy->failed || idle->failed ? "failed" : "ok");
  if (busy->failed) put_text(row, "reason", busy->reason);
  put_integer(row, "busy_cores", spinners);
  put_real(row, "idle_ms", 1e3 * median_of(idle, whole_seconds));
  put_real(row, "idle_spread", spread_of(idle, whole_seconds));
  put_real(row, "busy_ms", 1e3 * median_of(busy, whole_seconds));
  put_real(row, "busy_spread", spread_of(busy, whole_seconds));
  put_real(row, "slowdown", slowdown);
  if (isfinite(slowdown))
    printf(" %-19s %7.4g ms idle, %7.4g ms with %d busy core%s: %.3g times\n", idle->name,
           1e3 * median_of(idle, whole_seconds), 1e3 * median_of(busy, whole_seconds), spinners,
           spinners == 1 ? "" : "s", slowdown);
  return slowdown;
}

/* Idle and busy versions of all contestants of r; the slowdown of the first one. */
static double run_conditions(linear_bench *b, race *r, const patience *p) {
  condition conditions[4];
  contestant all[4] = {{.n = 0}};
  int count = 0;
  for (int i = 0; i < 2 * r->count; i++) {
    contestant *inner = &r->all[i / 2], *c = &all[count];
    if (inner->failed) continue;
    conditions[count] = (condition){inner, i % 2 ? &b->spinner : NULL};
    memcpy(c->name, inner->name, sizeof c->name);
    c->family = c->measure = "busy";
    c->run = run_condition;
    c->data = &conditions[count++];
  }
  contest(all, count, p);
  double first = NAN;
  if (is_interrupted()) return first;
  for (int i = 0; i + 1 < count; i += 2) {
    const double slowdown = report_slowdown(b->report, r, &all[i], &all[i + 1], b->spinner.count);
    if (strcmp(all[i].name, "cholmod") == 0) first = slowdown;
  }
  return first;
}

static const struct bench_solver *find_solver(const linear_bench *b, const char *name) {
  for (int i = 0; i < b->nsolvers; i++)
    if (strcmp(b->solvers[i].name, name) == 0) return &b->solvers[i];
  return NULL;
}

double measure_busy(linear_bench *b, const moving *m, double h, const patience *p) {
  const struct bench_solver *cholmod = find_solver(b, "cholmod");
  msim_error err;
  if (!cholmod || b->spinner.count == 0) return NAN;
  race *r = race_new(m, h, 1e-6, &err);
  if (!r) return NAN;
  race_add_step(r, cholmod->name, cholmod->table);
  if (reference_take(&b->cholmod, &r->system)) race_add_reference(r, "default", &b->cholmod, 0);
  const double slowdown = run_conditions(b, r, p);
  race_free(r);
  return slowdown;
}
