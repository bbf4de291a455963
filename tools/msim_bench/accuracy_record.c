#include "accuracy_record.h"

#include <math.h>
#include <stdio.h>

#include "../common/clock.h"
#include "../common/interrupt.h"
#include "timing.h"

const double accuracies[ACCURACIES] = {1e-2, 1e-4, 1e-6};

void accuracy_record_begin(accuracy_record *p, const char *name) {
  *p = (accuracy_record){.name = name, .end = END_REACHED};
  for (int a = 0; a < ACCURACIES; a++) p->reached[a].seconds = NAN;
}

int32_t affordable_iterations(const method_limits *a, int32_t most) {
  if (a->iteration <= 0) return most;
  const double left = fmin(a->seconds, a->until - clock_seconds());
  return (int32_t)fmax(1, fmin(most, left / a->iteration));
}

int accuracy_record_add(accuracy_record *p, const iterate_record *here) {
  for (int a = 0; a < ACCURACIES; a++)
    if (here->error < accuracies[a] && !(p->reached[a].seconds <= here->seconds))
      p->reached[a] = *here;
  return here->error < accuracies[ACCURACIES - 1];
}

void accuracy_record_end(accuracy_record *p, int end, const char *reason) {
  p->end = end;
  snprintf(p->reason, sizeof p->reason, "%s", reason);
}

void accuracy_record_cut_off(accuracy_record *p, double lasted) {
  char reason[80];
  snprintf(reason, sizeof reason, "aborted after %.3g s (time limit)", lasted);
  accuracy_record_end(p, END_CUT_OFF, reason);
  p->seconds_unreached = lasted;
}

int accuracy_record_may_continue(accuracy_record *p, const method_limits *a, double spent,
                                 double lasted) {
  if (is_interrupted() || clock_seconds() > a->until) accuracy_record_end(p, END_SKIPPED, NO_TIME);
  else if (spent > a->seconds) accuracy_record_cut_off(p, lasted);
  return p->end == END_REACHED;
}
