/* Tests of ranks that can no longer communicate: each call of one rank that fails is a failure on
 * all, none waits for another one, and none reads what it has not received. */
#include <stdatomic.h>

#include "angle_scenes.h"
#include "failing_comm.h"
#include "rank_runs.h"

static const char *check_lost_rank(msim_comm *comm, void *data) {
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim;
  msim_error why;
  msim_state s = {.size = sizeof s};
  opt.comm = comm;
  EXPECT(msim_sim_create(data, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 7, &why) == MSIM_OK);
  if (comm->rank == 1) msim_comm_threads_fail(comm, "rank 1 has ended");
  if (comm->rank != 1) {
    EXPECT(msim_sim_step(sim, 100, &why) == MSIM_ERR_BACKEND);
    EXPECT(strstr(why.text, "rank 1 has ended"));
    EXPECT(msim_sim_step(sim, 1, &why) == MSIM_ERR_BACKEND);
    EXPECT(msim_sim_state(sim, &s) == MSIM_ERR_BACKEND);
  }
  msim_sim_destroy(sim);
  return NULL;
}

static void no_rank_waits_for_one_that_has_ended(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(9, 100, 0.01);
  const char *wrong = run_ranks(3, check_lost_rank, cloth);
  if (wrong) fail_msg("%s", wrong);
  msim_scene_destroy(cloth);
}

/* The call `fail_at` of rank `rank` fails while a sim is created, or in its first step. */
typedef struct call_case {
  const msim_scene *scene;
  const char *method;
  int32_t rank;
  int64_t fail_at;
  atomic_int succeeded;
} call_case;

static const char *check_failed_call(msim_comm *inner, void *data) {
  call_case *k = data;
  failing_comm failing = failing_comm_of(inner, inner->rank == k->rank ? k->fail_at : -1);
  const msim_comm *comm = &failing.table;
  msim_options opt = options(k->method, 1e-4);
  msim_sim *sim = NULL;
  msim_error why = {0};
  failing.table.self = &failing;
  opt.comm = comm, opt.threads = 1;
  msim_status status = msim_sim_create(k->scene, &opt, &sim, &why);
  EXPECT(!status == !!sim);
  if (!status) status = msim_sim_step(sim, 1, &why);
  const int has_failed = failing.calls > k->fail_at; /* known after the next step, at the latest */
  if (!status && has_failed) status = msim_sim_step(sim, 1, &why);
  EXPECT(status == (has_failed ? MSIM_ERR_BACKEND : MSIM_OK));
  EXPECT(!status || strstr(why.text, "the network is down"));
  if (!status) k->succeeded = 1;
  msim_sim_destroy(sim);
  return NULL;
}

/* Nothing is read of what a failed call was to receive. */
static void each_call_that_fails_is_a_failure_on_all_ranks(void **state) {
  (void)state;
  const char *methods[] = {"velocity-verlet", "linearly-implicit-euler"};
  msim_scene *scene = bending_cloth(6, 300, 0.01, 0.001);
  for (int32_t rank = 0; rank < 3; rank++)
    for (int i = 0; i < 2; i++) {
      call_case k = {.scene = scene, .method = methods[i], .rank = rank};
      for (; !k.succeeded; k.fail_at++) {
        const char *wrong = run_ranks(3, check_failed_call, &k);
        if (wrong) fail_msg("%s, call %d: %s", methods[i], (int)k.fail_at, wrong);
      }
      assert_true(k.fail_at > 15);
    }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(no_rank_waits_for_one_that_has_ended),
      cmocka_unit_test(each_call_that_fails_is_a_failure_on_all_ranks),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
