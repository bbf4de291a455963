/* Tests of plugins that load and then fail, return wrong results or write where they must not: msim
 * detects each fault, and its message is useful. */
#define _GNU_SOURCE /* mkdtemp */
#include "faulty_plugins.h"

static void failures_are_passed_on(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"create_fails", MSIM_ERR_BACKEND, "create_fails: create failed on request"},
      {"order_fails", MSIM_ERR_BACKEND, "order_fails: order failed on request"},
      {"fails", MSIM_ERR_BACKEND, "fails: analyze failed on request"},
      {"silent", MSIM_ERR_BACKEND, "silent: the library behind a plugin failed"},
      {"no_instance", MSIM_ERR_BACKEND,
       "solver 'no_instance': create() returned MSIM_OK but no instance; report this to the author "
       "of "
       "the plugin"},
  };
  EXPECT_PLUGINS(lies);
}

static void orders_and_formats_are_checked(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"chooses_7", MSIM_ERR_BACKEND,
       "solver 'chooses_7': choose_format() returned 7, which is no format of msim/backend.h; "
       "report "
       "this to the author of the plugin"},
      {"row_too_large", MSIM_ERR_BACKEND,
       "solver 'row_too_large': order() did not return a permutation of the 7 block rows; report "
       "this to the author of the plugin"},
      {"row_negative", MSIM_ERR_BACKEND,
       "solver 'row_negative': order() did not return a permutation of the 7 block rows; report "
       "this to the author of the plugin"},
      {"row_twice", MSIM_ERR_BACKEND,
       "solver 'row_twice': order() did not return a permutation of the 7 block rows; report this "
       "to the author of the plugin"},
  };
  EXPECT_PLUGINS(lies);
}

static void statuses_are_checked(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"stops", MSIM_ERR_BACKEND,
       "step 1, t = 0.01 s: stops: returned status 4, which is not one that a backend may return "
       "(see msim/backend.h)"},
      {"invents_a_status", MSIM_ERR_BACKEND,
       "step 1, t = 0.01 s: invents_a_status: returned status 77, which is not one that a backend "
       "may return (see msim/backend.h)"},
      {"invents_an_error", MSIM_ERR_BACKEND,
       "step 1, t = 0.01 s: invents_an_error: returned status -99, which is not one that a backend "
       "may return (see msim/backend.h)"},
  };
  EXPECT_PLUGINS(lies);
}

static void solutions_are_checked(void **state) {
  (void)state;
  const plugin_case lies[] = {
      {"liar", MSIM_NOT_CONVERGED,
       "step 1, t = 0.01 s, particle 1: solver liar reached a relative residual of 64.9, not "
       "1e-10; raise solver.rtol"},
      {"nan_answer", MSIM_NOT_CONVERGED,
       "step 1, t = 0.01 s, particle 5: the solution of solver nan_answer is not finite"},
      {"inf_answer", MSIM_NOT_CONVERGED,
       "step 1, t = 0.01 s, particle 5: the solution of solver inf_answer is not finite"},
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
      {"writes_values", MSIM_OK, ""},    {"writes_pattern", MSIM_OK, ""},
      {"writes_rhs", MSIM_OK, ""},       {"nan_in_info", MSIM_OK, ""},
      {"counts_backwards", MSIM_OK, ""}, {"never_converges", MSIM_OK, ""},
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
      cmocka_unit_test(orders_and_formats_are_checked),
      cmocka_unit_test(statuses_are_checked),
      cmocka_unit_test(solutions_are_checked),
      cmocka_unit_test(a_false_not_spd_is_reported),
      cmocka_unit_test(overwritten_arguments_do_not_matter),
      cmocka_unit_test(counts_never_fall),
  };
  return cmocka_run_group_tests_name("faulty_backends", tests, make_folder, remove_folder);
}
