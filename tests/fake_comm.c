/* A communicator of one rank as a plugin, which counts what is open; from = 1 fails, from = 2
 * returns a table without `sum`. */
#include <string.h>

#include "msim/comm.h"

static int open_comms;

static msim_status keep(void *self, int32_t n, double *values) {
  (void)self, (void)n, (void)values;
  return MSIM_OK;
}

static msim_status copy(void *self, int64_t bytes, const void *mine, void *all) {
  (void)self;
  memcpy(all, mine, (size_t)bytes);
  return MSIM_OK;
}

static msim_status copy_part(void *self, const int64_t *bytes, const void *mine, void *all) {
  return copy(self, bytes[0], mine, all);
}

static msim_status keep_root(void *self, int32_t root, int64_t bytes, void *data) {
  (void)self, (void)root, (void)bytes, (void)data;
  return MSIM_OK;
}

static msim_status copy_to_self(void *self, const int64_t *send_bytes, const void *send,
                                const int64_t *receive_bytes, void *receive) {
  (void)receive_bytes;
  return copy(self, send_bytes[0], send, receive);
}

static msim_status begin(void *self, int32_t n, const msim_comm_message *messages) {
  (void)self, (void)n, (void)messages;
  return MSIM_OK;
}

static msim_status end(void *self) {
  (void)self;
  return MSIM_OK;
}

static const char *reason(void *self) {
  (void)self;
  return open_comms == 1 ? "one is open" : "several are open";
}

static msim_status open_comm(const msim_host *host, const void *from, msim_comm **comm) {
  const int defect = from ? *(const int *)from : 0;
  msim_comm *c = host->alloc(host, sizeof *c);
  if (defect == 1) host->fail(host, "there is no network"), host->free(host, c);
  if (defect == 1 || !c) return defect == 1 ? MSIM_ERR_BACKEND : MSIM_ERR_MEMORY;
  *c = (msim_comm){.abi = MSIM_COMM_ABI,
                   .size = sizeof *c,
                   .name = "alone",
                   .nranks = 1,
                   .self = (void *)(uintptr_t)host,
                   .sum = defect == 2 ? NULL : keep,
                   .maximum = keep,
                   .gather = copy,
                   .gather_parts = copy_part,
                   .broadcast = keep_root,
                   .all_to_all = copy_to_self,
                   .exchange_begin = begin,
                   .exchange_end = end,
                   .reason = reason};
  open_comms++;
  *comm = c;
  return MSIM_OK;
}

static void close_comm(msim_comm *comm) {
  const msim_host *host = comm->self;
  open_comms--;
  host->free(host, comm);
}

static const msim_comm_type type = {.abi = MSIM_COMM_ABI,
                                    .size = sizeof type,
                                    .name = "alone",
                                    .library = "none",
                                    .license = "MIT",
                                    .open = open_comm,
                                    .close = close_comm};

MSIM_COMM_ENTRY(alone) { return &type; }
