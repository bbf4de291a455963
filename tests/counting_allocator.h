/* counting_allocator - an allocator for tests that counts calls and bytes and fails at a chosen
 * call */
#ifndef TEST_COUNTING_ALLOCATOR_H
#define TEST_COUNTING_ALLOCATOR_H

#include <stdint.h>
#include <stdlib.h>

typedef struct counting_allocator {
  int64_t calls, live, fail_at; /* fail_at: the index of the call that returns NULL; -1: none */
  size_t bytes;                 /* requested so far */
} counting_allocator;

static inline void *counting_allocator_alloc(size_t bytes, void *user) {
  counting_allocator *b = user;
  if (b->calls++ == b->fail_at) return NULL;
  b->live++, b->bytes += bytes;
  return malloc(bytes);
}

static inline void counting_allocator_free(void *ptr, void *user) {
  if (ptr) ((counting_allocator *)user)->live--;
  free(ptr);
}

#endif
