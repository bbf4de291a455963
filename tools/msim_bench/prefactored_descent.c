#include "prefactored_descent.h"

#include <stdlib.h>

#include "../common/clock.h"

int descent_make(const descent_method *method, const potential *p, descent *d) {
  enum { VECTORS = 4 + 2 * (PAIRS + 1) };
  const size_t length = 3 * (size_t)p->n;
  *d = (descent){.method = method, .p = p, .length = length};
  d->all = calloc(VECTORS * length, sizeof *d->all);
  if (!d->all) return 0;
  double *next = d->all, **named[] = {&d->x, &d->gradient, &d->direction, &d->next};
  for (int i = 0; i < 4; i++, next += length) *named[i] = next;
  for (int i = 0; i <= PAIRS; i++, next += length) d->s[i] = next;
  for (int i = 0; i <= PAIRS; i++, next += length) d->y[i] = next;
  return 1;
}

void descent_free(descent *d) {
  free(d->all);
  *d = (descent){0};
}

/* Records the error of the iterate, outside the time of the method. Returns whether to continue. */
static int record_iterate(descent *d, double seconds, int64_t iterations) {
  enum { NOW_AND_THEN = 16 };
  const nonlinear_step *step = d->p->step;
  const double *v = potential_velocity(d->p, d->x);
  const iterate_record here = {
      .seconds = seconds, .error = nonlinear_step_error(step, v), .iterations = iterations};
  if (accuracy_record_add(&d->pursuit, &here)) return 0;
  if (iterations % NOW_AND_THEN != 0 || !is_another_minimum(step, v)) return 1;
  accuracy_record_end(&d->pursuit, END_OTHER_MINIMUM, "it came to another minimum");
  return 0;
}

void descent_run(descent *d, const method_limits *allowed) {
  accuracy_record *p = &d->pursuit;
  double start = clock_seconds();
  accuracy_record_begin(p, d->method->name);
  d->method->begin(d);
  double spent = clock_seconds() - start;
  for (int64_t i = 0;
       record_iterate(d, spent, i) && accuracy_record_may_continue(p, allowed, spent, spent);) {
    start = clock_seconds();
    const int found = d->method->iterate(d);
    spent += clock_seconds() - start;
    i++;
    if (found) continue;
    accuracy_record_end(p, END_FAILED, "its line search finds no lower point");
    return;
  }
}

double descent_repeat(descent *d, int64_t iterations) {
  const double start = clock_seconds();
  d->method->begin(d);
  for (int64_t i = 0; i < iterations; i++) d->method->iterate(d);
  return clock_seconds() - start;
}
