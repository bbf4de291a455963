#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include "timing.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "../common/clock.h"
#include "interrupt.h"

void rest_seconds(double seconds) {
  struct timespec left = {.tv_sec = (time_t)seconds,
                          .tv_nsec = (long)(1e9 * (seconds - floor(seconds)))};
  nanosleep(&left, NULL);
}

/*------------------------------------- values ---------------------------------------------------*/

double whole_seconds(const sample *s) { return s->whole; }
double median_seconds(const sample *s) { return s->median; }
double kinetic_energy(const sample *s) { return s->kinetic; }
double force_seconds(const sample *s) { return s->force; }
double assemble_seconds(const sample *s) { return s->assemble; }
double factor_seconds(const sample *s) { return s->factor; }
double solve_seconds(const sample *s) { return s->solve; }
double linear_seconds(const sample *s) { return s->factor + s->solve; }

double solve_per_iteration(const sample *s) {
  return s->iterations > 0 ? s->solve / (double)s->iterations : NAN;
}

/*------------------------------------- running --------------------------------------------------*/

static int takes_part(const contestant *c, int count, const patience *p) {
  if (c->failed || c->n > p->most || is_interrupted() || wall_seconds() > p->until) return 0;
  if (c->n <= p->rounds && c->spent < p->budget / 2) return 1;
  return c->n == 0 || c->spent < p->budget / count;
}

void contest(contestant *all, int count, const patience *p) {
  for (int round = 0, running = 1; running; round++) {
    running = 0;
    for (int i = 0; i < count; i++) {
      contestant *c = &all[round % 2 ? count - 1 - i : i];
      sample s = {0};
      if (!takes_part(c, count, p)) continue;
      const double start = wall_seconds();
      c->failed = !c->run(c, &s);
      c->spent += wall_seconds() - start;
      if (c->failed) continue;
      c->samples[c->n++] = s;
      running = 1;
    }
  }
}

int time_series(msim_sim *sim, int steps, double until, sample *s, msim_error *err) {
  double seconds[MOST_SERIES], sum = 0;
  s->kinetic = INFINITY;
  for (int i = 0; i < steps; i++) {
    msim_energy energy = {.size = sizeof energy};
    const double start = wall_seconds();
    if (start > until || is_interrupted()) {
      snprintf(err->text, sizeof err->text, "there was no time left");
      return 0;
    }
    if (msim_sim_step(sim, 1, err) != MSIM_OK) return 0;
    seconds[i] = wall_seconds() - start;
    msim_sim_energy(sim, &energy);
    s->kinetic = fmin(s->kinetic, energy.kinetic);
    sum += seconds[i];
  }
  s->whole = sum / steps;
  s->median = quantile(steps, seconds, 0.5);
  return 1;
}

/*------------------------------------- looking --------------------------------------------------*/

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

double quantile(int n, double *v, double q) {
  qsort(v, (size_t)n, sizeof *v, ascending);
  const double at = q * (n - 1);
  const int below = (int)at, above = below + (below < n - 1);
  if (at <= below || v[below] == v[above]) return v[below]; /* also if both are infinite */
  return v[below] + (at - below) * (v[above] - v[below]);
}

/* Collects the values without the warm-up. Returns their number. */
static int values(const contestant *c, sample_value *value, double v[MOST_ROUNDS]) {
  const int first = c->n > 1;
  for (int i = first; i < c->n; i++) v[i - first] = value(&c->samples[i]);
  return c->n - first;
}

double median_of(const contestant *c, sample_value *value) {
  double v[MOST_ROUNDS];
  const int n = values(c, value, v);
  return n > 0 ? quantile(n, v, 0.5) : NAN;
}

double spread_of(const contestant *c, sample_value *value) {
  double v[MOST_ROUNDS];
  const int n = values(c, value, v);
  return n > 1 ? (quantile(n, v, 0.75) - quantile(n, v, 0.25)) / quantile(n, v, 0.5) : NAN;
}

double median_ratio(const contestant *a, sample_value *of_a, const contestant *b,
                    sample_value *of_b) {
  double ratios[MOST_ROUNDS];
  const int n = a->n < b->n ? a->n : b->n, first = n > 1;
  if (n == 0) return NAN;
  for (int i = first; i < n; i++) ratios[i - first] = of_a(&a->samples[i]) / of_b(&b->samples[i]);
  return quantile(n - first, ratios, 0.5);
}

double duel(const contestant *a, sample_value *of_a, const contestant *b, sample_value *of_b,
            const patience *p, contestant pair[2]) {
  pair[0] = *a, pair[1] = *b;
  for (int i = 0; i < 2; i++) pair[i].n = 0, pair[i].spent = 0;
  if (a->failed || b->failed) return NAN;
  contest(pair, a == b ? 1 : 2, p);
  if (a == b) pair[1] = pair[0];
  return median_ratio(&pair[0], of_a, &pair[1], of_b);
}

const contestant *fastest(const contestant *all, int count, const char *family) {
  const contestant *best = NULL;
  for (const contestant *c = all; c < all + count; c++) {
    if (c->failed || c->n == 0 || strcmp(c->family, family) != 0) continue;
    if (!best || median_of(c, whole_seconds) < median_of(best, whole_seconds)) best = c;
  }
  return best;
}
