/* triad - how fast memory is: a = b + s c over arrays of a given size */
#ifndef BENCH_TRIAD_H
#define BENCH_TRIAD_H

#include <stddef.h>

typedef struct triad {
  size_t n; /* of each array */
  double *a, *b, *c;
} triad;

/* Arrays that one pass moves `bytes` of, two thirds read and one written, without what a cache
 * reads to write into. 0 where there is no memory. */
int triad_make(triad *t, size_t bytes);
void triad_free(triad *t);

/* Seconds of one pass, the mean of so many, shared by one thread or two; NAN where the second did
 * not start. */
double triad_seconds(const triad *t, int threads, int passes);

#endif
