/* reference_program - a child process that solves the same systems with a library in default
 * settings */
#ifndef BENCH_REFERENCE_PROGRAM_H
#define BENCH_REFERENCE_PROGRAM_H

#include <sys/types.h>

#include "msim/msim.h"
#include "ode.h"
#include "protocol.h"

typedef struct reference_program {
  pid_t pid; /* 0: not running */
  int to, from;
  reference_hello hello;
  char reason[256]; /* why it is not running */
} reference_program;

/* Starts msim_bench_reference_NAME, without environment variables that set threads or kernels of
 * libraries. On failure, sets r->reason. Call reference_program_stop in any case. */
void reference_program_start(reference_program *r, const char *name);
void reference_program_stop(reference_program *r);

/* Sends the next system A y = b, to be solved to ||b - A y|| <= rtol ||b||. Returns 0 on failure
 * and sets r->reason. */
int reference_program_send_system(reference_program *r, const msim_csr *A, const double *b,
                                  double rtol, int32_t max_iterations);

/* Solves once, then waits until its threads sleep. Returns 0 on failure and sets reply->reason. */
int reference_program_solve(reference_program *r, int variant, reference_reply *reply);

/* Loads the module of ode.h, which is never unloaded. Returns NULL on failure and sets reason. */
const ode_methods *ode_load(char reason[static 256]);

#endif
