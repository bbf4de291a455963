/* Solutions: accurate for every positive definite system, and the same bits every time. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "conformance.h"

static const kind well_posed[] = {{"random", random_dominant, 1}, {"springs", spring_net, 1}, {0}};

/*------------------------------------- accuracy -------------------------------------------------*/

static void check_answer(const char *label, const problem *p) {
  double *b = random_vector(unknowns(p), 3);
  outcome o = solve_with(backend, p, MSIM_FACTOR_SPD, b);
  if (o.status == MSIM_NOT_CONVERGED && iterative) o.status = MSIM_OK; /* at rounding level? */
  if (o.status) fail_msg("%s: %s gave status %d", label, o.call, (int)o.status);
  if (!is_solution(p, b, o.y, RTOL, 1e-13))
    fail_msg("%s: residual %.3g, backward error %.3g", label, residual(p, b, o.y),
             backward_error(p, b, o.y));
  if (o.definite == MSIM_DEFINITE_NOT) fail_msg("%s: reported as indefinite", label);
  if (iterative && o.iterations < 1) fail_msg("%s: reports no iterations", label);
  if (!iterative && !(o.fill > 0 && (o.flops > 0 || unknowns(p) == 1)))
    fail_msg("%s: reports no fill or no flops", label);
  free(b), free(o.y);
}

static void positive_definite_systems_are_solved(void **state) {
  (void)state;
  for_each(well_posed, (const int32_t[]){1, 2, 3, 10, 50, 200, 0}, check_answer);
}

/* A factorization must solve it; an iteration may give up, but must not return a wrong solution as
 * right. */
static void check_hard(const char *label, const problem *p) {
  double *b = random_vector(unknowns(p), 3);
  outcome o = solve_with(backend, p, MSIM_FACTOR_SPD, b);
  const int gave_up = iterative && o.status == MSIM_NOT_CONVERGED;
  if (!gave_up && o.status) fail_msg("%s: %s gave status %d", label, o.call, (int)o.status);
  if (!gave_up && !is_solution(p, b, o.y, RTOL, 1e-13))
    fail_msg("%s: residual %.3g, backward error %.3g", label, residual(p, b, o.y),
             backward_error(p, b, o.y));
  free(b), free(o.y);
}

static void scales_do_not_matter(void **state) {
  (void)state;
  const kind hard[] = {{"scaled rows", badly_scaled, 1},
                       {"unequal masses", unequal_masses, 1},
                       {"tiny", random_dominant, 1e-200},
                       {"huge", random_dominant, 1e150},
                       {"tiny springs", spring_net, 1e-200},
                       {"small pivots", small_pivots, 1},
                       {0}};
  for_each(hard, (const int32_t[]){1, 10, 100, 0}, check_hard);
}

static void check_zero(const char *label, const problem *p) {
  double *b = calloc((size_t)unknowns(p), sizeof *b);
  outcome o = solve_with(backend, p, MSIM_FACTOR_SPD, b);
  if (o.status) fail_msg("%s: %s gave status %d", label, o.call, (int)o.status);
  for (int32_t i = 0; i < unknowns(p); i++)
    if (o.y[i] != 0) fail_msg("%s: y[%d] = %g for b = 0", label, i, o.y[i]);
  free(b), free(o.y);
}

static void zero_has_the_answer_zero(void **state) {
  (void)state;
  for_each(well_posed, (const int32_t[]){1, 30, 0}, check_zero);
}

/* With a loose tolerance the solver may do less work, also in later calls, but must meet the
 * tolerance. */
static void check_rough(const char *label, const problem *p) {
  const double rough = 1e-3;
  const int32_t n = unknowns(p);
  double *b = random_vector(n, 3), *y = calloc((size_t)n, sizeof *y);
  rig r;
  assert_int_equal(rig_open(&r, backend, p), MSIM_OK);
  assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
  for (int time = 0; time < 3; time++) {
    memset(y, 0, (size_t)n * sizeof *y);
    const msim_status status = rig_solve(&r, rough, LIMIT, 1, b, y);
    if (iterative && status == MSIM_NOT_CONVERGED) break;
    assert_int_equal(status, MSIM_OK);
    if (!is_solution(p, b, y, rough, 1e-6))
      fail_msg("%s: residual %.3g, backward error %.3g", label, residual(p, b, y),
               backward_error(p, b, y));
  }
  rig_close(&r);
  free(b), free(y);
}

static void rough_answers_are_as_good_as_asked(void **state) {
  (void)state;
  const kind kinds[] = {{"random", random_dominant, 1},    {"springs", spring_net, 1},
                        {"tiny", random_dominant, 1e-200}, {"huge", random_dominant, 1e150},
                        {"small pivots", small_pivots, 1}, {0}};
  for_each(kinds, (const int32_t[]){1, 10, 200, 0}, check_rough);
}

/*------------------------------------- several right-hand sides ---------------------------------*/

static void check_many(const char *label, const problem *p) {
  enum { MANY = 5 };
  const int32_t n = unknowns(p);
  double *b = random_vector(MANY * n, 3), *together = calloc((size_t)(MANY * n), sizeof *b);
  rig r;
  assert_int_equal(rig_open(&r, backend, p), MSIM_OK);
  assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
  assert_int_equal(rig_solve(&r, RTOL, LIMIT, MANY, b, together), MSIM_OK);
  for (int32_t k = 0; k < MANY; k++)
    if (!is_solution(p, b + k * n, together + k * n, RTOL, 1e-13))
      fail_msg("%s: right-hand side %d of several: residual %.3g", label, k,
               residual(p, b + k * n, together + k * n));
  rig_close(&r);
  free(b), free(together);
}

/* Not with the bits of single solutions, as BLAS sums in another order for several. */
static void many_right_sides_are_solved_as_one(void **state) {
  (void)state;
  for_each(well_posed, (const int32_t[]){1, 7, 60, 0}, check_many);
}

/*------------------------------------- reproducibility ------------------------------------------*/

static void check_repeats(const char *label, const problem *p) {
  const int32_t n = unknowns(p);
  double *b = random_vector(n, 3);
  outcome first = solve_with(backend, p, MSIM_FACTOR_SPD, b);
  outcome again = solve_with(bare, p, MSIM_FACTOR_SPD, b);
  double *y = calloc(2 * (size_t)n, sizeof *y);
  rig r;
  assert_same(label, first.y, again.y, n);
  assert_int_equal(rig_open(&r, backend, p), MSIM_OK);
  assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
  assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
  for (int32_t k = 0; k < 2; k++)
    assert_int_equal(rig_solve(&r, RTOL, LIMIT, 1, b, y + k * n), MSIM_OK);
  assert_same(label, first.y, y, n);
  assert_same(label, first.y, y + n, n);
  rig_close(&r);
  free(b), free(y), free(first.y), free(again.y);
}

static void the_same_calls_give_the_same_bits(void **state) {
  (void)state;
  for_each(well_posed, (const int32_t[]){1, 60, 150, 0}, check_repeats);
}

/* New values in the pattern of one instance give the solution of a fresh instance. */
static void new_values_forget_the_old_ones(void **state) {
  (void)state;
  enum { N = 40, ROUNDS = 5 };
  for (int32_t block = 1; block <= 3; block++) {
    problem *p[ROUNDS];
    rig r;
    for (int k = 0; k < ROUNDS; k++) p[k] = random_dominant(N, block, (uint64_t)k);
    double *b = random_vector(N * block, 3);
    assert_int_equal(rig_open(&r, backend, p[0]), MSIM_OK);
    for (int k = 0; k < ROUNDS; k++) {
      double y[3 * N] = {0};
      rig_set(&r, p[k]);
      assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
      assert_int_equal(rig_solve(&r, RTOL, LIMIT, 1, b, y), MSIM_OK);
      outcome fresh = solve_with(backend, p[k], MSIM_FACTOR_SPD, b);
      assert_same("new values", y, fresh.y, N * block);
      free(fresh.y);
    }
    rig_close(&r);
    for (int k = 0; k < ROUNDS; k++) problem_free(p[k]);
    free(b);
  }
}

/* Values written after factor() do not affect the present factorization. */
static void a_factor_keeps_its_own_values(void **state) {
  (void)state;
  enum { N = 20 };
  if (iterative) skip();
  problem *then = random_dominant(N, 2, 1), *now = random_dominant(N, 2, 2);
  double *b = random_vector(2 * N, 3), y[2 * N];
  outcome fresh = solve_with(backend, then, MSIM_FACTOR_SPD, b);
  rig r;
  assert_int_equal(rig_open(&r, backend, then), MSIM_OK);
  assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
  rig_set(&r, now);
  assert_int_equal(rig_solve(&r, RTOL, LIMIT, 1, b, y), MSIM_OK);
  assert_same("old factor", y, fresh.y, 2 * N);
  rig_close(&r);
  free(b), free(fresh.y), problem_free(then), problem_free(now);
}

/* Only iterations may read the initial guess. */
static void a_factor_needs_no_guess(void **state) {
  (void)state;
  enum { N = 20 };
  if (iterative) skip();
  problem *p = spring_net(N, 3, 1);
  double *b = random_vector(3 * N, 3), y[3 * N];
  outcome zero = solve_with(backend, p, MSIM_FACTOR_SPD, b);
  rig r;
  for (int i = 0; i < 3 * N; i++) y[i] = NAN;
  assert_int_equal(rig_open(&r, backend, p), MSIM_OK);
  assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
  assert_int_equal(rig_solve(&r, RTOL, LIMIT, 1, b, y), MSIM_OK);
  assert_same("no guess", y, zero.y, 3 * N);
  rig_close(&r);
  free(b), free(zero.y), problem_free(p);
}

int run_solutions(void) {
  const struct CMUnitTest tests[] = {conformance_test(positive_definite_systems_are_solved),
                                     conformance_test(scales_do_not_matter),
                                     conformance_test(zero_has_the_answer_zero),
                                     conformance_test(rough_answers_are_as_good_as_asked),
                                     conformance_test(many_right_sides_are_solved_as_one),
                                     conformance_test(the_same_calls_give_the_same_bits),
                                     conformance_test(new_values_forget_the_old_ones),
                                     conformance_test(a_factor_keeps_its_own_values),
                                     conformance_test(a_factor_needs_no_guess)};
  return cmocka_run_group_tests_name("answers", tests, NULL, NULL);
}
