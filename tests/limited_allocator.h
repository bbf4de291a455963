/* limited_allocator - an allocator for tests that counts blocks and fails on demand, and calls for
 * which memory runs out at each of their allocations in turn */
#ifndef TEST_LIMITED_ALLOCATOR_H
#define TEST_LIMITED_ALLOCATOR_H

#include <stdlib.h>

#include "testing.h"

typedef struct limited_allocator {
  int live;       /* blocks allocated and not freed */
  int remaining;  /* successful allocations until all fail; < 0: none fails */
  int fails_once; /* 1: after one that has failed, allocations succeed */
  int has_failed; /* 1: an allocation has failed */
} limited_allocator;

static inline void *limited_allocator_alloc(size_t bytes, void *user) {
  limited_allocator *s = user;
  if (s->remaining == 0) {
    s->has_failed = 1;
    if (s->fails_once) s->remaining = -1;
    return NULL;
  }
  s->remaining -= s->remaining > 0;
  void *block = malloc(bytes);
  s->live += block != NULL;
  return block;
}

static inline void limited_allocator_free(void *block, void *user) {
  ((limited_allocator *)user)->live -= block != NULL;
  free(block);
}

static inline msim_allocator make_limited_allocator(limited_allocator *s) {
  *s = (limited_allocator){.remaining = -1};
  return (msim_allocator){sizeof(msim_allocator), limited_allocator_alloc, limited_allocator_free,
                          s};
}

/* Each allocation of a call fails in turn, alone or with all later ones: the call reports it, and
 * leaves nothing. Returns the number of its allocations. */
static inline int expect_memory_errors(msim_status (*call)(const msim_allocator *alloc, void *data),
                                       void *data) {
  int allowed = 0;
  for (int has_failed = 1; has_failed; allowed += has_failed)
    for (int fails_once = 0; fails_once < 2; fails_once++) {
      limited_allocator memory;
      const msim_allocator alloc = make_limited_allocator(&memory);
      memory.remaining = allowed, memory.fails_once = fails_once;
      const msim_status status = call(&alloc, data);
      has_failed = memory.has_failed;
      if (status != (has_failed ? MSIM_ERR_MEMORY : MSIM_OK))
        fail_msg("allocation %d%s: status %d", allowed, fails_once ? "" : " and later ones",
                 (int)status);
      assert_int_equal(memory.live, 0);
    }
  return allowed;
}

#endif
