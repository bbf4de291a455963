/* comm_contract - what comm.h promises, checked by every rank of a communicator on messages of its
 * own making; a failure returns a sentence, so that threads other than the test's may run it */
#ifndef TEST_COMM_CONTRACT_H
#define TEST_COMM_CONTRACT_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msim/comm.h"

#define COMM_EXPECT(condition) \
  if (!(condition)) return "not true: " #condition

/* Byte `at` of a message from p to q; never that of another pair by chance for long */
static unsigned char comm_byte(int32_t p, int32_t q, int64_t at) {
  return (unsigned char)(31 * p + 17 * q + 7 * at + at / 251);
}

static void comm_fill(unsigned char *to, int32_t p, int32_t q, int64_t bytes) {
  for (int64_t i = 0; i < bytes; i++) to[i] = comm_byte(p, q, i);
}

static int comm_is_filled(const unsigned char *from, int32_t p, int32_t q, int64_t bytes) {
  for (int64_t i = 0; i < bytes; i++)
    if (from[i] != comm_byte(p, q, i)) return 0;
  return 1;
}

/* Numbers whose sum depends on its order */
static double comm_number(int32_t rank, int32_t i) {
  return ldexp(1 + rank / 7.0, 9 * rank % 40 - i);
}

static const char *comm_check_sums(const msim_comm *c) {
  double values[5], again[5], all[5 * 64], most[5];
  for (int32_t i = 0; i < 5; i++) values[i] = again[i] = most[i] = comm_number(c->rank, i);
  COMM_EXPECT(c->nranks <= 64);
  COMM_EXPECT(c->sum(c->self, 5, values) == MSIM_OK && c->sum(c->self, 5, again) == MSIM_OK);
  COMM_EXPECT(memcmp(values, again, sizeof values) == 0);
  COMM_EXPECT(c->gather(c->self, sizeof values, values, all) == MSIM_OK);
  for (int32_t r = 0; r < c->nranks; r++)
    COMM_EXPECT(memcmp(all + 5 * r, values, sizeof values) == 0); /* the same on every rank */
  for (int32_t i = 0; i < 5; i++) {
    long double sum = 0, size = 0;
    for (int32_t r = 0; r < c->nranks; r++) sum += comm_number(r, i), size += comm_number(r, i);
    COMM_EXPECT(fabsl(values[i] - sum) <= c->nranks * 0x1p-53L * size);
  }
  most[1] = c->rank == c->nranks - 1 ? NAN : 1;
  COMM_EXPECT(c->maximum(c->self, 5, most) == MSIM_OK);
  double largest = 0;
  for (int32_t r = 0; r < c->nranks; r++) largest = fmax(largest, comm_number(r, 0));
  COMM_EXPECT(most[0] == largest && isnan(most[1]));
  return NULL;
}

/* Rank r gives 1000 r + 3 bytes, and rank 1 none */
static int64_t comm_length(int32_t r) { return r == 1 ? 0 : 1000 * (int64_t)r + 3; }

static const char *comm_check_gathers(const msim_comm *c) {
  int64_t bytes[64], sum = 0;
  for (int32_t r = 0; r < c->nranks; r++) sum += bytes[r] = comm_length(r);
  unsigned char *mine = malloc((size_t)sum + 100), *all = malloc((size_t)sum + 100), *at = all;
  COMM_EXPECT(mine && all);
  comm_fill(mine, c->rank, 0, bytes[c->rank]);
  COMM_EXPECT(c->gather_parts(c->self, bytes, mine, all) == MSIM_OK);
  for (int32_t r = 0; r < c->nranks; at += bytes[r++])
    COMM_EXPECT(comm_is_filled(at, r, 0, bytes[r]));
  for (int32_t root = 0; root < c->nranks; root++) {
    comm_fill(mine, c->rank, 1, 100);
    COMM_EXPECT(c->broadcast(c->self, root, 100, mine) == MSIM_OK);
    COMM_EXPECT(comm_is_filled(mine, root, 1, 100));
  }
  free(mine), free(all);
  return NULL;
}

static int64_t comm_pair_length(int32_t p, int32_t q) { return (5 * p + 3 * q) % 11 * 100; }

static const char *comm_check_all_to_all(const msim_comm *c) {
  int64_t send[64], receive[64];
  unsigned char *out = malloc(64 * 1000), *in = malloc(64 * 1000), *at = out;
  COMM_EXPECT(out && in);
  for (int32_t r = 0; r < c->nranks; at += send[r++]) {
    send[r] = comm_pair_length(c->rank, r), receive[r] = comm_pair_length(r, c->rank);
    comm_fill(at, c->rank, r, send[r]);
  }
  COMM_EXPECT(c->all_to_all(c->self, send, out, receive, in) == MSIM_OK);
  at = in;
  for (int32_t r = 0; r < c->nranks; at += receive[r++])
    COMM_EXPECT(comm_is_filled(at, r, c->rank, receive[r]));
  free(out), free(in);
  return NULL;
}

/* Round k: p and q are neighbours if p + q + k is not a multiple of 3, so that some have none */
static const char *comm_check_exchange(const msim_comm *c, int32_t k) {
  msim_comm_message m[64];
  unsigned char *out = malloc(64 * 1000), *in = calloc(64, 1000);
  int32_t n = 0;
  COMM_EXPECT(out && in);
  for (int32_t q = 0; q < c->nranks; q++) {
    if (q == c->rank || (c->rank + q + k) % 3 == 0) continue;
    m[n] = (msim_comm_message){.rank = q,
                               .send_bytes = comm_pair_length(c->rank, q),
                               .receive_bytes = comm_pair_length(q, c->rank),
                               .send = out + 1000 * q,
                               .receive = in + 1000 * q};
    comm_fill(out + 1000 * q, c->rank, q + k, m[n++].send_bytes);
  }
  COMM_EXPECT(c->exchange_begin(c->self, n, m) == MSIM_OK);
  COMM_EXPECT(c->exchange_end(c->self) == MSIM_OK);
  for (int32_t i = 0; i < n; i++)
    COMM_EXPECT(comm_is_filled(in + 1000 * m[i].rank, m[i].rank, c->rank + k, m[i].receive_bytes));
  free(out), free(in);
  return NULL;
}

/* Everything, `rounds` times; NULL: as promised. Up to 64 ranks. */
static const char *comm_check_contract(const msim_comm *c, int32_t rounds) {
  const char *wrong = NULL;
  for (int32_t k = 0; k < rounds && !wrong; k++) {
    wrong = comm_check_sums(c);
    if (!wrong) wrong = comm_check_gathers(c);
    if (!wrong) wrong = comm_check_all_to_all(c);
    if (!wrong) wrong = comm_check_exchange(c, k);
    if (!wrong) wrong = comm_check_exchange(c, k + 1);
  }
  return wrong;
}

#endif
