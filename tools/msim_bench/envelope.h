/* envelope - the cost of an error with each method, at its least expensive setting
 *
 * Time and evaluations are interpolated in log-log scale between two successive settings whose
 * errors bracket the given one. A setting whose predecessor failed (or had an error above the whole
 * motion) counts with its own cost. The minimum is the result. */
#ifndef BENCH_ENVELOPE_H
#define BENCH_ENVELOPE_H

#include "climb.h"

enum { LEVELS = 5 };
extern const double levels[LEVELS]; /* 1e-2, 1e-4, 1e-6, 1e-8, 1e-10 */

/* Time in s and number of evaluations; NAN: the error was not reached, the method does not take
 * part, or the reference solution is not accurate enough. */
typedef struct cost {
  double seconds, evaluations;
} cost;

/* who: may be NULL */
cost cost_of(const climb *c, const entrant *who, double error);

/* The fastest method of msim other than `auto`, or of the other library; NULL: none. */
const entrant *cheapest(const climb *c, int of_msim, double error);

#endif
