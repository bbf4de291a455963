/* incidence - lists the springs at each row, as half-edges in the order of the springs
 *
 * Half-edge 2 e is the end springs->i[e] of spring e, 2 e + 1 its end springs->j[e]; h ^ 1 is the
 * other end of the spring of h. */
#ifndef MS_INCIDENCE_H
#define MS_INCIDENCE_H

#include "base/buckets.h"
#include "layout/unknowns.h"

typedef struct ms_incidence {
  int32_t *row;  /* 2 springs->n: the row of each half-edge; -1: the spring is left out */
  ms_buckets of; /* the half-edges of each row */
} ms_incidence;

/* Springs between the rows below nrows alone. Returns 0 if memory is exhausted. */
int ms_incidence_create(const msim_allocator *alloc, const ms_springs *springs, int32_t nrows,
                        ms_incidence *incidence);
void ms_incidence_destroy(const msim_allocator *alloc, ms_incidence *incidence);

#endif
