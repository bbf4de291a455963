/* buckets - sorts items by an integer: a stable counting sort */
#ifndef MS_BUCKETS_H
#define MS_BUCKETS_H

#include "base/memory.h"

/* Bucket b holds item[first[b]] ... item[first[b + 1] - 1]. */
typedef struct ms_buckets {
  int32_t *first, *item;
} ms_buckets;

/* Put the items 0 to n - 1 into nbuckets buckets, in their order; to: n, the bucket of each,
 * negative: none. Returns 0 if memory is exhausted. */
int ms_buckets_create(const msim_allocator *alloc, int32_t n, const int32_t *to, int32_t nbuckets,
                      ms_buckets *buckets);
void ms_buckets_destroy(const msim_allocator *alloc, ms_buckets *buckets);

#endif
