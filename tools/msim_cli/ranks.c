#define _POSIX_C_SOURCE 200809L /* gethostname, nanosleep */
#include "ranks.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "../common/message.h"
#include "../common/mpirun.h"
#include "msim/comm.h"

/* What each rank sends to the others */
typedef struct rank_report {
  int32_t status, has_message;
  uint64_t inputs; /* hash of the command line and of the files that are read */
  char host[64];
} rank_report;

static struct {
  int several;        /* mpirun has started more than one process */
  int rank, n;        /* n: 0 as long as it is unknown */
  msim_comm *comm;    /* NULL: not open */
  rank_report *all;   /* n */
  rank_report own;    /* the host, and inputs */
  char message[1024]; /* not printed yet; "": none */
} ranks;

/*------------------------------------- before MPI -----------------------------------------------*/

void ranks_begin(void) {
  if (!mpirun_may_be_several()) return;
  ranks.several = 1;
  ranks.rank = mpirun_rank();
  gethostname(ranks.own.host, sizeof ranks.own.host - 1);
  message_keep(ranks.message, sizeof ranks.message);
  mpirun_mute();
}

/*------------------------------------- agreement ------------------------------------------------*/

static void print_of_rank(int rank, const char *host, const char *text) {
  message_keep(NULL, 0);
  if (ranks.n) report_error("rank %d of %d on host %s: %s", rank, ranks.n, host, text);
  else report_error("rank %d on host %s: %s", rank, host, text);
}

static int report_lost_ranks(void) {
  char text[sizeof ranks.message];
  snprintf(text, sizeof text, "%s", ranks.comm->reason(ranks.comm->self));
  message_keep(NULL, 0);
  return report_error("%s", text);
}

static int print_message_of(int rank) {
  msim_comm *c = ranks.comm;
  if (!ranks.all[rank].has_message) return ranks.all[rank].status; /* rank 0 has printed it */
  if (c->broadcast(c->self, rank, sizeof ranks.message, ranks.message)) return report_lost_ranks();
  char text[sizeof ranks.message];
  snprintf(text, sizeof text, "%s", ranks.message);
  if (c->rank == 0) print_of_rank(rank, ranks.all[rank].host, text);
  return ranks.all[rank].status;
}

/* The reports of all ranks; prints a failure of MPI. */
static int share_reports(int status) {
  msim_comm *c = ranks.comm;
  ranks.own.status = status;
  ranks.own.has_message = *ranks.message != 0;
  if (c->gather(c->self, sizeof ranks.own, &ranks.own, ranks.all)) return report_lost_ranks();
  return EXIT_OK;
}

int ranks_agree(int status) {
  if (!ranks.comm) return status;
  if (share_reports(status)) return EXIT_ERROR;
  for (int r = 0; r < ranks.n; r++) {
    if (!ranks.all[r].status) continue;
    status = print_message_of(r);
    *ranks.message = 0;
    return status;
  }
  *ranks.message = 0;
  return EXIT_OK;
}

double ranks_maximum(double value) {
  if (ranks.comm) ranks.comm->maximum(ranks.comm->self, 1, &value); /* a failure shows in steps */
  return value;
}

int ranks_has_files(void) { return ranks.rank == 0; }

int ranks_number(void) { return ranks.rank; }

int ranks_count(void) { return ranks.comm ? ranks.n : 1; }

/*------------------------------------- joining --------------------------------------------------*/

/* FNV-1a of 64 bits */
static uint64_t hash_bytes(uint64_t hash, const void *data, size_t length) {
  const unsigned char *bytes = data;
  for (size_t i = 0; i < length; i++) hash = (hash ^ bytes[i]) * UINT64_C(0x100000001b3);
  return hash;
}

static uint64_t hash_text(uint64_t hash, const char *text) {
  return text ? hash_bytes(hash, text, strlen(text) + 1) : hash_bytes(hash, "\1", 1);
}

static uint64_t hash_file(uint64_t hash, const char *path) {
  char block[1 << 14];
  size_t length;
  FILE *file = path ? fopen(path, "rb") : NULL;
  while (file && (length = fread(block, 1, sizeof block, file)) > 0)
    hash = hash_bytes(hash, block, length);
  if (file) fclose(file);
  return hash;
}

static uint64_t hash_inputs(const arguments *args) {
  const char *const files[] = {args->scene, args->init, args->out, args->final};
  const int flags[] = {args->resume, args->force, args->stats, args->quiet};
  uint64_t hash = hash_bytes(UINT64_C(0xcbf29ce484222325), flags, sizeof flags);
  for (int i = 0; i < 4; i++) hash = hash_text(hash, files[i]);
  for (int i = 0; i < NTABLES; i++) hash = hash_text(hash, args->tables[i]);
  for (int i = 0; i < args->nsettings; i++)
    hash = hash_text(hash_text(hash, args->settings[i].name), args->settings[i].value);
  return hash_file(hash_file(hash, args->scene), args->init);
}

/* All ranks have read the same. */
static int compare_inputs(void) {
  for (int r = 1; r < ranks.n; r++)
    if (ranks.all[r].inputs != ranks.all[0].inputs)
      return report_error(
          "rank %d of %d on host %s has another command line, scene file or --init "
          "file than rank 0 on host %s; start all with the same ones",
          r, ranks.n, ranks.all[r].host, ranks.all[0].host);
  return EXIT_OK;
}

int ranks_open(const arguments *args) {
  msim_error err;
  if (!ranks.several) return EXIT_OK;
  if (msim_comm_open("mpi", NULL, args->options.plugin_path, &ranks.comm, &err))
    return report_error("%s", err.text);
  ranks.n = ranks.comm->nranks, ranks.rank = ranks.comm->rank;
  ranks.all = calloc((size_t)ranks.n, sizeof *ranks.all);
  if (ranks.all) return EXIT_OK;
  msim_comm_close(ranks.comm);
  ranks.comm = NULL;
  return report_error("out of memory for the ranks");
}

int ranks_join(const arguments *args, int status, const msim_comm **comm) {
  if (!ranks.several) return status;
  ranks.own.inputs = hash_inputs(args);
  status = ranks_agree(status);
  if (ranks.rank == 0) message_keep(NULL, 0); /* its messages name no rank from now on */
  if (status) return status;
  *comm = ranks.comm;
  return compare_inputs();
}

/*------------------------------------- the end --------------------------------------------------*/

/* Without MPI ranks cannot agree on who prints. Where all have failed, as on a faulty command line,
 * rank 0 is first, and mpirun ends the others while they wait. */
static void print_alone(void) {
  const struct timespec wait = {.tv_sec = 3};
  char text[sizeof ranks.message];
  if (!*ranks.message) return;
  snprintf(text, sizeof text, "%s", ranks.message);
  if (ranks.rank > 0) nanosleep(&wait, NULL);
  print_of_rank(ranks.rank, ranks.own.host, text);
}

int ranks_end(int status) {
  if (!ranks.several) return status;
  if (!ranks.comm) {
    print_alone();
    return status;
  }
  status = ranks_agree(status);
  msim_comm_close(ranks.comm);
  free(ranks.all);
  return status;
}
