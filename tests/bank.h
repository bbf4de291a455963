/* bank - an allocator for tests that counts calls and bytes and fails at a chosen call */
#ifndef TEST_BANK_H
#define TEST_BANK_H

#include <stdint.h>
#include <stdlib.h>

typedef struct bank {
  int64_t calls, live, fail_at; /* fail_at: the index of the call that returns NULL; -1: none */
  size_t bytes;                 /* requested so far */
} bank;

static void *bank_alloc(size_t bytes, void *user) {
  bank *b = user;
  if (b->calls++ == b->fail_at) return NULL;
  b->live++, b->bytes += bytes;
  return malloc(bytes);
}

static void bank_free(void *ptr, void *user) {
  if (ptr) ((bank *)user)->live--;
  free(ptr);
}

#endif
