#include "pursuit.h"

#include <math.h>
#include <stdio.h>

#include "../common/clock.h"
#include "interrupt.h"

const double accuracies[ACCURACIES] = {1e-2, 1e-4, 1e-6};

void pursuit_begin(pursuit *p, const char *name) {
  *p = (pursuit){.name = name, .end = ARRIVED};
  for (int a = 0; a < ACCURACIES; a++) p->at[a].seconds = NAN;
}

int32_t affordable(const allowance *a, int32_t most) {
  if (a->iteration <= 0) return most;
  const double left = fmin(a->seconds, a->until - wall_seconds());
  return (int32_t)fmax(1, fmin(most, left / a->iteration));
}

int pursuit_note(pursuit *p, const arrival *here) {
  for (int a = 0; a < ACCURACIES; a++)
    if (here->error < accuracies[a] && !(p->at[a].seconds <= here->seconds)) p->at[a] = *here;
  return here->error < accuracies[ACCURACIES - 1];
}

void pursuit_end(pursuit *p, int end, const char *reason) {
  p->end = end;
  snprintf(p->reason, sizeof p->reason, "%s", reason);
}

void pursuit_cut_off(pursuit *p, double lasted) {
  char reason[80];
  snprintf(reason, sizeof reason, "cut off after %.3g s", lasted);
  pursuit_end(p, CUT_OFF, reason);
  p->lasted = lasted;
}

int pursuit_may_go_on(pursuit *p, const allowance *a, double spent, double lasted) {
  if (is_interrupted() || wall_seconds() > a->until)
    pursuit_end(p, LEFT_OUT, "there was no time left");
  else if (spent > a->seconds) pursuit_cut_off(p, lasted);
  return p->end == ARRIVED;
}
