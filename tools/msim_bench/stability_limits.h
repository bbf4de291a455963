/* stability_limits - measures the longest stable step of each method on an oscillator, and the
 * drift of energy and momentum */
#ifndef BENCH_STABILITY_LIMITS_H
#define BENCH_STABILITY_LIMITS_H

#include "report.h"

/* Writes a row for each method and damping ratio. Returns the largest deviation from theory. */
double measure_limits(int quick, report *r);

/* Writes rows of energy and momentum after 1e5 steps; quick: 1e4. */
void measure_drift(int quick, report *r);

#endif
