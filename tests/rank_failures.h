/* rank_failures - each allocation and each call of the communicator of one rank fails in turn: that
 * is a failure of all ranks, which leaves nothing behind */
#ifndef TEST_RANK_FAILURES_H
#define TEST_RANK_FAILURES_H

#include <stdatomic.h>

#include "counting_allocator.h"
#include "failing_comm.h"
#include "rank_runs.h"

/* What the ranks do. Loading does not fail; NULL: it has, in another way. */
typedef struct rank_failures {
  msim_scene *(*load)(const msim_comm *comm, const msim_allocator *alloc, const void *from);
  const void *from;
  /* The first failure. *sim: NULL at first, to be destroyed */
  msim_status (*use)(const msim_scene *scene, const msim_options *opt, msim_sim **sim,
                     msim_error *why);
  msim_options opt;
  int64_t least[2]; /* allocations and calls of each rank */
  /* The allocation or call that fails, of a rank; succeeded: there are not as many */
  int of_calls;
  int32_t rank;
  int64_t fail_at;
  atomic_int succeeded;
} rank_failures;

static inline const char *check_rank_failure(msim_comm *inner, void *data) {
  rank_failures *k = data;
  const int fails = inner->rank == k->rank;
  failing_comm failing = failing_comm_of(inner, fails && k->of_calls ? k->fail_at : -1);
  const msim_comm *comm = &failing.table;
  counting_allocator count = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &count};
  msim_options opt = k->opt;
  msim_error why = {0};
  msim_state now = {.size = sizeof now};
  msim_energy e = {.size = sizeof e};
  msim_sim *sim = NULL;
  msim_scene *scene = k->load(comm, &alloc, k->from);
  EXPECT(scene);
  failing.table.self = &failing;
  opt.comm = comm, opt.threads = 1;
  const int64_t before = count.live;
  if (fails && !k->of_calls) count.fail_at = count.calls + k->fail_at;
  const msim_status status = k->use(scene, &opt, &sim, &why);
  const int64_t made = k->of_calls ? failing.calls : count.calls;
  const int has_failed = count.fail_at >= 0 ? made > count.fail_at : made > k->fail_at;
  count.fail_at = -1;
  EXPECT(!status || status == (k->of_calls ? MSIM_ERR_BACKEND : MSIM_ERR_MEMORY));
  EXPECT(!sim || k->of_calls || msim_sim_energy(sim, &e) == MSIM_OK);
  EXPECT(!sim || k->of_calls || msim_sim_state(sim, &now) == MSIM_OK);
  EXPECT(!sim || k->of_calls || msim_sim_step(sim, 2, &why) == MSIM_OK);
  if (fails && !has_failed) k->succeeded = 1;
  msim_sim_destroy(sim);
  EXPECT(count.live == before);
  msim_scene_destroy(scene);
  return NULL;
}

/* By default every SOME-th failure, on each rank another one */
static inline void check_rank_failures(const rank_failures *of) {
  enum { SOME = 6 };
  for (int32_t i = 0; i < 6; i++) {
    rank_failures k = *of;
    k.of_calls = i % 2, k.rank = i / 2;
    k.fail_at = is_long() ? 0 : k.rank;
    for (; !k.succeeded; k.fail_at += is_long() ? 1 : SOME) {
      const char *wrong = run_ranks(3, check_rank_failure, &k);
      if (wrong)
        fail_msg("rank %d, %s %d: %s", k.rank, k.of_calls ? "call" : "allocation", (int)k.fail_at,
                 wrong);
    }
    assert_true(k.fail_at > k.least[k.of_calls]);
  }
}

#endif
