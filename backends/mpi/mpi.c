/* mpi - communicator plugin: ranks are processes that MPI has started.
 *
 * Sums and maxima gather the numbers of all ranks and combine them in the order of ranks, as
 * MPI_Allreduce guarantees no order. Counts of MPI have 31 bits: longer messages travel in pieces.
 *
 * MPI returns errors in place of ending the process. After one other ranks may wait for ever, so
 * that all processes are ended (MPI_Abort) once this one has reported it: when the communicator is
 * closed, or at exit. */
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mpi.h>

#include "msim/comm.h"

#ifndef LARGEST_MESSAGE /* bytes; tests make it small */
#  define LARGEST_MESSAGE INT_MAX
#endif

#define STRING_(x) #x
#define STRING(x)  STRING_(x)
#if defined OMPI_MAJOR_VERSION
#  define LIBRARY                                                                     \
    "Open MPI " STRING(OMPI_MAJOR_VERSION) "." STRING(OMPI_MINOR_VERSION) "." STRING( \
        OMPI_RELEASE_VERSION)
#  define LICENSE "BSD-3-Clause"
#elif defined MPICH_VERSION
#  define LIBRARY "MPICH " MPICH_VERSION
#  define LICENSE "mpich2"
#else
#  define LIBRARY "MPI " STRING(MPI_VERSION) "." STRING(MPI_SUBVERSION)
#  define LICENSE "unknown"
#endif

enum { AT_ONCE = 16 /* numbers of a sum that travel together */, EXCHANGE = 1, ALL_TO_ALL = 2 };

typedef struct mpi_comm {
  msim_comm table; /* first */
  const msim_host *host;
  MPI_Comm comm;
  double *numbers;       /* AT_ONCE of each rank */
  int *counts, *offsets; /* of each rank */
  MPI_Request *requests; /* of the exchange under way */
  int nrequests, capacity;
  int failed;
  char host_name[MPI_MAX_PROCESSOR_NAME];
  char reason[MPI_MAX_ERROR_STRING + MPI_MAX_PROCESSOR_NAME + 100];
} mpi_comm;

/*------------------------------------- failures -------------------------------------------------*/

static msim_status mpi_fail(mpi_comm *c, const char *function, const char *why) {
  c->failed = 1;
  snprintf(c->reason, sizeof c->reason, "rank %d of %d on host %s: %s failed: %s", c->table.rank,
           c->table.nranks, c->host_name, function, why);
  return MSIM_ERR_BACKEND;
}

static msim_status mpi_check(mpi_comm *c, const char *function, int code) {
  char why[MPI_MAX_ERROR_STRING] = "unknown error";
  int length;
  if (code == MPI_SUCCESS) return MSIM_OK;
  MPI_Error_string(code, why, &length);
  return mpi_fail(c, function, why);
}

static const char *mpi_reason(void *self) {
  const mpi_comm *c = self;
  return c->reason;
}

/*------------------------------------- sums -----------------------------------------------------*/

/* The numbers of all ranks, n of each one after the other, in c->numbers */
static msim_status gather_numbers(mpi_comm *c, int32_t n, const double *values) {
  return mpi_check(c, "MPI_Allgather",
                   MPI_Allgather(values, n, MPI_DOUBLE, c->numbers, n, MPI_DOUBLE, c->comm));
}

static double add(double a, double b) { return a + b; }

/* NaN if one of them is */
static double larger(double a, double b) { return isnan(a) || a > b ? a : b; }

/* Combines the numbers of the ranks in their order. */
static msim_status reduce(mpi_comm *c, int32_t n, double *values,
                          double (*combine)(double, double)) {
  for (int32_t first = 0; first < n; first += AT_ONCE) {
    const int32_t m = n - first < AT_ONCE ? n - first : AT_ONCE;
    const msim_status status = gather_numbers(c, m, values + first);
    if (status) return status;
    for (int32_t i = 0; i < m; i++) {
      double all = c->numbers[i];
      for (int32_t r = 1; r < c->table.nranks; r++) all = combine(all, c->numbers[r * m + i]);
      values[first + i] = all;
    }
  }
  return MSIM_OK;
}

static msim_status mpi_sum(void *self, int32_t n, double *values) {
  return reduce(self, n, values, add);
}

static msim_status mpi_maximum(void *self, int32_t n, double *values) {
  return reduce(self, n, values, larger);
}

/*------------------------------------- bytes for all --------------------------------------------*/

static int piece_of(int64_t left) {
  return left < LARGEST_MESSAGE ? (int)left : (int)LARGEST_MESSAGE;
}

static msim_status mpi_broadcast(void *self, int32_t root, int64_t bytes, void *data) {
  mpi_comm *c = self;
  msim_status status = MSIM_OK;
  for (int64_t at = 0; at < bytes && !status; at += LARGEST_MESSAGE)
    status = mpi_check(c, "MPI_Bcast",
                       MPI_Bcast((char *)data + at, piece_of(bytes - at), MPI_BYTE, root, c->comm));
  return status;
}

/* By broadcasts, where offsets exceed an int */
static msim_status gather_long_parts(mpi_comm *c, const int64_t *bytes, const void *mine,
                                     char *all) {
  msim_status status = MSIM_OK;
  for (int32_t r = 0; r < c->table.nranks && !status; all += bytes[r++]) {
    if (r == c->table.rank && bytes[r] > 0) memcpy(all, mine, (size_t)bytes[r]);
    status = mpi_broadcast(c, r, bytes[r], all);
  }
  return status;
}

static msim_status mpi_gather_parts(void *self, const int64_t *bytes, const void *mine, void *all) {
  mpi_comm *c = self;
  int64_t sum = 0;
  for (int32_t r = 0; r < c->table.nranks; r++) sum += bytes[r];
  if (sum > LARGEST_MESSAGE) return gather_long_parts(c, bytes, mine, all);
  int offset = 0;
  for (int32_t r = 0; r < c->table.nranks; offset += c->counts[r++])
    c->counts[r] = (int)bytes[r], c->offsets[r] = offset;
  return mpi_check(c, "MPI_Allgatherv",
                   MPI_Allgatherv(mine, c->counts[c->table.rank], MPI_BYTE, all, c->counts,
                                  c->offsets, MPI_BYTE, c->comm));
}

static msim_status mpi_gather(void *self, int64_t bytes, const void *mine, void *all) {
  mpi_comm *c = self;
  if (bytes <= LARGEST_MESSAGE / c->table.nranks)
    return mpi_check(c, "MPI_Allgather",
                     MPI_Allgather(mine, (int)bytes, MPI_BYTE, all, (int)bytes, MPI_BYTE, c->comm));
  msim_status status = MSIM_OK;
  for (int32_t r = 0; r < c->table.nranks && !status; r++) {
    char *part = (char *)all + r * bytes;
    if (r == c->table.rank) memcpy(part, mine, (size_t)bytes);
    status = mpi_broadcast(c, r, bytes, part);
  }
  return status;
}

/*------------------------------------- pairs ----------------------------------------------------*/

/* The part for rank `to` leaves while that of rank `from` arrives, piece by piece. */
static msim_status swap_parts(mpi_comm *c, int32_t to, const char *send, int64_t send_bytes,
                              int32_t from, char *receive, int64_t receive_bytes) {
  msim_status status = MSIM_OK;
  for (int64_t at = 0; (at < send_bytes || at < receive_bytes) && !status; at += LARGEST_MESSAGE) {
    const int sends = at < send_bytes, receives = at < receive_bytes;
    status = mpi_check(
        c, "MPI_Sendrecv",
        MPI_Sendrecv(sends ? send + at : NULL, sends ? piece_of(send_bytes - at) : 0, MPI_BYTE,
                     sends ? to : MPI_PROC_NULL, ALL_TO_ALL, receives ? receive + at : NULL,
                     receives ? piece_of(receive_bytes - at) : 0, MPI_BYTE,
                     receives ? from : MPI_PROC_NULL, ALL_TO_ALL, c->comm, MPI_STATUS_IGNORE));
  }
  return status;
}

/* Where the part of a rank begins */
static int64_t offset_of(const int64_t *bytes, int32_t rank) {
  int64_t offset = 0;
  for (int32_t r = 0; r < rank; r++) offset += bytes[r];
  return offset;
}

/* In round k each rank sends to the k-th behind it and receives from the k-th before it. */
static msim_status mpi_all_to_all(void *self, const int64_t *send_bytes, const void *send,
                                  const int64_t *receive_bytes, void *receive) {
  mpi_comm *c = self;
  const int32_t n = c->table.nranks, rank = c->table.rank;
  msim_status status = MSIM_OK;
  for (int32_t k = 0; k < n && !status; k++) {
    const int32_t to = (int32_t)(((int64_t)rank + k) % n);
    const int32_t from = (int32_t)(((int64_t)rank - k + n) % n);
    status = swap_parts(c, to, (const char *)send + offset_of(send_bytes, to), send_bytes[to], from,
                        (char *)receive + offset_of(receive_bytes, from), receive_bytes[from]);
  }
  return status;
}

/*------------------------------------- exchange -------------------------------------------------*/

static int64_t count_pieces(int64_t bytes) {
  return bytes / LARGEST_MESSAGE + (bytes % LARGEST_MESSAGE != 0);
}

/* Room for the requests of these messages; it is kept for later exchanges. */
static msim_status reserve_requests(mpi_comm *c, int32_t n, const msim_comm_message *messages) {
  int64_t pieces = 0;
  for (int32_t i = 0; i < n; i++)
    pieces += count_pieces(messages[i].send_bytes) + count_pieces(messages[i].receive_bytes);
  if (pieces <= c->capacity) return MSIM_OK;
  MPI_Request *more =
      pieces <= INT_MAX ? c->host->alloc(c->host, (size_t)pieces * sizeof *more) : NULL;
  if (!more) {
    mpi_fail(c, "exchange_begin()", "memory is exhausted");
    return MSIM_ERR_MEMORY;
  }
  c->host->free(c->host, c->requests);
  c->requests = more, c->capacity = (int)pieces;
  return MSIM_OK;
}

static msim_status mpi_exchange_begin(void *self, int32_t n, const msim_comm_message *messages) {
  mpi_comm *c = self;
  c->nrequests = 0;
  msim_status status = reserve_requests(c, n, messages);
  for (int32_t i = 0; i < n; i++) {
    const msim_comm_message *m = &messages[i];
    for (int64_t at = 0; at < m->receive_bytes && !status; at += LARGEST_MESSAGE)
      status =
          mpi_check(c, "MPI_Irecv",
                    MPI_Irecv((char *)m->receive + at, piece_of(m->receive_bytes - at), MPI_BYTE,
                              m->rank, EXCHANGE, c->comm, &c->requests[c->nrequests++]));
  }
  for (int32_t i = 0; i < n; i++) {
    const msim_comm_message *m = &messages[i];
    for (int64_t at = 0; at < m->send_bytes && !status; at += LARGEST_MESSAGE)
      status =
          mpi_check(c, "MPI_Isend",
                    MPI_Isend((const char *)m->send + at, piece_of(m->send_bytes - at), MPI_BYTE,
                              m->rank, EXCHANGE, c->comm, &c->requests[c->nrequests++]));
  }
  return status;
}

/* One by one: gcc warns of MPI_STATUSES_IGNORE of MPICH, which is no array. */
static msim_status mpi_exchange_end(void *self) {
  mpi_comm *c = self;
  const int n = c->nrequests;
  msim_status status = MSIM_OK;
  c->nrequests = 0;
  for (int i = 0; i < n && !status; i++)
    status = mpi_check(c, "MPI_Wait", MPI_Wait(&c->requests[i], MPI_STATUS_IGNORE));
  return status;
}

/*------------------------------------- open and close -------------------------------------------*/

static int failed_at_exit; /* 1: a communicator has failed and was not closed */

static void finalize_mpi(void) {
  int finalized = 1;
  MPI_Finalized(&finalized);
  if (finalized) return;
  if (failed_at_exit) MPI_Abort(MPI_COMM_WORLD, 1);
  MPI_Finalize();
}

/* Initialize MPI unless the program has; it ends with the process. A sentence if that fails. */
static const char *initialize_mpi(void) {
  int initialized = 0, finalized = 0, threads = MPI_THREAD_SINGLE;
  MPI_Finalized(&finalized);
  if (finalized) return "MPI has ended in this process; open communicators before MPI_Finalize";
  MPI_Initialized(&initialized);
  if (!initialized) {
    if (MPI_Init_thread(NULL, NULL, MPI_THREAD_FUNNELED, &threads) != MPI_SUCCESS)
      return "MPI cannot be initialized";
    if (atexit(finalize_mpi)) return "there is no memory for a function at exit";
  }
  MPI_Query_thread(&threads);
  if (threads < MPI_THREAD_FUNNELED)
    return "MPI was initialized for programs of one thread; call MPI_Init_thread with "
           "MPI_THREAD_FUNNELED";
  return NULL;
}

static void mpi_free(mpi_comm *c) {
  const msim_host *host = c->host;
  host->free(host, c->numbers);
  host->free(host, c->counts);
  host->free(host, c->offsets);
  host->free(host, c->requests);
  host->free(host, c);
}

static msim_status mpi_set_up(mpi_comm *c, MPI_Comm from) {
  int length;
  msim_status status = mpi_check(c, "MPI_Comm_dup", MPI_Comm_dup(from, &c->comm));
  if (status) return status;
  MPI_Comm_set_errhandler(c->comm, MPI_ERRORS_RETURN);
  MPI_Comm_rank(c->comm, &c->table.rank);
  MPI_Comm_size(c->comm, &c->table.nranks);
  MPI_Get_processor_name(c->host_name, &length);
  const size_t n = (size_t)c->table.nranks;
  c->numbers = c->host->alloc(c->host, n * AT_ONCE * sizeof *c->numbers);
  c->counts = c->host->alloc(c->host, n * sizeof *c->counts);
  c->offsets = c->host->alloc(c->host, n * sizeof *c->offsets);
  if (c->numbers && c->counts && c->offsets) return MSIM_OK;
  mpi_fail(c, "open()", "memory is exhausted");
  return MSIM_ERR_MEMORY;
}

static msim_status mpi_open(const msim_host *host, const void *from, msim_comm **comm) {
  const char *wrong = initialize_mpi();
  *comm = NULL;
  if (wrong) {
    host->fail(host, "%s", wrong);
    return MSIM_ERR_BACKEND;
  }
  mpi_comm *c = host->alloc(host, sizeof *c);
  if (!c) return MSIM_ERR_MEMORY;
  memset(c, 0, sizeof *c);
  c->host = host;
  c->table = (msim_comm){.abi = MSIM_COMM_ABI,
                         .size = sizeof c->table,
                         .name = "mpi",
                         .self = c,
                         .sum = mpi_sum,
                         .maximum = mpi_maximum,
                         .gather = mpi_gather,
                         .gather_parts = mpi_gather_parts,
                         .broadcast = mpi_broadcast,
                         .all_to_all = mpi_all_to_all,
                         .exchange_begin = mpi_exchange_begin,
                         .exchange_end = mpi_exchange_end,
                         .reason = mpi_reason,
                         .handle = &c->comm};
  const msim_status status = mpi_set_up(c, from ? *(const MPI_Comm *)from : MPI_COMM_WORLD);
  if (status) {
    host->fail(host, "%s", c->reason);
    failed_at_exit = 1; /* other ranks may wait */
    mpi_free(c);
    return status;
  }
  *comm = &c->table;
  return MSIM_OK;
}

static void mpi_close(msim_comm *comm) {
  mpi_comm *c = (mpi_comm *)comm;
  if (!c) return;
  if (c->failed) MPI_Abort(c->comm, 1);
  MPI_Comm_free(&c->comm);
  mpi_free(c);
}

MSIM_COMM_ENTRY(mpi) {
  static const msim_comm_type type = {.abi = MSIM_COMM_ABI,
                                      .size = sizeof type,
                                      .name = "mpi",
                                      .library = LIBRARY,
                                      .license = LICENSE,
                                      .open = mpi_open,
                                      .close = mpi_close};
  return &type;
}
