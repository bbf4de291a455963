/* pursuit - how a method came near the solution of a step: the time to each accuracy */
#ifndef BENCH_PURSUIT_H
#define BENCH_PURSUIT_H

#include <stdint.h>

enum { ACCURACIES = 3 };
extern const double accuracies[ACCURACIES]; /* relative errors, the largest first */

typedef struct arrival {
  double seconds; /* NAN: it did not arrive */
  double error;   /* where it stopped */
  int64_t iterations;
  int rung; /* of a ladder */
} arrival;

/* How it ended. CUT_OFF: time was up, and nobody knows how much more it needs. */
enum { ARRIVED, CUT_OFF, OTHER_MINIMUM, FAILED, LEFT_OUT };

typedef struct pursuit {
  const char *name;
  arrival at[ACCURACIES];
  int end;
  double lasted;     /* s, where it was cut off */
  char reason[1024]; /* where it did not arrive */
} pursuit;

/* What a method may take. */
typedef struct allowance {
  double seconds;
  double until;     /* on wall_seconds' clock */
  double iteration; /* s, at least, of one of Newton's; 0: not known */
} allowance;

/* Newton iterations for which there is time: a step cannot be interrupted. */
int32_t affordable(const allowance *a, int32_t most);

void pursuit_begin(pursuit *p, const char *name);

/* It was there: the quickest way to each accuracy is kept. Returns whether all are reached. */
int pursuit_note(pursuit *p, const arrival *here);

/* It goes no further, and why. */
void pursuit_end(pursuit *p, int end, const char *reason);
void pursuit_cut_off(pursuit *p, double lasted);

/* Whether it may begin something, having spent so much; where not, it ends. lasted: without having
 * arrived. */
int pursuit_may_go_on(pursuit *p, const allowance *a, double spent, double lasted);

#endif
