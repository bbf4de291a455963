/* Iterative solvers: they meet their tolerance, without needless work, and stop at the limit.
 * Skipped for factorizations. */
#include "conformance.h"

enum { N = 150 };

typedef struct bench {
  problem *p;
  rig r;
  double *b, *y;
} bench;

static void set_up(bench *t, int32_t block) {
  t->p = spring_net(N, block, 7);
  t->b = random_vector(N * block, 3);
  t->y = calloc((size_t)(N * block), sizeof *t->y);
  assert_int_equal(rig_open(&t->r, backend, t->p), MSIM_OK);
  assert_int_equal(rig_factor(&t->r, MSIM_FACTOR_SPD), MSIM_OK);
}

static void tear_down(bench *t) {
  rig_close(&t->r);
  problem_free(t->p);
  free(t->b), free(t->y);
}

/* Number of iterations to rtol from t->y; -1: not converged. */
static int64_t solve(bench *t, double rtol, int32_t limit) {
  const msim_status status = rig_solve(&t->r, rtol, limit, 1, t->b, t->y);
  if (status == MSIM_NOT_CONVERGED) return -1;
  assert_int_equal(status, MSIM_OK);
  return t->r.info.iterations;
}

static void start_from_zero(bench *t) { memset(t->y, 0, (size_t)unknowns(t->p) * sizeof *t->y); }

/* The tightest tolerance takes most iterations. In between a method with restarts need not be
 * monotone. */
static void every_tolerance_is_reached(void **state) {
  (void)state;
  if (!iterative) skip();
  for (int32_t block = 1; block <= 3; block++) {
    const double tolerances[] = {1e-12, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10};
    int64_t most = 0;
    bench t;
    set_up(&t, block);
    for (size_t i = 0; i < sizeof tolerances / sizeof *tolerances; i++) {
      start_from_zero(&t);
      const int64_t count = solve(&t, tolerances[i], LIMIT);
      const double left = residual(t.p, t.b, t.y);
      if (count < 0 || left > tolerances[i] * (1 + 1e-9))
        fail_msg("rtol %g: %.3g is left after %lld iterations", tolerances[i], left,
                 (long long)count);
      if (i == 0) most = count;
      if (count > most) fail_msg("rtol %g takes more iterations than 1e-12", tolerances[i]);
    }
    assert_true(most > 10); /* otherwise nothing is compared */
    tear_down(&t);
  }
}

static void a_good_guess_saves_iterations(void **state) {
  (void)state;
  if (!iterative) skip();
  for (int32_t block = 1; block <= 3; block++) {
    bench t;
    set_up(&t, block);
    const int64_t cold = solve(&t, 1e-8, LIMIT);
    start_from_zero(&t);
    solve(&t, 1e-11, LIMIT);
    assert_in_range(solve(&t, 1e-8, LIMIT), 0, 1);
    for (int32_t i = 0; i < unknowns(t.p); i++) t.y[i] *= 1 + 1e-5 * (i % 3 - 1);
    const int64_t warm = solve(&t, 1e-8, LIMIT);
    if (!(warm > 0 && warm < cold))
      fail_msg("%lld iterations from near the solution, %lld from zero", (long long)warm,
               (long long)cold);
    tear_down(&t);
  }
}

/* From a distant guess the residual of the recurrence deviates from the true one, which must meet
 * rtol. */
static void a_bad_guess_does_no_harm(void **state) {
  (void)state;
  if (!iterative) skip();
  bench t;
  set_up(&t, 3);
  double *guess = random_vector(3 * N, 5);
  for (int32_t i = 0; i < 3 * N; i++) t.y[i] = 1e6 * guess[i];
  if (solve(&t, 1e-10, LIMIT) >= 0) assert_true(residual(t.p, t.b, t.y) <= 1e-10 * (1 + 1e-9));
  free(guess);
  tear_down(&t);
}

static void iterations_end_where_the_limit_is(void **state) {
  (void)state;
  if (!iterative) skip();
  for (int32_t limit = 1; limit <= 8; limit *= 2) {
    bench t;
    set_up(&t, 3);
    assert_int_equal(solve(&t, 1e-10, limit), -1);
    assert_in_range(t.r.info.iterations, 1, limit);
    start_from_zero(&t); /* y is undefined after a failed solve */
    assert_true(solve(&t, 1e-10, LIMIT) > limit);
    tear_down(&t);
  }
}

/* With a tolerance below rounding the iteration must end, with an error at rounding level. */
static void a_goal_out_of_reach_ends_at_rounding_level(void **state) {
  (void)state;
  if (!iterative) skip();
  bench t;
  set_up(&t, 3);
  solve(&t, 1e-300, 2000);
  assert_true(backward_error(t.p, t.b, t.y) < 1e-13);
  tear_down(&t);
}

int run_iterations(void) {
  const struct CMUnitTest tests[] = {conformance_test(every_tolerance_is_reached),
                                     conformance_test(a_good_guess_saves_iterations),
                                     conformance_test(a_bad_guess_does_no_harm),
                                     conformance_test(iterations_end_where_the_limit_is),
                                     conformance_test(a_goal_out_of_reach_ends_at_rounding_level)};
  return cmocka_run_group_tests_name("iterations", tests, NULL, NULL);
}
