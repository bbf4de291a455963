/* triad - measures the memory bandwidth by a = b + s c (STREAM triad) on arrays of a given size */
#ifndef BENCH_TRIAD_H
#define BENCH_TRIAD_H

#include <stddef.h>

typedef struct triad {
  size_t n; /* of each array */
  double *a, *b, *c;
} triad;

/* Allocates arrays of which a pass transfers `bytes`: two thirds read and one written, not counting
 * reads for ownership of written cache lines. Returns 0 if out of memory. */
int triad_make(triad *t, size_t bytes);
void triad_free(triad *t);

/* Mean time of a pass, s, on one thread or two; NAN if the second one did not start. */
double triad_seconds(const triad *t, int threads, int passes);

#endif
