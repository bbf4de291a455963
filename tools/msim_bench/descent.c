#include "descent.h"

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
static int look(descent *d, double seconds, int64_t iterations) {
  enum { NOW_AND_THEN = 16 };
  const nonlinear_step *step = d->p->step;
  const double *v = potential_velocity(d->p, d->x);
  const arrival here = {
      .seconds = seconds, .error = nonlinear_error(step, v), .iterations = iterations};
  if (pursuit_note(&d->pursuit, &here)) return 0;
  if (iterations % NOW_AND_THEN != 0 || !is_another_minimum(step, v)) return 1;
  pursuit_end(&d->pursuit, OTHER_MINIMUM, "it came to another minimum");
  return 0;
}

void descent_pursue(descent *d, const allowance *allowed) {
  pursuit *p = &d->pursuit;
  double start = wall_seconds();
  pursuit_begin(p, d->method->name);
  d->method->begin(d);
  double spent = wall_seconds() - start;
  for (int64_t i = 0; look(d, spent, i) && pursuit_may_go_on(p, allowed, spent, spent);) {
    start = wall_seconds();
    const int found = d->method->iterate(d);
    spent += wall_seconds() - start;
    i++;
    if (found) continue;
    pursuit_end(p, FAILED, "its line search finds no lower point");
    return;
  }
}

double descent_repeat(descent *d, int64_t iterations) {
  const double start = wall_seconds();
  d->method->begin(d);
  for (int64_t i = 0; i < iterations; i++) d->method->iterate(d);
  return wall_seconds() - start;
}
