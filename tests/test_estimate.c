/* Tests of msim_sim_estimate: with fixed steps it foretells the counts of the run, it changes
 * nothing, and explain prints it. */
#include <math.h>

#include "scenes.h"

static msim_stats stats_after(msim_sim *sim, int64_t n) {
  msim_stats s = {.size = sizeof s};
  if (n > 0) assert_ok(msim_sim_step(sim, n, err));
  assert_int_equal(msim_sim_stats(sim, &s), MSIM_OK);
  return s;
}

static msim_estimate estimate_of(msim_sim *sim) {
  msim_estimate e = {.size = sizeof e};
  assert_ok(msim_sim_estimate(sim, &e, err));
  return e;
}

static int is_one_of_explicit(const msim_integrator_entry *entry) {
  return !entry->implicit && entry->order > 0;
}

/* All steps of an explicit method but the first one cost the same, also in the middle of a run. */
static void explicit_counts_are_exact(void **state) {
  (void)state;
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++) {
    if (!is_one_of_explicit(entry)) continue;
    msim_scene *scene = hanging_cloth(5, 100, 0);
    msim_options opt = options(entry->name, 1e-3);
    opt.steps = 50;
    msim_sim *sim = make_sim(scene, &opt);
    for (int64_t made = 0; made <= 50; made += 25) {
      const msim_estimate e = estimate_of(sim);
      const int64_t before = stats_after(sim, 0).force_evaluations;
      msim_sim *clone;
      assert_ok(msim_sim_clone(sim, &clone, err));
      const int64_t after = stats_after(clone, 50 - made).force_evaluations;
      if (e.steps != (double)(50 - made) || e.force_evaluations != (double)(after - before) ||
          e.solves + e.iterations + e.factorizations != 0)
        fail_msg("%s: %g evaluations in %g steps, not %lld", entry->name, e.force_evaluations,
                 e.steps, (long long)(after - before));
      assert_int_equal(e.tried, made < 50 ? 4 : 0);
      msim_sim_destroy(clone);
      if (made < 50) assert_ok(msim_sim_step(sim, 25, err));
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A linearly implicit step solves one system; the number of iterations hardly changes. */
static void implicit_counts(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(6, 100, 0.01);
  msim_options opt = options("linearly-implicit-euler", 0.01);
  opt.steps = 100, opt.solver = "pcg";
  msim_sim *sim = make_sim(scene, &opt);
  const msim_estimate e = estimate_of(sim);
  const msim_stats s = stats_after(sim, 100);
  assert_true(e.steps == 100 && e.solves == 100 && e.force_evaluations == 100);
  assert_int_equal(s.solves, 100);
  assert_in_range((int64_t)e.iterations, s.iterations * 2 / 3, s.iterations * 3 / 2);
  assert_true(e.work > e.force_evaluations + 1.5 * e.iterations);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Steps of a pendulum under error control differ, but not much. */
static void steps_under_error_control(void **state) {
  (void)state;
  const double tol[] = {1e-3, 1e-6, 1e-9};
  for (int i = 0; i < 3; i++) {
    msim_scene *scene = hanging_cloth(2, 100, 0);
    msim_options opt = options("dop853", 1e-3);
    opt.steps = -1, opt.t_end = 5, opt.tol = tol[i];
    msim_sim *sim = make_sim(scene, &opt);
    const msim_estimate e = estimate_of(sim);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    const msim_stats s = stats_after(sim, 0);
    assert_in_range((int64_t)e.steps, s.steps / 2, 2 * s.steps);
    assert_in_range((int64_t)e.force_evaluations, s.force_evaluations / 2, 2 * s.force_evaluations);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Without an end: for one second */
static void without_an_end(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_options opt = options("velocity-verlet", 0.008);
  opt.steps = -1;
  msim_sim *sim = make_sim(scene, &opt);
  assert_true(estimate_of(sim).steps == 125);
  assert_ok(msim_sim_step(sim, 1000, err));
  assert_true(estimate_of(sim).steps == 125);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The checkpoint of the sim keeps its bytes, and no warning comes from the clone. */
static void count_warning(const char *text, void *user) {
  (void)text;
  ++*(int *)user;
}

static void nothing_changes(void **state) {
  (void)state;
  static const char *const methods[] = {"verlet", "bdf2", "dop853", "auto", "implicit-euler"};
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    int warnings = 0;
    const char *text;
    size_t length[2];
    msim_scene *scene = hanging_cloth(5, 100, 0);
    msim_options opt = options(methods[i], 1e-3);
    opt.steps = -1, opt.t_end = 0.1, opt.warn = count_warning, opt.warn_user = &warnings;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 3, err));
    const int before = warnings;
    const size_t capacity = msim_sim_save_size(sim);
    char *bytes = malloc(2 * capacity);
    assert_ok(msim_sim_save(sim, bytes, capacity, &length[0], err));
    estimate_of(sim);
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_ok(msim_sim_save(sim, bytes + capacity, capacity, &length[1], err));
    assert_int_equal(length[0], length[1]);
    assert_memory_equal(bytes, bytes + capacity, length[0]);
    assert_int_equal(warnings, before);
    free(bytes);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A step that fails: the estimate returns its status, and explain says it. */
static void steps_that_fail(void **state) {
  (void)state;
  msim_error why;
  msim_estimate e = {.size = sizeof e};
  const char *text;
  msim_scene *scene = hanging_cloth(5, 1e6, 0);
  msim_options opt = options("implicit-euler", 0.1);
  opt.steps = 100, opt.newton_max_iterations = 1, opt.newton_retries = 0;
  msim_sim *sim = make_sim(scene, &opt);
  assert_true(msim_sim_estimate(sim, &e, &why) > 0);
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "advice        change the run, as it fails: step "));
  assert_non_null(strstr(text, "cost          not estimated, as the first steps fail\n"));
  assert_int_equal(stats_after(sim, 0).steps, 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void explain_prints_it(void **state) {
  (void)state;
  const char *text;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.steps = 100;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(
      text, "\ncost          100 steps, about 101 evaluations of the forces, by the first 4\n"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void invalid_calls(void **state) {
  (void)state;
  msim_error why;
  msim_estimate e = {.steps = -7};
  msim_scene *scene = hanging_cloth(3, 100, 0);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_estimate(NULL, &e, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_estimate(sim, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_estimate(sim, &e, &why), MSIM_ERR_SIZE);
  assert_string_equal(why.text, "estimate.size is 0; it must be sizeof(msim_estimate)");
  assert_true(e.steps == -7);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(explicit_counts_are_exact), cmocka_unit_test(implicit_counts),
      cmocka_unit_test(steps_under_error_control), cmocka_unit_test(without_an_end),
      cmocka_unit_test(nothing_changes),           cmocka_unit_test(steps_that_fail),
      cmocka_unit_test(explain_prints_it),         cmocka_unit_test(invalid_calls)};
  return cmocka_run_group_tests_name("estimate", tests, NULL, NULL);
}
