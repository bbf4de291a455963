/* work_precision - the cost of an error with each method, at its least expensive setting
 *
 * Time and evaluations are interpolated in log-log scale between two successive settings whose
 * errors bracket the given one. A setting whose predecessor failed (or had an error above the whole
 * motion) counts with its own cost. The minimum is the result. */
#ifndef BENCH_WORK_PRECISION_H
#define BENCH_WORK_PRECISION_H

#include "setting_sweep.h"

enum { ERROR_LEVELS = 5 };
extern const double levels[ERROR_LEVELS]; /* 1e-2, 1e-4, 1e-6, 1e-8, 1e-10 */

/* Time in s and number of evaluations; NAN: the error was not reached, the method does not take
 * part, or the reference solution is not accurate enough. */
typedef struct cost {
  double seconds, evaluations;
  int first, last; /* the settings that determine it, one or two; of NAN none */
} cost;

/* m: may be NULL */
cost cost_at_error(const setting_sweep *c, const precision_method *m, double error);

/* Methods of the other library, and of msim in double and in single precision */
typedef enum method_group { LIBRARY, DOUBLE, SINGLE } method_group;

/* The fastest method of a group other than `auto`; NULL: none. */
const precision_method *fastest_method(const setting_sweep *c, method_group group, double error);

method_group group_of_method(const precision_method *m);

/* 1: at this error it takes at most 1.5 times as long as the best method of its group. */
int is_near_best(const setting_sweep *c, const precision_method *m, double error);

/* The runs that determine the cost of such methods, and of `auto`, at this error shall be repeated:
 * they are not settled any more. */
void unsettle_deciding_runs(setting_sweep *c, double error);

#endif
