/* counted_memory - an allocator for several threads that counts the bytes in use and their peak */
#ifndef BENCH_COUNTED_MEMORY_H
#define BENCH_COUNTED_MEMORY_H

#include <stdatomic.h>
#include <stdint.h>

#include "msim/msim.h"

typedef struct counted_memory {
  msim_allocator allocator;
  _Atomic int64_t bytes, peak;
} counted_memory;

void counted_memory_begin(counted_memory *m);

#endif
