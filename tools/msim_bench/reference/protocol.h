/* protocol - how msim_bench and its reference programs talk: through two pipes, on one machine
 *
 * The program says hello. Then each request gets one reply, until the requests end. */
#ifndef REFERENCE_PROTOCOL_H
#define REFERENCE_PROTOCOL_H

#include <stddef.h>
#include <stdint.h>

enum { REFERENCE_VARIANTS = 4 };

typedef struct reference_hello {
  char library[64]; /* the one measured, with its version */
  int32_t nvariants, unused;
  char variants[REFERENCE_VARIANTS][32]; /* ways to call it, the best first */
  double rest_s;                         /* so long its threads spin after a call */
} reference_hello;

/* A SYSTEM is followed by rowptr (n + 1), colind, val (rowptr[n]), b and guess (n): A by rows, both
 * triangles. It is analysed, and replaces the one before. */
enum { REFERENCE_SYSTEM, REFERENCE_SOLVE };

typedef struct reference_request {
  int32_t what, variant;     /* variant: of SOLVE */
  int32_t n, max_iterations; /* of SYSTEM */
  double rtol;               /* of SYSTEM: ||b - A x|| <= rtol ||b|| */
} reference_request;

typedef struct reference_reply {
  int32_t failed, iterations;
  double factor_s, solve_s; /* factor: all that the values of A need before the solve */
  double residual;          /* ||b - A x|| / ||b|| */
  char reason[128];         /* where it failed */
} reference_reply;

/* All bytes or failure, 0: the other end is gone, or a signal came. */
int pipe_read(int fd, void *data, size_t size);
int pipe_write(int fd, const void *data, size_t size);

#endif
