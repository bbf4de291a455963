/* ranks - run one function on N ranks that are threads */
#ifndef TEST_RANKS_H
#define TEST_RANKS_H

#include <pthread.h>

#include "msim/comm.h"
#include "testing.h"

enum { MOST_RANKS = 8 };

/* What rank comm->rank does. Assertions work in the test's thread only: it returns a sentence. */
typedef const char *rank_work(msim_comm *comm, void *data);

typedef struct rank_thread {
  pthread_t thread;
  msim_comm *comm;
  rank_work *work;
  void *data;
  const char *wrong;
} rank_thread;

static void *rank_main(void *data) {
  rank_thread *t = data;
  t->wrong = t->work(t->comm, t->data);
  if (t->wrong) msim_comm_threads_fail(t->comm, "a rank of the test has ended");
  return NULL;
}

/* The first sentence by the order of ranks; NULL: all is well. */
static const char *run_ranks(int32_t n, rank_work *work, void *data) {
  msim_comm *comms[MOST_RANKS];
  rank_thread t[MOST_RANKS];
  const char *wrong = NULL;
  assert_true(n <= MOST_RANKS);
  assert_ok(msim_comm_threads_create(n, NULL, comms, err));
  for (int32_t r = 0; r < n; r++) {
    t[r] = (rank_thread){.comm = comms[r], .work = work, .data = data};
    assert_int_equal(pthread_create(&t[r].thread, NULL, rank_main, &t[r]), 0);
  }
  for (int32_t r = 0; r < n; r++) {
    pthread_join(t[r].thread, NULL);
    if (!wrong) wrong = t[r].wrong;
  }
  msim_comm_threads_destroy(comms[0]);
  return wrong;
}

#endif
