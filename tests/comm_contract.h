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

/* Around multiples of 64, the length of pieces in which tests have plugins send; every pair of
 * ranks has each of them in one of 11 rounds. */
static int64_t comm_length(int32_t p, int32_t q, int32_t round) {
  const int64_t lengths[11] = {0, 959, 64, 1, 300, 127, 65, 0, 128, 63, 129};
  return lengths[(5 * p + 3 * q + round) % 11];
}

enum { COMM_LONGEST = 1000 }; /* a length, and a byte behind that must not be written */

static unsigned char *comm_new_buffer(void) {
  unsigned char *buffer = malloc(65 * COMM_LONGEST);
  if (buffer) memset(buffer, 0xa5, 65 * COMM_LONGEST);
  return buffer;
}

static const char *comm_check_gathers(const msim_comm *c, int32_t round) {
  int64_t bytes[64];
  unsigned char *mine = comm_new_buffer(), *all = comm_new_buffer(), *at = all;
  COMM_EXPECT(mine && all);
  for (int32_t r = 0; r < c->nranks; r++) bytes[r] = comm_length(r, 0, round);
  comm_fill(mine, c->rank, 0, bytes[c->rank]);
  COMM_EXPECT(c->gather_parts(c->self, bytes, mine, all) == MSIM_OK);
  for (int32_t r = 0; r < c->nranks; at += bytes[r++])
    COMM_EXPECT(comm_is_filled(at, r, 0, bytes[r]));
  COMM_EXPECT(*at == 0xa5);
  for (int32_t root = 0; root < c->nranks; root++) {
    const int64_t length = comm_length(root, 1, round);
    comm_fill(mine, c->rank, 1, length);
    mine[length] = 0xa5;
    COMM_EXPECT(c->broadcast(c->self, root, length, mine) == MSIM_OK);
    COMM_EXPECT(comm_is_filled(mine, root, 1, length) && mine[length] == 0xa5);
  }
  free(mine), free(all);
  return NULL;
}

static const char *comm_check_all_to_all(const msim_comm *c, int32_t round) {
  int64_t send[64], receive[64];
  unsigned char *out = comm_new_buffer(), *in = comm_new_buffer(), *at = out;
  COMM_EXPECT(out && in);
  for (int32_t r = 0; r < c->nranks; at += send[r++]) {
    send[r] = comm_length(c->rank, r, round), receive[r] = comm_length(r, c->rank, round);
    comm_fill(at, c->rank, r, send[r]);
  }
  COMM_EXPECT(c->all_to_all(c->self, send, out, receive, in) == MSIM_OK);
  at = in;
  for (int32_t r = 0; r < c->nranks; at += receive[r++])
    COMM_EXPECT(comm_is_filled(at, r, c->rank, receive[r]));
  COMM_EXPECT(*at == 0xa5);
  free(out), free(in);
  return NULL;
}

/* p and q are neighbours if p + q + round is not a multiple of 3, so that some have none. */
static const char *comm_check_exchange(const msim_comm *c, int32_t round) {
  msim_comm_message m[64];
  unsigned char *out = comm_new_buffer(), *in = comm_new_buffer();
  int32_t n = 0;
  COMM_EXPECT(out && in);
  for (int32_t q = 0; q < c->nranks; q++) {
    if (q == c->rank || (c->rank + q + round) % 3 == 0) continue;
    m[n] = (msim_comm_message){.rank = q,
                               .send_bytes = comm_length(c->rank, q, round),
                               .receive_bytes = comm_length(q, c->rank, round),
                               .send = out + COMM_LONGEST * q,
                               .receive = in + COMM_LONGEST * q};
    comm_fill(out + COMM_LONGEST * q, c->rank, q + round, m[n++].send_bytes);
  }
  COMM_EXPECT(c->exchange_begin(c->self, n, m) == MSIM_OK);
  COMM_EXPECT(c->exchange_end(c->self) == MSIM_OK);
  for (int32_t i = 0; i < n; i++) {
    const unsigned char *from = m[i].receive;
    COMM_EXPECT(comm_is_filled(from, m[i].rank, c->rank + round, m[i].receive_bytes));
    COMM_EXPECT(from[m[i].receive_bytes] == 0xa5);
  }
  free(out), free(in);
  return NULL;
}

/* Everything, `rounds` times, 11 for all lengths; NULL: as promised. Up to 64 ranks. */
static const char *comm_check_contract(const msim_comm *c, int32_t rounds) {
  const char *wrong = NULL;
  for (int32_t k = 0; k < rounds && !wrong; k++) {
    wrong = comm_check_sums(c);
    if (!wrong) wrong = comm_check_gathers(c, k);
    if (!wrong) wrong = comm_check_all_to_all(c, k);
    if (!wrong) wrong = comm_check_exchange(c, k);
    if (!wrong) wrong = comm_check_exchange(c, k + 1);
  }
  return wrong;
}

#endif
