#include "prefactored_descent.h"

#include <stdlib.h>

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
