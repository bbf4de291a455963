#include "base/buckets.h"

int ms_buckets_create(const msim_allocator *alloc, int32_t n, const int32_t *to, int32_t nbuckets,
                      ms_buckets *b) {
  *b = (ms_buckets){0};
  if (!MS_NEW(alloc, b->first, (size_t)nbuckets + 2)) return 0;
  int32_t *next = b->first + 1; /* the next place of each bucket; in the end, that of its end */
  for (int32_t k = 0; k < n; k++)
    if (to[k] >= 0) next[to[k] + 1]++;
  for (int32_t i = 1; i <= nbuckets; i++) next[i] += next[i - 1];
  if (!MS_NEW(alloc, b->item, next[nbuckets])) return 0;
  for (int32_t k = 0; k < n; k++)
    if (to[k] >= 0) b->item[next[to[k]]++] = k;
  return 1;
}

void ms_buckets_destroy(const msim_allocator *alloc, ms_buckets *b) {
  MS_FREE(alloc, b->first, b->item);
  *b = (ms_buckets){0};
}
