/* timing - times candidates in turn, so that disturbances affect all, and compares them in pairs */
#ifndef BENCH_TIMING_H
#define BENCH_TIMING_H

#include <stdint.h>

#include "msim/msim.h"

/* Sleeps, so that threads that wait by spinning (OpenBLAS, OpenMP) go to sleep. */
void rest_seconds(double seconds);

/* Result of one run: seconds in total and by phase; means if the run is a series of steps. */
typedef struct sample {
  double whole, force, assemble, factor, solve;
  double median;  /* s, over the steps of a series */
  double kinetic; /* J, the smallest after a step of a series, to show motion */
  int64_t iterations;
} sample;

/* Selects one value of a sample. */
typedef double sample_value(const sample *s);
double whole_seconds(const sample *s);
double median_seconds(const sample *s);
double kinetic_energy(const sample *s);
double force_seconds(const sample *s);
double assemble_seconds(const sample *s);
double factor_seconds(const sample *s);
double solve_seconds(const sample *s);
double linear_seconds(const sample *s);      /* factor and solve */
double solve_per_iteration(const sample *s); /* NAN without iterations */

enum { MOST_ROUNDS = 60 };

typedef struct contestant {
  char name[32];
  const char *family;  /* only its fastest is compared with others; usually `name` */
  const char *measure; /* such as "step" */
  /* Runs once. Returns 0 on failure and sets reason; it is then not run again. */
  int (*run)(struct contestant *c, sample *s);
  void *data;      /* for run */
  double residual; /* ||b - A dv|| / ||b|| of its solution; NAN: unknown */
  int failed;
  char reason[1024];
  int n;        /* samples; the first warms up and counts only if it is the only one */
  double spent; /* s, total wall time of its runs */
  sample samples[MOST_ROUNDS];
} contestant;

typedef struct patience {
  int most;      /* rounds after the first, at most MOST_ROUNDS - 1 */
  double budget; /* s, shared equally; a candidate stops when it has used its share */
  int rounds;    /* at least so many after the first, unless they take half of the budget */
  double until;  /* on wall_seconds' clock: no run starts after it */
} patience;

/* Times at most MOST_SERIES steps of a sim: mean, median, smallest kinetic energy. Returns 0 if a
 * step fails or the time is up before the last one, and sets err. */
enum { MOST_SERIES = 64 };
int time_series(msim_sim *sim, int steps, double until, sample *s, msim_error *err);

/* Runs all candidates in turn; every other round is in reverse order. */
void contest(contestant *all, int count, const patience *p);

/* The quantile q of n values, by linear interpolation; sorts v. */
double quantile(int n, double *v, double q);

/* Median and relative interquartile range of a candidate. */
double median_of(const contestant *c, sample_value *value);
double spread_of(const contestant *c, sample_value *value);

/* Median over the rounds of the ratio a / b; NAN: there is none. */
double median_ratio(const contestant *a, sample_value *of_a, const contestant *b,
                    sample_value *of_b);

/* Paired timing: runs two candidates alone, in turn and repeatedly, because the speed of a machine
 * drifts by more than they differ. Returns their median_ratio. a may be b; pair: their samples. */
double duel(const contestant *a, sample_value *of_a, const contestant *b, sample_value *of_b,
            const patience *p, contestant pair[2]);

/* The fastest candidate of a family that did not fail; NULL: none. */
const contestant *fastest(const contestant *all, int count, const char *family);

#endif
