#include "counting_comm.h"

static msim_status count_sum(void *self, int32_t n, double *values) {
  counting_comm *c = self;
  c->counts.collectives++;
  return c->inner->sum(c->inner->self, n, values);
}

static msim_status count_maximum(void *self, int32_t n, double *values) {
  counting_comm *c = self;
  c->counts.collectives++;
  return c->inner->maximum(c->inner->self, n, values);
}

static msim_status count_gather(void *self, int64_t bytes, const void *mine, void *all) {
  counting_comm *c = self;
  c->counts.collectives++;
  return c->inner->gather(c->inner->self, bytes, mine, all);
}

static msim_status count_gather_parts(void *self, const int64_t *bytes, const void *mine,
                                      void *all) {
  counting_comm *c = self;
  int64_t most = 0, sum = 0;
  for (int32_t r = 0; r < c->table.nranks; r++) {
    sum += bytes[r];
    if (bytes[r] > most) most = bytes[r];
  }
  c->counts.collectives++;
  c->counts.largest_over_mean = sum ? (double)most * c->table.nranks / (double)sum : 1;
  return c->inner->gather_parts(c->inner->self, bytes, mine, all);
}

static msim_status count_broadcast(void *self, int32_t root, int64_t bytes, void *data) {
  counting_comm *c = self;
  c->counts.collectives++;
  return c->inner->broadcast(c->inner->self, root, bytes, data);
}

static msim_status count_all_to_all(void *self, const int64_t *send_bytes, const void *send,
                                    const int64_t *receive_bytes, void *receive) {
  counting_comm *c = self;
  c->counts.collectives++;
  return c->inner->all_to_all(c->inner->self, send_bytes, send, receive_bytes, receive);
}

static msim_status count_exchange(void *self, int32_t n, const msim_comm_message *messages) {
  counting_comm *c = self;
  c->counts.exchanges++;
  for (int32_t i = 0; i < n; i++) c->counts.bytes += messages[i].send_bytes;
  return c->inner->exchange_begin(c->inner->self, n, messages);
}

static msim_status end_counted_exchange(void *self) {
  const counting_comm *c = self;
  return c->inner->exchange_end(c->inner->self);
}

static const char *reason_of_inner(void *self) {
  const counting_comm *c = self;
  return c->inner->reason(c->inner->self);
}

void counting_comm_make(const msim_comm *inner, counting_comm *c) {
  const size_t with_handle = offsetof(msim_comm, handle) + sizeof inner->handle;
  *c = (counting_comm){.inner = inner,
                       .table = {.abi = MSIM_COMM_ABI,
                                 .size = sizeof(msim_comm),
                                 .name = inner->name,
                                 .nranks = inner->nranks,
                                 .rank = inner->rank,
                                 .self = c,
                                 .sum = count_sum,
                                 .maximum = count_maximum,
                                 .gather = count_gather,
                                 .gather_parts = count_gather_parts,
                                 .broadcast = count_broadcast,
                                 .all_to_all = count_all_to_all,
                                 .exchange_begin = count_exchange,
                                 .exchange_end = end_counted_exchange,
                                 .reason = reason_of_inner,
                                 .handle = inner->size >= with_handle ? inner->handle : NULL}};
}
