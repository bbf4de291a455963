/* counting_host - the host of a plugin under test: counts blocks of memory, fails allocations on
 * demand, records the last error message */
#ifndef COUNTING_HOST_H
#define COUNTING_HOST_H

#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msim/status.h"

typedef struct counting_host {
  msim_host host; /* first member: a pointer to it is a pointer to this */
  int live;       /* blocks allocated and not freed */
  int fails;      /* 1: every allocation fails */
  int fail_at;    /* the allocation number (from 1) from which all fail; 0: none */
  char sentence[512];
} counting_host;

/* Memory comes filled with 0xff bytes, which are NaN as doubles: the host does not promise
 * zeros. */
static inline void *counting_alloc(const msim_host *host, size_t bytes) {
  counting_host *self = host->data;
  if (self->fail_at && --self->fail_at == 0) self->fails = 1;
  void *block = self->fails ? NULL : malloc(bytes);
  self->live += block != NULL;
  return block ? memset(block, 0xff, bytes) : NULL;
}

static inline void counting_free(const msim_host *host, void *block) {
  counting_host *self = host->data;
  self->live -= block != NULL;
  free(block);
}

static inline void counting_fail(const msim_host *host, const char *format, ...) {
  counting_host *self = host->data;
  va_list args;
  va_start(args, format);
  vsnprintf(self->sentence, sizeof self->sentence, format, args);
  va_end(args);
}

static pthread_mutex_t counting_mutex = PTHREAD_MUTEX_INITIALIZER;

static inline void counting_lock(const msim_host *host) {
  (void)host;
  pthread_mutex_lock(&counting_mutex);
}

static inline void counting_unlock(const msim_host *host) {
  (void)host;
  pthread_mutex_unlock(&counting_mutex);
}

static inline void host_init(counting_host *self) {
  *self = (counting_host){.host = {.size = sizeof self->host,
                                   .alloc = counting_alloc,
                                   .free = counting_free,
                                   .fail = counting_fail,
                                   .data = self,
                                   .lock = counting_lock,
                                   .unlock = counting_unlock}};
}

#endif
