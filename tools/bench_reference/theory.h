/* theory - stability limit and growth rate of each method on an oscillator, in closed form or from
 * its amplification */
#ifndef BENCH_THEORY_H
#define BENCH_THEORY_H

#include "amplification.h"

enum { DAMPING_RATIOS = 3 };
extern const double zetas[DAMPING_RATIOS]; /* damping ratios 0, 0.1, 1 */

typedef struct theory {
  const char *method;
  double limit[DAMPING_RATIOS]; /* of z = h w at each damping ratio; INFINITY: none */
  double (*rate)(double z);     /* growth rate: ln of the amplification per step, undamped */
  amplification_step *step;     /* replaces limit and rate */
  int undamped;                 /* valid without damping only */
  double soft;                  /* soft springs beside the one of 1 N/m, N/m in total */
} theory;

/* The i-th entry; NULL past the end. The entry of a method on a single spring; NULL: none. */
const theory *theory_at(int i);
const theory *theory_find(const char *method);

double theory_rate(const theory *t, double z);

/* The smallest z beyond which the amplitude grows by more than 1e-6 a step; 0: it does at z = 0.1.
 * *peak: the z above it with the fastest growth, as some methods are stable again further on. */
double theory_limit(const theory *t, int zeta, double *peak);

#endif
