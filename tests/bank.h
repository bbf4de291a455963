/* bank - an allocator that counts, and runs out of memory when it is told to */
#ifndef TEST_BANK_H
#define TEST_BANK_H

#include <stdint.h>
#include <stdlib.h>

typedef struct bank {
  int64_t calls, live, fail_at; /* fail_at: the call that finds no memory; -1: none */
  size_t bytes;                 /* asked for so far */
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
