/* reference - a child process that solves the same systems with a library in default settings */
#ifndef BENCH_REFERENCE_H
#define BENCH_REFERENCE_H

#include <sys/types.h>

#include "reference/protocol.h"
#include "system.h"

typedef struct reference {
  pid_t pid; /* 0: not running */
  int to, from;
  reference_hello hello;
  char reason[256]; /* why it is not running */
} reference;

/* Path of a file beside the reference programs; mode: as for access(). Returns 0 if that fails. */
int reference_path(const char *name, int mode, char *path, size_t size);

/* Starts msim_bench_reference_NAME, without environment variables that set threads or kernels of
 * libraries. On failure, sets r->reason. Call reference_stop in any case. */
void reference_start(reference *r, const char *name);
void reference_stop(reference *r);

/* Sends the next system. Returns 0 on failure and sets r->reason. */
int reference_take(reference *r, const linear_system *s);

/* Solves once, then waits until its threads sleep. Returns 0 on failure and sets reply->reason. */
int reference_solve(reference *r, int variant, reference_reply *reply);

#endif
