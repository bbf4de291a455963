/* envelope - what an error costs by each method, whichever of its settings is the cheapest
 *
 * Between two successive rungs of a ladder, one above the error and one not, time and evaluations
 * are interpolated in log-log. A rung that nothing brackets, as the one before it failed or was off
 * by more than the whole motion, costs what it cost. The cheapest of all these counts. */
#ifndef BENCH_ENVELOPE_H
#define BENCH_ENVELOPE_H

#include "climb.h"

enum { LEVELS = 5 };
extern const double levels[LEVELS]; /* 1e-2, 1e-4, 1e-6, 1e-8, 1e-10 */

/* s and evaluations; NAN: it did not come to it, takes no part, or the truth is not known well
 * enough. */
typedef struct cost {
  double seconds, evaluations;
} cost;

/* who: nullable */
cost cost_of(const climb *c, const entrant *who, double error);

/* The cheapest method of msim but `auto`, or of the library; NULL: none came to it. */
const entrant *cheapest(const climb *c, int of_msim, double error);

#endif
