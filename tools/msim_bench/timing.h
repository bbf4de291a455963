/* timing - times candidates in turn, so that disturbances affect all, and compares them in pairs */
#ifndef BENCH_TIMING_H
#define BENCH_TIMING_H

#include <stdint.h>

#include "msim/msim.h"
#include "report.h"

#define NO_TIME "the time limit of the benchmark was reached"

/* Result of one run: seconds in total and by phase; means if the run is a series of steps. */
typedef struct timing_sample {
  double whole, force, assemble, factor, solve;
  double median;  /* s, over the steps of a series */
  double kinetic; /* J, the smallest after a step of a series, to show motion */
  int64_t iterations;
} timing_sample;

/* Selects one value of a sample. */
typedef double sample_value(const timing_sample *s);
double whole_seconds(const timing_sample *s);
double median_seconds(const timing_sample *s);
double kinetic_energy(const timing_sample *s);
double force_seconds(const timing_sample *s);
double assemble_seconds(const timing_sample *s);
double factor_seconds(const timing_sample *s);
double solve_seconds(const timing_sample *s);
double linear_seconds(const timing_sample *s);      /* factor and solve */
double solve_per_iteration(const timing_sample *s); /* NAN without iterations */

enum { MAX_ROUNDS = 60 };

typedef struct timing_candidate {
  char name[32];
  const char *family;  /* only its fastest is compared with others */
  const char *measure; /* such as "step" */
  /* Runs once. Returns 0 on failure and sets reason; it is then not run again. */
  int (*run)(struct timing_candidate *c, timing_sample *s);
  void *data;      /* for run */
  double residual; /* ||b - A dv|| / ||b|| of its solution; NAN: unknown */
  int failed;
  int settled; /* 1: it is not run again, as its time decides nothing */
  char reason[1024];
  int nsamples;         /* samples; the first warms up and counts only if it is the only one */
  double total_seconds; /* s, total wall time of its runs */
  timing_sample samples[MAX_ROUNDS];
} timing_candidate;

/* Sets what all candidates have; the name is copied, `family` is the copy. */
void candidate_init(timing_candidate *c, const char *name, const char *measure,
                    int (*run)(timing_candidate *c, timing_sample *s), void *data);

/* Sets the reason of a failure. Returns 0. */
int candidate_fail(timing_candidate *c, const char *why);

int has_result(const timing_candidate *c);

/* Add to a row: the median time of a candidate in `unit`, of which there are so many in a second,
 * spread and repeats; its status, and the reason or these. */
void put_times(json_t *row, const timing_candidate *c, sample_value *value, const char *unit,
               double per_second);
void put_result(json_t *row, const timing_candidate *c, const char *unit, double per_second);

typedef struct timing_limits {
  int max_rounds; /* rounds after the first, at most MAX_ROUNDS - 1 */
  double budget;  /* s, shared equally by those that run; one stops when it has used its share */
  int min_rounds; /* at least so many after the first, unless they take half of the budget */
  double until;   /* on the clock of clock_seconds: no run starts after it */
} timing_limits;

/* The same limits with this end. */
timing_limits limits_until(timing_limits p, double until);

/* Times at most MAX_SERIES steps of a sim from a state: mean, median and phases of a step, smallest
 * kinetic energy. Setting the state discards lagged factorizations, so that making them counts.
 * Fails with MSIM_STOPPED if the time is up before the last step. */
enum { MAX_SERIES = 64 };
msim_status time_steps(msim_sim *sim, const msim_state *start, int steps, double until,
                       timing_sample *s, msim_error *err);

/* Runs all candidates in turn; every other round is in reverse order. */
void time_in_turn(timing_candidate *all, int count, const timing_limits *p);

/* The quantile q of n values, by linear interpolation; sorts v. */
double quantile(int n, double *v, double q);

/* Median and relative interquartile range of a candidate. */
double median_of(const timing_candidate *c, sample_value *value);
double spread_of(const timing_candidate *c, sample_value *value);

/* Median over the rounds of the ratio a / b; NAN: there is none. */
double median_ratio(const timing_candidate *a, sample_value *of_a, const timing_candidate *b,
                    sample_value *of_b);

/* Paired timing: runs two candidates alone, in turn and repeatedly, because the speed of a machine
 * drifts by more than they differ. Returns their median_ratio. a may be b; pair: their samples. */
double time_pair(const timing_candidate *a, sample_value *of_a, const timing_candidate *b,
                 sample_value *of_b, const timing_limits *p, timing_candidate pair[2]);

/* The fastest candidate of a family that did not fail; NULL: none. */
const timing_candidate *fastest_candidate(const timing_candidate *all, int count,
                                          const char *family);

#endif
