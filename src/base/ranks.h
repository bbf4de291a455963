/* ranks - the ranks that share a scene (msim/comm.h), as the core uses them: a failure of the
 * communicator is kept until the next agreement, so that sums need no status
 *
 * All functions are collective, and do nothing where ranks is NULL: one process without others. */
#ifndef MS_RANKS_H
#define MS_RANKS_H

#include "base/error.h"
#include "base/memory.h"
#include "msim/comm.h"

typedef struct ms_ranks {
  const msim_comm *comm;
  int32_t n, rank;
  msim_status failed;             /* of the first call that failed: there are no calls after it */
  struct ms_rank_report *reports; /* n: scratch of ms_ranks_agree_on */
} ms_ranks;

/* NULL: out of memory. */
ms_ranks *ms_ranks_create(const msim_comm *comm, const msim_allocator *alloc);
void ms_ranks_destroy(const msim_allocator *alloc, ms_ranks *ranks);

/* values[i] = their sum or maximum over all ranks; NaN after a failure of the communicator. */
void ms_ranks_sum(ms_ranks *ranks, int32_t n, double *values);
void ms_ranks_maximum(ms_ranks *ranks, int32_t n, double *values);

/* Bits that hold if they hold on all ranks, or on any rank. */
typedef struct ms_agreement {
  uint32_t all, any;
  uint32_t precedes; /* 1: a message of this rank goes before those of ranks with 0 */
} ms_agreement;

/* Returns the status of the first rank whose status is not MSIM_OK, on all ranks, with the message
 * of that rank in err; combines the bits. After a failure of the communicator: its status and
 * reason. Nullable: bits. */
msim_status ms_ranks_agree_on(ms_ranks *ranks, msim_status status, ms_agreement *bits,
                              msim_error *err);
static inline msim_status ms_ranks_agree(ms_ranks *ranks, msim_status status, msim_error *err) {
  return ranks ? ms_ranks_agree_on(ranks, status, NULL, err) : status;
}

/* The same, where a rank without memory for `what` passes fits = 0. */
static inline msim_status ms_ranks_agree_on_memory(ms_ranks *ranks, int fits, const char *what,
                                                   msim_error *err) {
  return ms_ranks_agree(ranks, fits ? MSIM_OK : ms_error_set_memory(err, what), err);
}

/* 1: the number is the same on all ranks. */
int ms_ranks_have_same(ms_ranks *ranks, uint64_t number);

/* As in msim_comm; a failure is kept for the next agreement. */
void ms_ranks_broadcast(ms_ranks *ranks, int32_t root, int64_t bytes, void *data);
void ms_ranks_gather(ms_ranks *ranks, int64_t bytes, const void *mine, void *all);
void ms_ranks_gather_parts(ms_ranks *ranks, const int64_t *bytes, const void *mine, void *all);
void ms_ranks_all_to_all(ms_ranks *ranks, const int64_t *send_bytes, const void *send,
                         const int64_t *receive_bytes, void *receive);
void ms_ranks_exchange(ms_ranks *ranks, int32_t n, const msim_comm_message *messages);

#endif
