/* failing_comm - a communicator for tests of which one call fails: results of it are large numbers
 * on all ranks, as they are undefined */
#ifndef TEST_FAILING_COMM_H
#define TEST_FAILING_COMM_H

#include <string.h>

#include "msim/comm.h"

typedef struct failing_comm {
  msim_comm table;        /* first: a pointer to it is one to the whole */
  msim_comm *inner;       /* of msim_comm_threads_create */
  int64_t calls, fail_at; /* fail_at: the index of the call that fails; -1: none */
} failing_comm;

/* All ranks make the calls of `inner`, which fail once this one has failed. */
static inline const msim_comm *failing_comm_call(failing_comm *c) {
  if (c->calls++ == c->fail_at) msim_comm_threads_fail(c->inner, "the network is down");
  return c->inner;
}

static inline msim_status failing_comm_end(msim_status status, int64_t bytes, void *results) {
  if (status && bytes > 0) memset(results, 0x7f, (size_t)bytes);
  return status;
}

static msim_status failing_comm_sum(void *self, int32_t n, double *values) {
  const msim_comm *c = failing_comm_call(self);
  return failing_comm_end(c->sum(c->self, n, values), n * (int64_t)sizeof *values, values);
}

static msim_status failing_comm_maximum(void *self, int32_t n, double *values) {
  const msim_comm *c = failing_comm_call(self);
  return failing_comm_end(c->maximum(c->self, n, values), n * (int64_t)sizeof *values, values);
}

static msim_status failing_comm_gather(void *self, int64_t bytes, const void *mine, void *all) {
  const msim_comm *c = failing_comm_call(self);
  return failing_comm_end(c->gather(c->self, bytes, mine, all), bytes * c->nranks, all);
}

static msim_status failing_comm_gather_parts(void *self, const int64_t *bytes, const void *mine,
                                             void *all) {
  const msim_comm *c = failing_comm_call(self);
  int64_t sum = 0;
  for (int32_t r = 0; r < c->nranks; r++) sum += bytes[r];
  return failing_comm_end(c->gather_parts(c->self, bytes, mine, all), sum, all);
}

static msim_status failing_comm_broadcast(void *self, int32_t root, int64_t bytes, void *data) {
  const msim_comm *c = failing_comm_call(self);
  return failing_comm_end(c->broadcast(c->self, root, bytes, data), bytes, data);
}

static msim_status failing_comm_all_to_all(void *self, const int64_t *send_bytes, const void *send,
                                           const int64_t *receive_bytes, void *receive) {
  const msim_comm *c = failing_comm_call(self);
  int64_t bytes = 0;
  for (int32_t r = 0; r < c->nranks; r++) bytes += receive_bytes[r];
  return failing_comm_end(c->all_to_all(c->self, send_bytes, send, receive_bytes, receive), bytes,
                          receive);
}

static msim_status failing_comm_begin(void *self, int32_t n, const msim_comm_message *messages) {
  const msim_comm *c = ((failing_comm *)self)->inner;
  return c->exchange_begin(c->self, n, messages);
}

static msim_status failing_comm_exchange(void *self) {
  const msim_comm *c = failing_comm_call(self);
  return c->exchange_end(c->self);
}

static const char *failing_comm_reason(void *self) {
  const msim_comm *c = ((failing_comm *)self)->inner;
  return c->reason(c->self);
}

/* self has to be set to its address. */
static inline failing_comm failing_comm_of(msim_comm *inner, int64_t fail_at) {
  failing_comm c = {.table = *inner, .inner = inner, .fail_at = fail_at};
  c.table.sum = failing_comm_sum, c.table.maximum = failing_comm_maximum;
  c.table.gather = failing_comm_gather, c.table.broadcast = failing_comm_broadcast;
  c.table.gather_parts = failing_comm_gather_parts;
  c.table.all_to_all = failing_comm_all_to_all;
  c.table.exchange_begin = failing_comm_begin, c.table.exchange_end = failing_comm_exchange;
  c.table.reason = failing_comm_reason;
  return c;
}

#endif
