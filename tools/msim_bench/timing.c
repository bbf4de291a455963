#include "timing.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"

/*------------------------------------- values ---------------------------------------------------*/

double whole_seconds(const timing_sample *s) { return s->whole; }
double median_seconds(const timing_sample *s) { return s->median; }
double kinetic_energy(const timing_sample *s) { return s->kinetic; }
double force_seconds(const timing_sample *s) { return s->force; }
double assemble_seconds(const timing_sample *s) { return s->assemble; }
double factor_seconds(const timing_sample *s) { return s->factor; }
double solve_seconds(const timing_sample *s) { return s->solve; }
double linear_seconds(const timing_sample *s) { return s->factor + s->solve; }

double solve_per_iteration(const timing_sample *s) {
  return s->iterations > 0 ? s->solve / (double)s->iterations : NAN;
}

/*------------------------------------- candidates -----------------------------------------------*/

void candidate_init(timing_candidate *c, const char *name, const char *measure,
                    int (*run)(timing_candidate *c, timing_sample *s), void *data) {
  *c = (timing_candidate){
      .family = c->name, .measure = measure, .run = run, .data = data, .residual = NAN};
  snprintf(c->name, sizeof c->name, "%s", name);
}

int candidate_fail(timing_candidate *c, const char *why) {
  snprintf(c->reason, sizeof c->reason, "%s", why);
  return 0;
}

int has_result(const timing_candidate *c) { return !c->failed && c->nsamples > 0; }

void put_times(json_t *row, const timing_candidate *c, sample_value *value, const char *unit,
               double per_second) {
  put_fields(
      row, FIELDS(REAL(unit, per_second * median_of(c, value)), REAL("spread", spread_of(c, value)),
                  INTEGER("repeats", c->nsamples > 1 ? c->nsamples - 1 : 1)));
}

void put_result(json_t *row, const timing_candidate *c, const char *unit, double per_second) {
  const int ran = has_result(c);
  put_fields(row, FIELDS(TEXT("status", ran         ? "ok"
                                        : c->failed ? "failed"
                                                    : "left out"),
                         TEXT("reason", ran         ? NULL
                                        : c->failed ? c->reason
                                                    : NO_TIME)));
  if (ran) put_times(row, c, whole_seconds, unit, per_second);
}

/*------------------------------------- running --------------------------------------------------*/

timing_limits limits_until(timing_limits p, double until) {
  p.until = until;
  return p;
}

static int may_run_again(const timing_candidate *c, int count, const timing_limits *p) {
  if (c->failed || c->settled || c->nsamples > p->max_rounds || is_interrupted() ||
      clock_seconds() > p->until)
    return 0;
  if (c->nsamples <= p->min_rounds && c->total_seconds < p->budget / 2) return 1;
  return c->nsamples == 0 || c->total_seconds < p->budget / count;
}

void time_in_turn(timing_candidate *all, int count, const timing_limits *p) {
  int sharing = 0;
  for (int i = 0; i < count; i++) sharing += !all[i].failed && !all[i].settled;
  for (int round = 0, running = 1; running; round++) {
    running = 0;
    for (int i = 0; i < count; i++) {
      timing_candidate *c = &all[round % 2 ? count - 1 - i : i];
      timing_sample s = {0};
      if (!may_run_again(c, sharing, p)) continue;
      const double start = clock_seconds();
      c->failed = !c->run(c, &s);
      c->total_seconds += clock_seconds() - start;
      if (c->failed) continue;
      c->samples[c->nsamples++] = s;
      running = 1;
    }
  }
}

/*------------------------------------- steps ----------------------------------------------------*/

/* Stores the mean change of the statistics over `steps`. */
static void take_phases(const msim_stats *before, const msim_stats *after, int steps,
                        timing_sample *s) {
  s->force = (after->force_s - before->force_s) / steps;
  s->assemble = (after->assemble_s - before->assemble_s) / steps;
  s->factor = (after->factor_s - before->factor_s) / steps;
  s->solve = (after->solve_s - before->solve_s) / steps;
  s->iterations = (after->iterations - before->iterations) / steps;
}

msim_status time_steps(msim_sim *sim, const msim_state *start, int steps, double until,
                       timing_sample *s, msim_error *err) {
  msim_stats before = {.size = sizeof before}, after = {.size = sizeof after};
  double seconds[MAX_SERIES], sum = 0;
  msim_status status = msim_sim_set_state(sim, start, err);
  msim_sim_stats(sim, &before);
  s->kinetic = INFINITY;
  for (int i = 0; i < steps && !status; i++) {
    msim_energy energy = {.size = sizeof energy};
    const double begin = clock_seconds();
    if (begin > until || is_interrupted()) {
      snprintf(err->text, sizeof err->text, NO_TIME);
      return MSIM_STOPPED;
    }
    status = msim_sim_step(sim, 1, err);
    sum += seconds[i] = clock_seconds() - begin;
    if (!status) msim_sim_energy(sim, &energy);
    s->kinetic = fmin(s->kinetic, energy.kinetic);
  }
  msim_sim_stats(sim, &after);
  take_phases(&before, &after, steps, s);
  s->whole = sum / steps;
  if (!status) s->median = quantile(steps, seconds, 0.5);
  return status;
}

/*------------------------------------- results --------------------------------------------------*/

static int compare_doubles(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

double quantile(int n, double *v, double q) {
  qsort(v, (size_t)n, sizeof *v, compare_doubles);
  const double at = q * (n - 1);
  const int below = (int)at, above = below + (below < n - 1);
  if (at <= below || v[below] == v[above]) return v[below]; /* also if both are infinite */
  return v[below] + (at - below) * (v[above] - v[below]);
}

/* Collects the values without the warm-up. Returns their number. */
static int values(const timing_candidate *c, sample_value *value, double v[MAX_ROUNDS]) {
  const int first = c->nsamples > 1;
  for (int i = first; i < c->nsamples; i++) v[i - first] = value(&c->samples[i]);
  return c->nsamples - first;
}

double median_of(const timing_candidate *c, sample_value *value) {
  double v[MAX_ROUNDS];
  const int n = values(c, value, v);
  return n > 0 ? quantile(n, v, 0.5) : NAN;
}

double spread_of(const timing_candidate *c, sample_value *value) {
  double v[MAX_ROUNDS];
  const int n = values(c, value, v);
  return n > 1 ? (quantile(n, v, 0.75) - quantile(n, v, 0.25)) / quantile(n, v, 0.5) : NAN;
}

double median_ratio(const timing_candidate *a, sample_value *of_a, const timing_candidate *b,
                    sample_value *of_b) {
  double ratios[MAX_ROUNDS];
  const int n = a->nsamples < b->nsamples ? a->nsamples : b->nsamples, first = n > 1;
  if (n == 0) return NAN;
  for (int i = first; i < n; i++) ratios[i - first] = of_a(&a->samples[i]) / of_b(&b->samples[i]);
  return quantile(n - first, ratios, 0.5);
}

double time_pair(const timing_candidate *a, sample_value *of_a, const timing_candidate *b,
                 sample_value *of_b, const timing_limits *p, timing_candidate pair[2]) {
  pair[0] = *a, pair[1] = *b;
  for (int i = 0; i < 2; i++) pair[i].nsamples = 0, pair[i].total_seconds = 0;
  if (a->failed || b->failed) return NAN;
  time_in_turn(pair, a == b ? 1 : 2, p);
  if (a == b) pair[1] = pair[0];
  return median_ratio(&pair[0], of_a, &pair[1], of_b);
}

const timing_candidate *fastest_candidate(const timing_candidate *all, int count,
                                          const char *family) {
  const timing_candidate *best = NULL;
  for (const timing_candidate *c = all; c < all + count; c++) {
    if (c->failed || c->nsamples == 0 || strcmp(c->family, family) != 0) continue;
    if (!best || median_of(c, whole_seconds) < median_of(best, whole_seconds)) best = c;
  }
  return best;
}
