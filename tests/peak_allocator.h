/* peak_allocator - an allocator for tests that counts the bytes in use, and most of them so far */
#ifndef TEST_PEAK_ALLOCATOR_H
#define TEST_PEAK_ALLOCATOR_H

#include <stdlib.h>
#include <string.h>

typedef struct peak_allocator {
  size_t live, peak;
} peak_allocator;

enum { PEAK_ALLOCATOR_HEAD = 16 }; /* before each block, with its size */

static void *peak_allocator_alloc(size_t bytes, void *user) {
  peak_allocator *m = user;
  char *block = malloc(bytes + PEAK_ALLOCATOR_HEAD);
  if (!block) return NULL;
  memcpy(block, &bytes, sizeof bytes);
  m->live += bytes;
  if (m->live > m->peak) m->peak = m->live;
  return block + PEAK_ALLOCATOR_HEAD;
}

static void peak_allocator_free(void *ptr, void *user) {
  size_t bytes;
  if (!ptr) return;
  memcpy(&bytes, (char *)ptr - PEAK_ALLOCATOR_HEAD, sizeof bytes);
  ((peak_allocator *)user)->live -= bytes;
  free((char *)ptr - PEAK_ALLOCATOR_HEAD);
}

#endif
