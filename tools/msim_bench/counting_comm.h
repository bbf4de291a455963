/* counting_comm - a communicator that passes all calls on to another one and counts them */
#ifndef BENCH_COUNTING_COMM_H
#define BENCH_COUNTING_COMM_H

#include "msim/comm.h"

typedef struct comm_counts {
  int64_t exchanges, bytes; /* exchanges, and bytes that this rank has sent in them */
  int64_t collectives;      /* all other calls */
  double largest_over_mean; /* of the parts of the last gather_parts(); 0: none */
} comm_counts;

typedef struct counting_comm {
  msim_comm table; /* first */
  const msim_comm *inner;
  comm_counts counts;
} counting_comm;

void counting_comm_make(const msim_comm *inner, counting_comm *c);

#endif
