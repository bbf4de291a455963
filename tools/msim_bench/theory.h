/* theory - how each method treats an oscillator: closed forms, or found from its amplification */
#ifndef BENCH_THEORY_H
#define BENCH_THEORY_H

#include "amplification.h"

enum { ZETAS = 3 };
extern const double zetas[ZETAS]; /* of critical damping: 0, 0.1, 1 */

typedef struct theory {
  const char *method;
  double limit[ZETAS];      /* of z = h w at each zeta; INFINITY: there is none */
  double (*rate)(double z); /* the logarithm of the growth of amplitude in a step, undamped */
  amplification *step;      /* in place of both */
  int undamped;             /* it is without damping only */
  double soft;              /* beside the spring of 1 N/m there are soft ones, N/m together */
} theory;

/* The i-th, NULL past the end; of a method alone on its spring, NULL where none is known. */
const theory *theory_at(int i);
const theory *theory_of(const char *method);

double theory_rate(const theory *t, double z);

/* The least z beyond which amplitudes grow by more than 1e-6 a step; 0: those at z = 0.1 do. Just
 * beyond, at *peak, they grow fastest, as some methods are stable again further on. */
double theory_limit(const theory *t, int zeta, double *peak);

#endif
