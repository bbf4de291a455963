#include "counted_memory.h"

#include <stddef.h>
#include <stdlib.h>

/* In front of each block: its size, in a unit that keeps blocks aligned */
typedef union block_header {
  size_t bytes;
  max_align_t unit;
} block_header;

static void *allocate_counted(size_t bytes, void *user) {
  counted_memory *m = user;
  block_header *block = bytes <= SIZE_MAX - sizeof *block ? malloc(sizeof *block + bytes) : NULL;
  if (!block) return NULL;
  block->bytes = bytes;
  const int64_t now = atomic_fetch_add(&m->bytes, (int64_t)bytes) + (int64_t)bytes;
  int64_t peak = atomic_load(&m->peak);
  while (peak < now && !atomic_compare_exchange_weak(&m->peak, &peak, now)) continue;
  return block + 1;
}

static void free_counted(void *ptr, void *user) {
  counted_memory *m = user;
  if (!ptr) return;
  block_header *block = (block_header *)ptr - 1;
  atomic_fetch_sub(&m->bytes, (int64_t)block->bytes);
  free(block);
}

void counted_memory_begin(counted_memory *m) {
  atomic_init(&m->bytes, 0);
  atomic_init(&m->peak, 0);
  m->allocator = (msim_allocator){
      .size = sizeof m->allocator, .alloc = allocate_counted, .free = free_counted, .user = m};
}
