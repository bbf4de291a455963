/* Refusals: invalid sizes, lack of memory, numbers that are not finite. */
#include <math.h>

#include "conformance.h"

/*------------------------------------- arguments ------------------------------------------------*/

/* A system with invalid sizes or formats must be refused before it is read. */
static void impossible_systems_are_refused(void **state) {
  (void)state;
  const struct {
    int32_t n, block, format; /* format: that of the backend and so many */
  } cases[] = {{5, 0, 0}, {5, -1, 0}, {5, 4, 0},  {-1, 1, 0}, {5, 1, 1},
               {5, 1, 2}, {5, 1, -1}, {5, 1, -2}, {5, 1, 17}};
  problem *p = spring_net(5, 1, 1);
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    rig r;
    rig_init(&r, bare, p);
    assert_int_equal(rig_create(&r), MSIM_OK);
    r.A.n = cases[i].n, r.A.block = cases[i].block, r.A.format += cases[i].format;
    const msim_status status = rig_analyze(&r);
    if (status != MSIM_ERR_ARG || !r.host.sentence[0])
      fail_msg("n %d, block %d, format %d: status %d, \"%s\"", cases[i].n, cases[i].block,
               r.A.format, (int)status, r.host.sentence);
    rig_close(&r);
  }
  problem_free(p);
}

/* msim never makes such a call; another host might. */
static void no_rows_at_all(void **state) {
  (void)state;
  problem *p = spring_net(0, 1, 1);
  rig r;
  msim_status status = rig_open(&r, bare, p);
  if (!status) status = rig_factor(&r, MSIM_FACTOR_SPD);
  if (!status) status = rig_solve(&r, RTOL, LIMIT, 1, NULL, NULL);
  if (status && status != MSIM_ERR_ARG) fail_msg("status %d", (int)status);
  rig_close(&r);
  problem_free(p);
}

static void no_right_sides_are_refused(void **state) {
  (void)state;
  problem *p = spring_net(5, 2, 1);
  double *b = random_vector(10, 3), y[10] = {0};
  rig r;
  assert_int_equal(rig_open(&r, bare, p), MSIM_OK);
  assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
  for (int32_t nrhs = 0; nrhs > -3; nrhs--) {
    assert_int_equal(rig_solve(&r, RTOL, LIMIT, nrhs, b, y), MSIM_ERR_ARG);
    assert_true(r.host.sentence[0]);
  }
  assert_int_equal(rig_solve(&r, RTOL, LIMIT, 1, b, y), MSIM_OK);
  assert_true(is_solution(p, b, y, RTOL, 1e-13));
  rig_close(&r);
  free(b), problem_free(p);
}

/*------------------------------------- destroy --------------------------------------------------*/

static void destroy_may_follow_any_call(void **state) {
  (void)state;
  problem *p = spring_net(5, 3, 1);
  backend->destroy(NULL);
  bare->destroy(NULL);
  for (int calls = 1; calls <= 3; calls++) {
    rig r;
    rig_init(&r, backend, p);
    assert_int_equal(rig_create(&r), MSIM_OK);
    if (calls > 1) assert_int_equal(rig_analyze(&r), MSIM_OK);
    if (calls > 2) assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
    rig_close(&r);
  }
  problem_free(p);
}

/*------------------------------------- memory ---------------------------------------------------*/

/* An allocation from the host fails, and all later ones, for each allocation in turn: the call
 * returns MSIM_ERR_MEMORY or succeeds without it; destroy() frees the rest. */
static void memory_that_ends_is_reported(void **state) {
  (void)state;
  const int32_t n = 12, block = 3;
  problem *p = spring_net(n, block, 1);
  double *b = random_vector(n * block, 3), *y = calloc((size_t)(n * block), sizeof *y);
  int ended = 1;
  for (int allocations = 1; ended; allocations++) {
    rig r;
    rig_init(&r, backend, p);
    r.host.fail_at = allocations;
    msim_status status = rig_create(&r);
    if (!status) status = rig_analyze(&r);
    if (!status) status = rig_factor(&r, MSIM_FACTOR_SPD);
    if (!status) status = rig_solve(&r, RTOL, LIMIT, 1, b, y);
    ended = r.host.fails;
    if (status && status != MSIM_ERR_MEMORY)
      fail_msg("allocation %d failed: status %d, \"%s\"", allocations, (int)status,
               r.host.sentence);
    if (!ended) assert_int_equal(status, MSIM_OK);
    rig_close(&r);
  }
  free(b), free(y), problem_free(p);
}

/*------------------------------------- NaN and infinity -----------------------------------------*/

static int all_finite(const double *y, int n) {
  for (int i = 0; i < n; i++)
    if (!isfinite(y[i])) return 0;
  return 1;
}

/* The host promises finite numbers. If it breaks that promise, the call must return, and later
 * calls with finite numbers must not be affected. */
static void nan_and_inf_do_not_affect_later_calls(void **state) {
  (void)state;
  enum { SIZE = 3 * 20 };
  problem *good = spring_net(20, 3, 1);
  double *b = random_vector(SIZE, 3), *spoilt = random_vector(SIZE, 3), y[SIZE];
  outcome fresh = solve_with(bare, good, MSIM_FACTOR_SPD, b);
  const double bad[] = {NAN, INFINITY, -INFINITY};
  rig r;
  assert_int_equal(rig_open(&r, bare, good), MSIM_OK);
  for (size_t i = 0; i < 3 * 3; i++) {
    problem *p = spring_net(20, 3, 1);
    if (i < 6) p->entries[i < 3 ? 7 : SIZE].value = bad[i % 3]; /* on the diagonal; off it */
    else spoilt[SIZE / 2] = bad[i % 3];
    rig_set(&r, p);
    memset(y, 0, sizeof y);
    if (!rig_factor(&r, MSIM_FACTOR_SPD) && !rig_solve(&r, RTOL, 200, 1, i < 6 ? b : spoilt, y) &&
        i >= 6)
      assert_false(all_finite(y, SIZE)); /* no finite solution has this right-hand side */
    rig_set(&r, good);
    memset(y, 0, sizeof y);
    assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
    assert_int_equal(rig_solve(&r, RTOL, LIMIT, 1, b, y), MSIM_OK);
    assert_same("after NaN and Inf", y, fresh.y, SIZE);
    problem_free(p);
  }
  rig_close(&r);
  free(b), free(spoilt), free(fresh.y), problem_free(good);
}

int run_refusals(void) {
  const struct CMUnitTest tests[] = {conformance_test(impossible_systems_are_refused),
                                     conformance_test(no_rows_at_all),
                                     conformance_test(no_right_sides_are_refused),
                                     conformance_test(destroy_may_follow_any_call),
                                     conformance_test(memory_that_ends_is_reported),
                                     conformance_test(nan_and_inf_do_not_affect_later_calls)};
  return cmocka_run_group_tests_name("refusals", tests, NULL, NULL);
}
