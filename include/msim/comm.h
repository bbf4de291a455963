/* comm.h - the ABI of communication between ranks: processes or threads that simulate one scene
 * together.
 *
 * A communicator is a table of functions, msim_comm, one for each rank; msim_options.comm passes it
 * to msim_sim_create. It comes from msim_comm_threads_create (ranks are threads of one process),
 * from msim_comm_open (a plugin, as `mpi`), or from a program that fills the table itself. This
 * header and status.h are all that an implementation includes. A plugin is one file,
 * msim_comm_NAME.so, that exports one symbol, msim_comm_entry:
 *
 *     static const msim_comm_type type = {.abi = MSIM_COMM_ABI, .size = sizeof type, ...};
 *     MSIM_COMM_ENTRY(mpi) { return &type; }
 *
 * All functions are collective: each rank calls the same functions in the same order, with numbers
 * of elements that fit together, and a call may wait for the other ranks.
 *
 * Guarantees of the host: calls of one rank never overlap, and come from the thread that calls the
 * functions of the sim; threads of its pool never call (MPI_THREAD_FUNNELED is enough if the thread
 * that initialized MPI is the one that uses the sim). Between exchange_begin() and exchange_end()
 * there is no other call. Buffers of different arguments do not overlap. Lengths are in bytes,
 * content is opaque; all ranks have the same byte order and formats of numbers.
 *
 * Obligations of an implementation:
 *  - The same calls give the same bits on every rank and in every run: sum() adds in an order that
 *    depends on nranks alone, as that of the ranks or that of a fixed tree. MPI_Allreduce does not
 *    guarantee this.
 *  - Lengths are 64-bit: one call may move more than 2^31 bytes. Ranks have 32-bit numbers;
 *    particles and springs in messages have 64-bit ones.
 *  - Steps allocate no memory: sum(), maximum(), gather() and the exchange must not need any beyond
 *    what open() or earlier calls of the same size have allocated.
 *  - It neither prints nor ends the process, where its library permits that.
 *
 * Failure: a function returns MSIM_OK, or an error (< 0): MSIM_ERR_BACKEND, or MSIM_ERR_MEMORY. The
 * results are undefined then, reason() has a sentence, and the communicator has failed for good:
 * pending and later calls on all ranks return an error as soon as they detect it, and none waits
 * for a rank that has failed. (An implementation that cannot do so must end all processes, as MPI
 * does by default.) The host makes no further calls after a failure on its rank; the sim reports it
 * and can only be destroyed.
 *
 * Rules of change: as in backend.h. New members are appended, and `size` says which exist; any
 * other change requires a new MSIM_COMM_ABI. The ABI is not frozen before version 1.0.
 */
#ifndef MSIM_COMM_H
#define MSIM_COMM_H

#include "msim/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MSIM_COMM_ABI 1u

/* What a rank sends to and receives from one other rank in an exchange. */
typedef struct msim_comm_message {
  int32_t rank;          /* the other rank */
  int32_t reserved;      /* 0 */
  int64_t send_bytes;    /* >= 0; what the other rank expects as receive_bytes */
  int64_t receive_bytes; /* >= 0 */
  const void *send;      /* send_bytes; unchanged until exchange_end() */
  void *receive;         /* receive_bytes; undefined until exchange_end() */
} msim_comm_message;

/* Also declared by options.h. */
typedef struct msim_comm msim_comm;

/* The communicator of one rank. It must outlive the sims that use it; sims use it one after
 * the other, or in the same order of calls on all ranks. */
struct msim_comm {
  uint32_t abi;     /* MSIM_COMM_ABI */
  uint32_t size;    /* sizeof(msim_comm) */
  const char *name; /* "threads", "mpi"; for reports */
  int32_t nranks;   /* >= 1 */
  int32_t rank;     /* of this table, 0 <= rank < nranks */
  void *self;       /* first argument of all functions */

  /* values[i] = the sum of values[i] over all ranks, in a fixed order; n is at most 64, mostly 1 to
   * 4, and equal on all ranks. */
  msim_status (*sum)(void *self, int32_t n, double *values);

  /* values[i] = the maximum over all ranks; NaN if one of them is NaN. */
  msim_status (*maximum)(void *self, int32_t n, double *values);

  /* all = what the ranks pass as `mine`, `bytes` each, in the order of ranks. */
  msim_status (*gather)(void *self, int64_t bytes, const void *mine, void *all /* nranks bytes */);

  /* The same where ranks pass different lengths, known on all ranks: bytes[r] from rank r. */
  msim_status (*gather_parts)(void *self, const int64_t *bytes /* nranks */, const void *mine,
                              void *all /* the sum of bytes */);

  /* data = that of rank `root`, which is equal on all ranks. */
  msim_status (*broadcast)(void *self, int32_t root, int64_t bytes, void *data);

  /* Send a part of `send` to each rank, its own included: parts lie in the order of ranks, without
   * gaps, those received as well; send_bytes[r] here is receive_bytes of this rank at rank r. Used
   * when a sim is created, not in steps. */
  msim_status (*all_to_all)(void *self, const int64_t *send_bytes /* nranks */, const void *send,
                            const int64_t *receive_bytes /* nranks */, void *receive);

  /* Start to exchange messages with n >= 0 neighbours, ascending by rank, each once, never the rank
   * itself. If rank r lists q then q lists r in the same exchange. Every rank calls this, also with
   * n = 0; ranks that are not neighbours need not wait for each other. messages: unchanged until
   * exchange_end(). */
  msim_status (*exchange_begin)(void *self, int32_t n, const msim_comm_message *messages);

  /* Wait until all messages of this rank are received and its own ones may be overwritten. */
  msim_status (*exchange_end)(void *self);

  /* A sentence about the failure of the last call that failed; never NULL, valid until the next
   * call. No communication. */
  const char *(*reason)(void *self);

  /* Later additions: they exist if `size` includes them. */

  /* What the library behind it calls this communicator: a pointer to the MPI_Comm of `mpi`; NULL:
   * nothing that another library could use. */
  const void *handle;
};

/* Size of the table in the first version of this ABI, the minimum. */
#define MSIM_COMM_SIZE_1 (offsetof(msim_comm, reason) + sizeof(const char *(*)(void *)))

/* What a plugin provides: communicators of one kind. */
typedef struct msim_comm_type {
  uint32_t abi;        /* MSIM_COMM_ABI */
  uint32_t size;       /* sizeof(msim_comm_type) */
  const char *name;    /* [a-z0-9_-]+: that of the file */
  const char *library; /* the library behind it, with its version */
  const char *license; /* license of that library, SPDX */

  /* Create the communicator of this rank; collective. from: what it is made from, as the plugin
   * documents it (`mpi`: a pointer to an MPI_Comm, which it duplicates); NULL: all processes that
   * were started together. The plugin initializes its library unless that is done already, and
   * then finalizes it in close() or at exit. With an error (< 0) it passes a message to host->fail.
   * host: valid until close() returns. */
  msim_status (*open)(const msim_host *host, const void *from, msim_comm **comm);

  /* Collective. */
  void (*close)(msim_comm *comm);
} msim_comm_type;

#define MSIM_COMM_TYPE_SIZE_1 (offsetof(msim_comm_type, close) + sizeof(void (*)(msim_comm *)))

typedef const msim_comm_type *msim_comm_entry_fn(void);

#ifdef MSIM_PLUGIN
#  define MSIM_COMM_ENTRY(name)                                                         \
    __attribute__((visibility("default"))) const msim_comm_type *msim_comm_entry(void); \
    const msim_comm_type *msim_comm_entry(void)
#else
#  define MSIM_COMM_ENTRY(name)                   \
    const msim_comm_type *msim_comm_##name(void); \
    const msim_comm_type *msim_comm_##name(void)
#endif

#ifdef __cplusplus
}
#endif
#endif
