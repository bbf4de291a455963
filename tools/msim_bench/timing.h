/* timing - contestants run in turn, so that what disturbs one disturbs all, compared in pairs */
#ifndef BENCH_TIMING_H
#define BENCH_TIMING_H

#include <stdint.h>

#include "msim/msim.h"

/* Do nothing for a while, so that threads that wait by spinning, as those of OpenBLAS and OpenMP
 * do, go to sleep. */
void rest_seconds(double seconds);

/* One run: seconds, and what they went into. Of a series of steps: means over it. */
typedef struct sample {
  double whole, force, assemble, factor, solve;
  double median;  /* s, of the steps of a series */
  double kinetic; /* J, the least after a step of a series: it moves */
  int64_t iterations;
} sample;

/* What is looked at of a sample. */
typedef double sample_value(const sample *s);
double whole_seconds(const sample *s);
double median_seconds(const sample *s);
double kinetic_energy(const sample *s);
double force_seconds(const sample *s);
double assemble_seconds(const sample *s);
double factor_seconds(const sample *s);
double solve_seconds(const sample *s);
double linear_seconds(const sample *s);      /* factor and solve */
double solve_per_iteration(const sample *s); /* NAN where there was none */

enum { MOST_ROUNDS = 60 };

typedef struct contestant {
  char name[32];
  const char *family;  /* only the fastest of one is compared with others; mostly its own name */
  const char *measure; /* what it is, "step" */
  /* One run. 0 where it failed, and why in reason: it takes no more part. */
  int (*run)(struct contestant *c, sample *s);
  void *data;      /* of run */
  double residual; /* of its solution, ||b - A dv|| / ||b||; NAN: not known */
  int failed;
  char reason[1024];
  int n;        /* samples; the first warms up, and counts only where it stays the only one */
  double spent; /* s, whatever they went into */
  sample samples[MOST_ROUNDS];
} contestant;

typedef struct patience {
  int most;      /* rounds beside the first, MOST_ROUNDS - 1 at most */
  double budget; /* s, shared out evenly; who has used up his share leaves */
  int rounds;    /* at least so many beside the first, unless these take half the budget */
  double until;  /* on wall_seconds' clock: nobody runs after it */
} patience;

/* Time so many steps of a sim, MOST_SERIES at most: their mean and median, and the least kinetic
 * energy. 0 where a step fails, or time is up before the last, and why in err. */
enum { MOST_SERIES = 64 };
int time_series(msim_sim *sim, int steps, double until, sample *s, msim_error *err);

/* Run all in turn, each round in the reverse order of the one before. */
void contest(contestant *all, int count, const patience *p);

/* The quantile q of n values, linear between neighbours; sorts. */
double quantile(int n, double *v, double q);

/* Quantiles of one contestant; spread: the quartiles' distance over the median. */
double median_of(const contestant *c, sample_value *value);
double spread_of(const contestant *c, sample_value *value);

/* Median of the ratios a / b of each round that both took part in; NAN: there was none. */
double median_ratio(const contestant *a, sample_value *of_a, const contestant *b,
                    sample_value *of_b);

/* Two alone, in turn and many times, as the machine's minutes differ more than they do: their
 * median_ratio. a and b may be the same; pair: what they did. */
double duel(const contestant *a, sample_value *of_a, const contestant *b, sample_value *of_b,
            const patience *p, contestant pair[2]);

/* The fastest of a family that did not fail; NULL: there is none. */
const contestant *fastest(const contestant *all, int count, const char *family);

#endif
