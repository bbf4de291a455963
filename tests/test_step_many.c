/* Tests that many sims, stepped together by any number of threads, have the bits of sims that are
 * stepped alone, that the first failure of the array is reported while all others go on, and that
 * sims which cannot be stepped are refused. */
#include "scenes.h"

enum { NSIMS = 23, STEPS = 7, MOST = 400 };
static const char *const methods[] = {"verlet", "velocity-verlet", "rk4", "linearly-implicit-euler",
                                      "implicit-euler"};
enum { NMETHODS = sizeof methods / sizeof *methods };

/* Cloths of several sizes by several methods; sim `stuck` does not converge */
static void make(msim_sim **sims, int stuck) {
  for (int i = 0; i < NSIMS; i++) {
    msim_scene *scene = hanging_cloth(5 + i % 9, 200, 0);
    msim_options opt = options(methods[i % NMETHODS], 1e-3);
    opt.threads = 1, opt.steps = 100;
    if (i == stuck)
      opt.integrator = "implicit-euler", opt.newton_max_iterations = 1, opt.newton_rtol = 1e-14;
    sims[i] = make_sim(scene, &opt);
    msim_scene_destroy(scene);
  }
}

static void destroy(msim_sim **sims) {
  for (int i = 0; i < NSIMS; i++) msim_sim_destroy(sims[i]);
}

static void expect_same_state(msim_sim *a, msim_sim *b) {
  const msim_state p = state_of(a), q = state_of(b);
  assert_int_equal(p.step, q.step);
  assert_memory_equal(p.x, q.x, 3 * (size_t)p.n * sizeof *p.x);
  assert_memory_equal(p.v, q.v, 3 * (size_t)p.n * sizeof *p.v);
}

static void threads_do_not_change_the_bits(void **state) {
  (void)state;
  static const int32_t threads[] = {0, 1, 2, 5, 40};
  msim_sim *alone[NSIMS], *together[NSIMS];
  make(alone, -1);
  for (int i = 0; i < NSIMS; i++) assert_ok(msim_sim_step(alone[i], STEPS, err));
  for (size_t t = 0; t < sizeof threads / sizeof *threads; t++) {
    msim_error errors[NSIMS];
    make(together, -1);
    memset(errors, 1, sizeof errors);
    assert_ok(msim_sim_step_many(together, NSIMS, STEPS - 2, threads[t], errors, err));
    for (int i = 0; i < NSIMS; i++) {
      assert_int_equal(errors[i].status, MSIM_OK);
      assert_string_equal(errors[i].text, "");
    }
    assert_ok(msim_sim_step_many(together, NSIMS, 2, threads[t], NULL, err));
    for (int i = 0; i < NSIMS; i++) expect_same_state(alone[i], together[i]);
    destroy(together);
  }
  destroy(alone);
}

/* The first one of the array is reported, whichever fails first in time. */
static void failures_stop_none_of_the_others(void **state) {
  (void)state;
  for (int32_t threads = 1; threads < 4; threads++) {
    msim_sim *sims[NSIMS];
    msim_error errors[NSIMS], err;
    make(sims, 6);
    msim_sim_stop(sims[17]);
    const msim_status result = msim_sim_step_many(sims, NSIMS, STEPS, threads, errors, &err);
    assert_int_equal(result, MSIM_NOT_CONVERGED);
    assert_int_equal(err.status, result);
    assert_ptr_equal(strstr(err.text, "sims[6]: "), err.text);
    assert_string_equal(err.text + strlen("sims[6]: "), errors[6].text);
    for (int i = 0; i < NSIMS; i++) {
      const int64_t step = state_of(sims[i]).step;
      assert_int_equal(errors[i].status, i == 6    ? MSIM_NOT_CONVERGED
                                         : i == 17 ? MSIM_STOPPED
                                                   : MSIM_OK);
      assert_int_equal(step, i == 6 ? 0 : i == 17 ? 1 : STEPS);
    }
    destroy(sims);
  }
}

static void expect_refused(msim_sim *const *sims, int32_t n, int64_t steps, int32_t threads,
                           const char *words) {
  msim_error err;
  assert_int_equal(msim_sim_step_many(sims, n, steps, threads, NULL, &err), MSIM_ERR_ARG);
  assert_non_null(strstr(err.text, words));
}

static int step_the_batch(msim_sim *sim, void *user) {
  msim_sim **sims = user;
  expect_refused(sims, NSIMS, 1, 2, "sims[3] is in its observer");
  assert_int_equal(state_of(sim).step, 0);
  return 1;
}

static void bad_arguments_step_none(void **state) {
  (void)state;
  msim_sim *sims[NSIMS];
  make(sims, -1);
  msim_sim *const twice = sims[4], *const last = sims[NSIMS - 1];
  expect_refused(NULL, 2, 1, 1, "sims is NULL");
  expect_refused(sims, -1, 1, 1, "negative");
  expect_refused(sims, NSIMS, -1, 1, "negative");
  expect_refused(sims, NSIMS, 1, -1, "threads must be 0 to 256, not -1");
  expect_refused(sims, NSIMS, 1, 257, "not 257");
  sims[NSIMS - 1] = NULL;
  expect_refused(sims, NSIMS, 1, 2, "sims[22] is NULL");
  sims[NSIMS - 1] = twice;
  expect_refused(sims, NSIMS, 1, 2, "sims[22] is there twice");
  sims[NSIMS - 1] = last;
  assert_int_equal(msim_sim_run(sims[3], step_the_batch, sims, NULL), MSIM_STOPPED);
  for (int i = 0; i < NSIMS; i++) assert_int_equal(state_of(sims[i]).step, 0);
  assert_ok(msim_sim_step_many(NULL, 0, 3, 2, NULL, err));
  assert_ok(msim_sim_step_many(sims, NSIMS, 0, 2, NULL, err));
  assert_ok(msim_sim_step_many(sims, NSIMS, 1, 2, NULL, NULL)); /* refusals leave no flags */
  for (int i = 0; i < NSIMS; i++) assert_int_equal(state_of(sims[i]).step, 1);
  destroy(sims);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(threads_do_not_change_the_bits),
                                     cmocka_unit_test(failures_stop_none_of_the_others),
                                     cmocka_unit_test(bad_arguments_step_none)};
  return cmocka_run_group_tests_name("step_many", tests, NULL, NULL);
}
