/* Tests of plugins that load and then fail, return wrong results or write where they must not: msim
 * detects each fault, and its message is useful. */
#define _GNU_SOURCE /* mkdtemp */
#include "faulty_plugins.h"

static void failures_are_passed_on(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"create_fails", MSIM_ERR_BACKEND, "create_fails: nobody is at home"},
      {"order_fails", MSIM_ERR_BACKEND, "order_fails: no order in here"},
      {"fails", MSIM_ERR_BACKEND, "fails: the moon is in the wrong house"},
      {"silent", MSIM_ERR_BACKEND, "silent: the library behind a plugin failed"},
      {"no_self", MSIM_ERR_BACKEND, "no_self: create() gave no instance"},
  };
  EXPECT_PLUGINS(lies);
}

static void orders_are_checked(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"row_too_large", MSIM_ERR_BACKEND,
       "row_too_large: the order it asks for is no permutation of 7 rows"},
      {"row_negative", MSIM_ERR_BACKEND,
       "row_negative: the order it asks for is no permutation of 7 rows"},
      {"row_twice", MSIM_ERR_BACKEND,
       "row_twice: the order it asks for is no permutation of 7 rows"},
  };
  EXPECT_PLUGINS(lies);
}

static void statuses_are_checked(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"stops", MSIM_ERR_BACKEND,
       "step 1, t = 0.01 s: stops: it returned 4, which is no status of a backend"},
      {"invents_a_status", MSIM_ERR_BACKEND,
       "step 1, t = 0.01 s: invents_a_status: it returned 77, which is no status of a backend"},
      {"invents_an_error", MSIM_ERR_BACKEND,
       "step 1, t = 0.01 s: invents_an_error: it returned -99, which is no status of a backend"},
  };
  EXPECT_PLUGINS(lies);
}

static void solutions_are_checked(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"liar", MSIM_NOT_CONVERGED,
       "step 1, t = 0.01 s, particle 1: solver liar left a residual of 64.9 of the right side; "
       "solver.rtol asks for 1e-10"},
      {"nan_answer", MSIM_NOT_CONVERGED,
       "step 1, t = 0.01 s, particle 5: solver nan_answer gave an answer that is not "
       "finite"},
      {"inf_answer", MSIM_NOT_CONVERGED,
       "step 1, t = 0.01 s, particle 5: solver inf_answer gave an answer that is not "
       "finite"},
  };
  EXPECT_PLUGINS(lies);
}

/* The matrix is positive definite: indefinite = clamp makes a second attempt, and then the user
 * gets the status. */
static void a_false_not_spd_is_reported(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"never_spd", MSIM_NOT_SPD,
       "step 1, t = 0.01 s: never_spd: the system matrix is not positive definite"},
      {"once_spd", MSIM_NOT_SPD,
       "step 2, t = 0.02 s: once_spd: the system matrix is not positive definite"},
  };
  EXPECT_PLUGINS(lies);
}

/* msim does not depend on what these plugins overwrite or report: the results are right. */
static void overwritten_arguments_do_not_matter(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"writes_values", MSIM_OK, ""},     {"writes_pattern", MSIM_OK, ""},
      {"writes_right_side", MSIM_OK, ""}, {"nan_in_info", MSIM_OK, ""},
      {"counts_backwards", MSIM_OK, ""},  {"never_there", MSIM_OK, ""},
  };
  EXPECT_PLUGINS(lies);
}

/* Counts that a backend reports are added only if they are possible. */
static void counts_never_fall(void **state) {
  (void)state;
  double x[27];
  msim_stats stats;
  copy_plugin("counts_backwards");
  assert_ok(run_with_solver("counts_backwards", plugin_folder, x, &stats, err));
  assert_int_equal(stats.iterations, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(failures_are_passed_on),
      cmocka_unit_test(orders_are_checked),
      cmocka_unit_test(statuses_are_checked),
      cmocka_unit_test(solutions_are_checked),
      cmocka_unit_test(a_false_not_spd_is_reported),
      cmocka_unit_test(overwritten_arguments_do_not_matter),
      cmocka_unit_test(counts_never_fall),
  };
  return cmocka_run_group_tests_name("liars", tests, make_folder, remove_folder);
}
