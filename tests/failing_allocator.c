#include "failing_allocator.h"

#include <errno.h>
#include <malloc.h>
#include <stdlib.h>

static _Thread_local int counting, for_good, failed;
static _Thread_local int64_t left = -1, live; /* allocations until one fails; blocks not freed */

void failing_allocator_count(int by) { counting = by; }

void failing_allocator_arm(int64_t which, int all_later) {
  left = which, for_good = all_later, failed = 0;
}

int failing_allocator_has_failed(void) { return failed; }

int64_t failing_allocator_count_leaks(void) {
  const int64_t blocks = live;
  live = 0;
  return blocks;
}

/* 0 if this allocation is to fail. */
static int is_there(int by) {
  if (counting != by || left < 0) return 1;
  if (left > 0) return left--, 1;
  failed = 1, errno = ENOMEM;
  if (!for_good) left = -1;
  return 0;
}

static void *count(int by, void *block) {
  live += counting == by && block;
  return block;
}

static void *alloc(size_t bytes, void *user) {
  (void)user;
  return is_there(FAILING_BY_ALLOCATOR) ? count(FAILING_BY_ALLOCATOR, malloc(bytes)) : NULL;
}

static void release(void *ptr, void *user) {
  (void)user;
  live -= counting == FAILING_BY_ALLOCATOR && ptr;
  free(ptr);
}

const msim_allocator *failing_allocator_get(void) {
  static const msim_allocator a = {sizeof a, alloc, release, NULL};
  return &a;
}

#if FAILING_MALLOC

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *old, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *ptr);

/* visible to all libraries of the process */
#  pragma GCC visibility push(default)
void *malloc(size_t size) {
  return is_there(FAILING_BY_MALLOC) ? count(FAILING_BY_MALLOC, __libc_malloc(size)) : NULL;
}

void *calloc(size_t n, size_t size) {
  return is_there(FAILING_BY_MALLOC) ? count(FAILING_BY_MALLOC, __libc_calloc(n, size)) : NULL;
}

void *realloc(void *old, size_t size) {
  if (!is_there(FAILING_BY_MALLOC)) return NULL;
  return old ? __libc_realloc(old, size) : count(FAILING_BY_MALLOC, __libc_malloc(size));
}

/* Never fails, as OpenMP would then end the process. */
void *memalign(size_t alignment, size_t size) {
  return count(FAILING_BY_MALLOC, __libc_memalign(alignment, size));
}

void free(void *ptr) {
  live -= counting == FAILING_BY_MALLOC && ptr;
  __libc_free(ptr);
}
#  pragma GCC visibility pop

#endif
