/* pursuit - the times at which a method reaches each accuracy of a step */
#ifndef BENCH_PURSUIT_H
#define BENCH_PURSUIT_H

#include <stdint.h>

enum { ACCURACIES = 3 };
extern const double accuracies[ACCURACIES]; /* relative errors in decreasing order */

typedef struct arrival {
  double seconds; /* NAN: the accuracy was not reached */
  double error;   /* of this iterate */
  int64_t iterations;
  int rung; /* index of newton.rtol, for Newton's method */
} arrival;

/* Why the run ended. CUT_OFF: the time was up; how much more the method needs is unknown. */
enum { ARRIVED, CUT_OFF, OTHER_MINIMUM, FAILED, LEFT_OUT };

typedef struct pursuit {
  const char *name;
  arrival at[ACCURACIES];
  int end;
  double lasted;     /* s without reaching the next accuracy, if it was cut off */
  char reason[1024]; /* why accuracies were not reached */
} pursuit;

/* Time limits of a method. */
typedef struct allowance {
  double seconds;
  double until;     /* on wall_seconds' clock */
  double iteration; /* s, lower bound for a Newton iteration; 0: unknown */
} allowance;

/* Number of Newton iterations, at most `most`, for which there is time: a step cannot be
 * interrupted. */
int32_t affordable(const allowance *a, int32_t most);

void pursuit_begin(pursuit *p, const char *name);

/* Records an iterate; each accuracy keeps the fastest. Returns whether all are reached. */
int pursuit_note(pursuit *p, const arrival *here);

/* Ends the run, with the reason. */
void pursuit_end(pursuit *p, int end, const char *reason);
void pursuit_cut_off(pursuit *p, double lasted);

/* Whether the method may continue after `spent` seconds; ends the run if not. lasted: time without
 * reaching the next accuracy. */
int pursuit_may_go_on(pursuit *p, const allowance *a, double spent, double lasted);

#endif
