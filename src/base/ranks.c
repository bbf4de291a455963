#include "base/ranks.h"

#include <math.h>
#include <string.h>

/* What each rank sends to the others */
typedef struct ms_rank_report {
  msim_status status;
  ms_agreement bits;
} ms_rank_report;

ms_ranks *ms_ranks_create(const msim_comm *comm, const msim_allocator *alloc) {
  ms_ranks *ranks = ms_memory_allocate(alloc, 1, sizeof *ranks);
  if (!ranks) return NULL;
  *ranks = (ms_ranks){.comm = comm, .n = comm->nranks, .rank = comm->rank};
  if (MS_NEW(alloc, ranks->reports, ranks->n)) return ranks;
  ms_memory_free(alloc, ranks);
  return NULL;
}

void ms_ranks_destroy(const msim_allocator *alloc, ms_ranks *ranks) {
  if (ranks) MS_FREE(alloc, ranks->reports, ranks);
}

static void keep_failure(ms_ranks *ranks, msim_status status) {
  if (!ranks->failed) ranks->failed = status;
}

typedef msim_status reduction(void *self, int32_t n, double *values);

static void reduce(ms_ranks *ranks, reduction *function, int32_t n, double *values) {
  enum { MOST = 64 }; /* of a call, as comm.h guarantees */
  for (int32_t i = 0; i < n && !ranks->failed; i += n - i < MOST ? n - i : MOST)
    keep_failure(ranks, function(ranks->comm->self, n - i < MOST ? n - i : MOST, values + i));
  for (int32_t i = 0; i < n && ranks->failed; i++) values[i] = NAN;
}

void ms_ranks_sum(ms_ranks *ranks, int32_t n, double *values) {
  if (ranks) reduce(ranks, ranks->comm->sum, n, values);
}

void ms_ranks_maximum(ms_ranks *ranks, int32_t n, double *values) {
  if (ranks) reduce(ranks, ranks->comm->maximum, n, values);
}

static msim_status report_failure(const ms_ranks *ranks, msim_error *err) {
  return ms_error_set(err, ranks->failed, "communicator '%s': %s; create a new sim",
                      ranks->comm->name, ranks->comm->reason(ranks->comm->self));
}

/* Pass the message of the first rank that failed to all others. */
static msim_status share_message(ms_ranks *ranks, int32_t root, msim_error *err) {
  msim_error message = {.status = ranks->reports[root].status};
  const msim_comm *c = ranks->comm;
  if (root == ranks->rank && err) message = *err;
  message.text[MS_ERROR_LENGTH - 1] = 0;
  keep_failure(ranks, c->broadcast(c->self, root, sizeof message.text, message.text));
  if (ranks->failed) return report_failure(ranks, err);
  message.status = ranks->reports[root].status;
  if (root == ranks->rank) return message.status;
  return ms_error_set(err, message.status, "%s",
                      *message.text ? message.text : msim_status_text(message.status));
}

msim_status ms_ranks_agree_on(ms_ranks *ranks, msim_status status, ms_agreement *bits,
                              msim_error *err) {
  if (!ranks) return status;
  ms_rank_report *all = ranks->reports, own = {.status = status};
  int32_t root = -1;
  if (bits) own.bits = *bits;
  if (!ranks->failed)
    keep_failure(ranks, ranks->comm->gather(ranks->comm->self, sizeof own, &own, all));
  if (ranks->failed) return report_failure(ranks, err);
  for (int32_t r = 0; r < ranks->n; r++) {
    if (bits) bits->all &= all[r].bits.all, bits->any |= all[r].bits.any;
    if (all[r].status && (root < 0 || all[r].bits.precedes > all[root].bits.precedes)) root = r;
  }
  return root < 0 ? MSIM_OK : share_message(ranks, root, err);
}

/* The upper and lower 32 bits are exact as doubles: ranks have the same number where maximum and
 * minimum of both are equal. */
int ms_ranks_have_same(ms_ranks *ranks, uint64_t number) {
  const double high = (double)(number >> 32), low = (double)(number & UINT32_MAX);
  double most[] = {high, low, -high, -low};
  ms_ranks_maximum(ranks, 4, most);
  return most[0] == -most[2] && most[1] == -most[3];
}

void ms_ranks_broadcast(ms_ranks *ranks, int32_t root, int64_t bytes, void *data) {
  if (ranks && !ranks->failed)
    keep_failure(ranks, ranks->comm->broadcast(ranks->comm->self, root, bytes, data));
}

void ms_ranks_gather(ms_ranks *ranks, int64_t bytes, const void *mine, void *all) {
  const msim_comm *c = ranks->comm;
  if (!ranks->failed) keep_failure(ranks, c->gather(c->self, bytes, mine, all));
}

void ms_ranks_gather_parts(ms_ranks *ranks, const int64_t *bytes, const void *mine, void *all) {
  const msim_comm *c = ranks->comm;
  if (!ranks->failed) keep_failure(ranks, c->gather_parts(c->self, bytes, mine, all));
}

void ms_ranks_all_to_all(ms_ranks *ranks, const int64_t *send_bytes, const void *send,
                         const int64_t *receive_bytes, void *receive) {
  const msim_comm *c = ranks->comm;
  if (!ranks->failed)
    keep_failure(ranks, c->all_to_all(c->self, send_bytes, send, receive_bytes, receive));
}

void ms_ranks_exchange(ms_ranks *ranks, int32_t n, const msim_comm_message *messages) {
  const msim_comm *c = ranks->comm;
  if (!ranks->failed) keep_failure(ranks, c->exchange_begin(c->self, n, messages));
  if (!ranks->failed) keep_failure(ranks, c->exchange_end(c->self));
}
