/* protocol - messages between msim_bench and its reference programs, through two pipes
 *
 * The program sends a hello. Then each request gets one reply, until the pipe is closed. */
#ifndef REFERENCE_PROTOCOL_H
#define REFERENCE_PROTOCOL_H

#include <stddef.h>
#include <stdint.h>

enum { REFERENCE_VARIANTS = 2 };

typedef struct reference_hello {
  char library[64]; /* name and version */
  int32_t nvariants, unused;
  char variants[REFERENCE_VARIANTS][32]; /* names of the ways to call it, the best first */
  double rest_s;                         /* s, while its threads spin after a call */
} reference_hello;

/* A SYSTEM is followed by rowptr (n + 1), colind, val (rowptr[n]) and b (n): A by rows, both
 * triangles. It is analysed, and replaces the previous one. */
enum { REFERENCE_SYSTEM, REFERENCE_SOLVE };

typedef struct reference_request {
  int32_t what, variant;     /* variant: of SOLVE */
  int32_t n, max_iterations; /* of SYSTEM */
  double rtol;               /* of SYSTEM: ||b - A x|| <= rtol ||b|| */
} reference_request;

typedef struct reference_reply {
  int32_t failed, iterations;
  double factor_s, solve_s; /* factor: all work that new values of A require before the solve */
  double residual;          /* ||b - A x|| / ||b|| */
  char reason[128];         /* why it failed */
} reference_reply;

/* Transfer all bytes. Return 0 on failure: the other end is closed, or a signal came. */
int pipe_read(int fd, void *data, size_t size);
int pipe_write(int fd, const void *data, size_t size);

#endif
