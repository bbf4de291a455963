/* rank_run - steps of one scene on several ranks: threads of this process, or the processes that
 * mpirun has started */
#ifndef BENCH_RANK_RUN_H
#define BENCH_RANK_RUN_H

#include "counting_comm.h"
#include "timing.h"

enum { ALONE = 0 }; /* number of ranks: one process without a communicator */

typedef struct rank_run {
  const msim_scene *scene; /* borrowed, as the state */
  const msim_state *start;
  msim_options options;
  int steps;               /* in a sample */
  int32_t n;               /* ranks; ALONE */
  int independent;         /* 1: each of n threads has a sim of its own of the whole scene */
  msim_comm *processes;    /* of this process, with n ranks; NULL: ranks are threads */
  int32_t here;            /* ranks in this process */
  msim_comm **comms;       /* here */
  struct ranked_sim *sims; /* here */
} rank_run;

/* Creates the sims, given the members up to `processes`. Where processes are ranks, rank 0 runs
 * ALONE, and the others have no sim. Returns 0 on failure. Call rank_run_free in any case. */
int rank_run_create(rank_run *r, msim_error *err);
void rank_run_free(rank_run *r);

/* A sample: the mean of some steps from the start, on rank 0. For candidates whose data is the
 * run. */
int rank_run_sample(timing_candidate *c, timing_sample *s);

/* The communication of the steps of the last sample, and of gathering the state behind them: the
 * maximum of each count over the ranks of this process. */
comm_counts rank_run_counts(const rank_run *r);

#endif
