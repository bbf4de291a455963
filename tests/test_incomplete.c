/* Tests of the option incomplete = accept: steps whose iterations end at their limit are made,
 * counted and finite; all others are as without it; also after checkpoints. */
#include <math.h>
#include <stdio.h>

#include "checkpoints.h"

static int is_finite_state(msim_sim *sim) {
  const msim_state s = state_of(sim);
  for (int32_t i = 0; i < 3 * s.n; i++)
    if (!isfinite(s.x[i]) || !isfinite(s.v[i])) return 0;
  return 1;
}

static msim_scene *scene_of(int i) {
  msim_scene *scene = i % 4 == 0   ? hanging_cloth(6, 1000, 0)
                      : i % 4 == 1 ? hanging_cloth(5, 300, 0.5)
                      : i % 4 == 2 ? folded_rope(9)
                                   : pinned_block(3, 0.3, 5000, 0);
  if (i % 3 == 1) plane(scene, 0, 0.1, 1, -0.4, 0.5, 0.3);
  return scene;
}

/* Methods, solvers and limits at random */
static msim_options options_at_random(unsigned *seed) {
  static const char *const methods[] = {"linearly-implicit-euler",
                                        "implicit-euler",
                                        "implicit-midpoint",
                                        "trapezoidal",
                                        "newmark",
                                        "bdf2",
                                        "tr-bdf2",
                                        "sdirk2"};
  static const char *const solvers[] = {"pcg", "auto", "sundials-pcg", "sundials-spgmr"};
  const int nsolvers = is_solver_available("sundials-pcg") ? 4 : 2;
  msim_options opt = options(methods[(int)(uniform(seed) * 8)], 1e-3 * pow(30, uniform(seed)));
  opt.solver = solvers[(int)(uniform(seed) * nsolvers)];
  opt.solver_max_iterations = 1 + (int32_t)(uniform(seed) * uniform(seed) * 30);
  opt.newton_max_iterations = 1 + (int32_t)(uniform(seed) * uniform(seed) * 10);
  opt.collision = uniform(seed) < 0.3 ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT;
  opt.jacobian = uniform(seed) < 0.3 ? MSIM_JACOBIAN_CLAMP : MSIM_JACOBIAN_EXACT;
  opt.threads = 1 + (uniform(seed) < 0.5);
  return opt;
}

/* No limit ends a run: only motion that the energy monitor, or the check of numbers, refuses. */
static void random_limits(void **state) {
  (void)state;
  enum { RUNS = HAS_ADDRESS_SANITIZER ? 200 : 2000, STEPS = 4 };
  int64_t incomplete = 0;
  int kept = 0, ended = 0;
  unsigned seed = 3;
  for (int i = 0; i < RUNS; i++) {
    msim_scene *scene = scene_of(i);
    msim_options opt = options_at_random(&seed);
    msim_error why;
    opt.incomplete = MSIM_INCOMPLETE_ACCEPT;
    msim_sim *sim = make_sim(scene, &opt);
    const msim_status status = msim_sim_step(sim, STEPS, &why);
    const msim_stats s = stats_of(sim);
    if (status && status != MSIM_UNSTABLE && status != MSIM_NOT_FINITE)
      fail_msg("run %d, %s, %s: %s", i, opt.integrator, opt.solver, why.text);
    if (!is_finite_state(sim)) fail_msg("run %d, %s: not finite", i, opt.integrator);
    assert_true(s.incomplete_steps <= s.steps && s.fallbacks == 0);
    incomplete += s.incomplete_steps, ended += status != MSIM_OK;
    if (!status && s.incomplete_steps == 0) { /* then no bit depends on the option */
      opt.incomplete = MSIM_INCOMPLETE_STOP;
      msim_sim *other = make_sim(scene, &opt);
      assert_ok(msim_sim_step(other, STEPS, err));
      expect_same(sim, other, opt.integrator);
      msim_sim_destroy(other);
      kept++;
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  print_message("%lld incomplete steps, %d runs without, %d ended\n", (long long)incomplete, kept,
                ended);
  assert_true(incomplete > RUNS && kept > RUNS / 20 && ended < RUNS / 20);
}

/* Without the option such a run ends, and its counts are 0; with it each step costs its limit. */
static void the_limit_is_the_cost(void **state) {
  (void)state;
  enum { STEPS = 30, LIMIT = 3 };
  msim_scene *scene = hanging_cloth(12, 5000, 0);
  msim_options opt = options("linearly-implicit-euler", 0.01);
  opt.solver = "pcg", opt.solver_max_iterations = LIMIT;
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_step(sim, STEPS, NULL), MSIM_NOT_CONVERGED);
  assert_int_equal(stats_of(sim).incomplete_steps, 0);
  msim_sim_destroy(sim);
  opt.incomplete = MSIM_INCOMPLETE_ACCEPT;
  sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, STEPS, err));
  assert_true(stats_of(sim).incomplete_steps >= STEPS - 1); /* the first one is free fall */
  assert_in_range(stats_of(sim).iterations, (STEPS - 1) * LIMIT, STEPS * LIMIT);
  msim_sim_destroy(sim);
  opt = options("implicit-euler", 0.01);
  opt.solver = "pcg", opt.newton_max_iterations = 2, opt.incomplete = MSIM_INCOMPLETE_ACCEPT;
  sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, STEPS, err));
  const msim_stats s = stats_of(sim);
  assert_true(s.incomplete_steps > STEPS / 2 && s.rejected_steps == 0);
  assert_true(s.newton_iterations <= 2 * STEPS);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* More iterations come closer to the converged motion. */
static void more_iterations_are_closer(void **state) {
  (void)state;
  enum { SIDE = 8, STEPS = 10, CASES = 4 };
  static const int32_t limits[CASES] = {2, 5, 12, 2000};
  double x[CASES][3 * SIDE * SIDE], error[CASES] = {0};
  msim_scene *scene = hanging_cloth(SIDE, 5000, 0);
  for (int i = CASES - 1; i >= 0; i--) {
    msim_options opt = options("linearly-implicit-euler", 0.01);
    opt.solver = "pcg", opt.solver_max_iterations = limits[i];
    opt.incomplete = MSIM_INCOMPLETE_ACCEPT;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, STEPS, err));
    memcpy(x[i], state_of(sim).x, sizeof x[i]);
    for (int k = 0; k < 3 * SIDE * SIDE; k++)
      error[i] = fmax(error[i], fabs(x[i][k] - x[CASES - 1][k]));
    assert_int_equal(stats_of(sim).incomplete_steps == 0, i == CASES - 1);
    msim_sim_destroy(sim);
  }
  assert_true(error[0] > error[1] && error[1] > error[2] && error[0] < 0.1);
  msim_scene_destroy(scene);
}

/* Error control shortens such steps itself, and explicit methods have none. */
static void where_it_is_unused(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(5, 300, 0);
  msim_options opt = options("bdf2", 1e-3);
  opt.solver = "pcg", opt.tol = 1e-3, opt.t_end = 0.05, opt.newton_max_iterations = 3;
  for (int m = 0; m < 2; m++) {
    msim_sim *sims[2];
    for (int i = 0; i < 2; i++) {
      opt.incomplete = i;
      sims[i] = make_sim(scene, &opt);
      assert_ok(msim_sim_run(sims[i], NULL, NULL, err));
      assert_int_equal(stats_of(sims[i]).incomplete_steps, 0);
    }
    expect_same(sims[0], sims[1], opt.integrator);
    msim_sim_destroy(sims[0]), msim_sim_destroy(sims[1]);
    opt.integrator = "velocity-verlet", opt.tol = 0;
  }
  msim_scene_destroy(scene);
}

/* The count goes on after a checkpoint. The option is part of it, but for its default value. */
static void checkpoints_have_the_count(void **state) {
  (void)state;
  static const char *const methods[] = {"linearly-implicit-euler", "newmark", "bdf2"};
  static const int64_t at[] = {0, 3, 7};
  msim_scene *scene = hanging_cloth(6, 1000, 0);
  for (int m = 0; m < 3; m++) {
    msim_options opt = options(methods[m], 0.01);
    msim_error why;
    opt.solver = "pcg", opt.solver_max_iterations = 3, opt.newton_max_iterations = 2;
    opt.incomplete = MSIM_INCOMPLETE_ACCEPT;
    const msim_stats s = expect_resumable(scene, &opt, 10, 3, at, methods[m]);
    assert_true(s.incomplete_steps > 5);
    msim_sim *accepts = make_sim(scene, &opt);
    opt.incomplete = MSIM_INCOMPLETE_STOP;
    msim_sim *stops = make_sim(scene, &opt);
    const checkpoint a = save(accepts), b = save(stops);
    assert_int_equal(msim_sim_load(stops, a.bytes, a.length, &why), MSIM_ERR_ARG);
    assert_string_equal(why.text, "incomplete is stop here and accept in the checkpoint");
    assert_int_equal(msim_sim_load(accepts, b.bytes, b.length, &why), MSIM_ERR_ARG);
    assert_string_equal(why.text, "incomplete is accept here and stop in the checkpoint");
    free(a.bytes), free(b.bytes);
    msim_sim_destroy(accepts), msim_sim_destroy(stops);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(random_limits), cmocka_unit_test(the_limit_is_the_cost),
      cmocka_unit_test(more_iterations_are_closer), cmocka_unit_test(where_it_is_unused),
      cmocka_unit_test(checkpoints_have_the_count)};
  return cmocka_run_group_tests_name("incomplete", tests, NULL, NULL);
}
