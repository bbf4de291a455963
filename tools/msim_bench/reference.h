/* reference - a child that solves the same systems with a library out of the box */
#ifndef BENCH_REFERENCE_H
#define BENCH_REFERENCE_H

#include <sys/types.h>

#include "reference/protocol.h"
#include "system.h"

typedef struct reference {
  pid_t pid; /* 0: none runs */
  int to, from;
  reference_hello hello;
  char reason[256]; /* why none runs */
} reference;

/* Where a file of ours lies beside the reference programs; 0: it is not there with that access. */
int reference_path(const char *name, int mode, char *path, size_t size);

/* Start msim_bench_reference_NAME, in an environment that tells no library how many threads or
 * which kernels to take. Where that fails, r->reason says why. Call reference_stop in any case. */
void reference_start(reference *r, const char *name);
void reference_stop(reference *r);

/* Hand it another system. 0 where it failed, and why in r->reason. */
int reference_take(reference *r, const linear_system *s);

/* One solve; then waits until its threads sleep. 0 where it failed, and why in reply->reason. */
int reference_solve(reference *r, int variant, reference_reply *reply);

#endif
