/* limits - how long a step of each method may be on an oscillator, and how its energy goes */
#ifndef BENCH_LIMITS_H
#define BENCH_LIMITS_H

#include "report.h"

/* Rows, and the worst that a limit or a rate of growth is off theory, which is returned. */
double measure_limits(int quick, report *r);

/* Rows of energy and momentum after 1e5 steps; quick: 1e4. */
void measure_drift(int quick, report *r);

#endif
