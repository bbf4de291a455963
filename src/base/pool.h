/* pool - threads that wait for work, share it out and wait again
 *
 * Work is n items, each done once, by whichever thread. Where items are fixed parts of the data and
 * write to places of their own, no bit depends on the number of threads; sums are made by the
 * caller over one partial sum an item. */
#ifndef MS_POOL_H
#define MS_POOL_H

#include "base/memory.h"

typedef struct ms_pool ms_pool;

/* More threads than this are never started. */
enum { MS_MOST_THREADS = 256 };

/* A pool of `threads`, the caller's being one of them; of fewer where not all can be started. NULL:
 * of the caller alone, which needs no pool. */
ms_pool *ms_pool_create(const msim_allocator *alloc, int32_t threads);
void ms_pool_destroy(ms_pool *pool);

/* With that of the caller; 1 for NULL. */
int32_t ms_pool_threads(const ms_pool *pool);

/* Do item `item` of [0, n). */
typedef void ms_item(void *data, int32_t item);

/* All items, in no order; returns when the last is done. One call at a time for one pool. NULL: the
 * caller does them, in order; so it does in a child process, where the pool's threads are not. */
void ms_pool_run(ms_pool *pool, ms_item *work, void *data, int32_t n);

/* The cores that this thread may run on. */
int32_t ms_usable_cores(void);

#endif
