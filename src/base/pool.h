/* pool - threads that wait for work, share it and wait again
 *
 * A job consists of n items, each executed once by any thread. If items work on fixed parts of the
 * data and write to disjoint memory, results do not depend on the number of threads; for sums, each
 * item writes a partial sum, and the caller adds these in order. */
#ifndef MS_POOL_H
#define MS_POOL_H

#include "base/memory.h"

typedef struct ms_pool ms_pool;

/* Maximum number of threads. */
enum { MS_MAX_THREADS = 256 };

/* Create a pool of `threads` threads, including the caller's; fewer if not all can be started.
 * NULL: no additional thread, or out of memory; a valid pool. */
ms_pool *ms_pool_create(const msim_allocator *alloc, int32_t threads);
void ms_pool_destroy(ms_pool *pool);

/* Number of threads including the caller's; 1 for NULL. */
int32_t ms_pool_thread_count(const ms_pool *pool);

/* Executes the item with index `item`, 0 <= item < n. */
typedef void ms_pool_item(void *data, int32_t item);

/* Execute all items, in no particular order; return after the last. One call at a time per pool. In
 * the calling thread and in order if pool is NULL, or in a child process, which has no threads. */
void ms_pool_run(ms_pool *pool, ms_pool_item *work, void *data, int32_t n);

/* Executes the elements [begin, end) of a chunk. */
typedef void ms_pool_chunk(void *data, int32_t begin, int32_t end);

/* The same for n elements in chunks of `size`, the last one shorter. Returns the number of chunks;
 * that of an element is its index / size. */
int32_t ms_pool_run_chunks(ms_pool *pool, ms_pool_chunk *work, void *data, int32_t n, int32_t size);

static inline int32_t ms_pool_count_chunks(int32_t n, int32_t size) {
  return (n + size - 1) / size;
}

/* Number of cores that this thread may run on. */
int32_t ms_pool_usable_cores(void);

#endif
