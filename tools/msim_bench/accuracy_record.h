/* accuracy_record - the times at which a method reaches each accuracy of a step */
#ifndef BENCH_ACCURACY_RECORD_H
#define BENCH_ACCURACY_RECORD_H

#include <stdint.h>

enum { ACCURACIES = 3 };
extern const double accuracies[ACCURACIES]; /* relative errors in decreasing order */

typedef struct iterate_record {
  double seconds; /* NAN: the accuracy was not reached */
  double error;   /* of this iterate */
  int64_t iterations;
  int setting; /* index of newton.rtol, for Newton's method */
} iterate_record;

/* Why the run ended. END_CUT_OFF: the time was up; how much more the method needs is unknown. */
enum { END_REACHED, END_CUT_OFF, END_OTHER_MINIMUM, END_FAILED, END_SKIPPED };

typedef struct accuracy_record {
  const char *name;
  iterate_record reached[ACCURACIES];
  int end;
  double seconds_unreached; /* s without reaching the next accuracy, if it was cut off */
  char reason[1024];        /* why accuracies were not reached */
} accuracy_record;

/* Time limits of a method. */
typedef struct method_limits {
  double seconds;
  double until;     /* on the clock of clock_seconds */
  double iteration; /* s, lower bound for a Newton iteration; 0: unknown */
} method_limits;

/* Number of Newton iterations, at most `most`, for which there is time: a step cannot be
 * interrupted. */
int32_t affordable_iterations(const method_limits *a, int32_t most);

void accuracy_record_begin(accuracy_record *p, const char *name);

/* Records an iterate; each accuracy keeps the fastest. Returns whether all are reached. */
int accuracy_record_add(accuracy_record *p, const iterate_record *here);

/* Ends the run, with the reason. */
void accuracy_record_end(accuracy_record *p, int end, const char *reason);
void accuracy_record_cut_off(accuracy_record *p, double lasted);

/* Whether the method may continue after `spent` seconds; ends the run if not. lasted: time without
 * reaching the next accuracy. */
int accuracy_record_may_continue(accuracy_record *p, const method_limits *a, double spent,
                                 double lasted);

#endif
