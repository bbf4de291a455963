/* Tests of solver = auto: when it keeps a lagged factorization and when it replaces pcg; and of the
 * cost of changing parameters of a running sim. */
#define _GNU_SOURCE /* setenv, strdup */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenes.h"

/* A cube that stands on its bottom face, which is pinned; a stiff one hardly deforms. */
static msim_scene *block(int32_t side, double k) { return pinned_block(side, 1, k, 0); }
static msim_scene *stiff_block(void) { return block(5, 1e8); }

static double difference(msim_sim *a, msim_sim *b) {
  const msim_state sa = state_of(a), sb = state_of(b);
  double worst = 0;
  for (int32_t i = 0; i < 3 * sa.n; i++) worst = fmax(worst, fabs(sa.x[i] - sb.x[i]));
  return worst;
}

static msim_options automatic(double h) {
  msim_options opt = options("linearly-implicit-euler", h);
  opt.solver_rtol = 1e-10;
  return opt;
}

static void a_factorization_is_reused_while_it_helps(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  msim_scene *scene = stiff_block();
  msim_options opt = automatic(1e-2);
  msim_sim *kept = make_sim(scene, &opt);
  opt.skip_off = MSIM_SKIP_KEPT_FACTOR;
  msim_sim *fresh = make_sim(scene, &opt);
  assert_ok(msim_sim_step(kept, 40, err));
  assert_ok(msim_sim_step(fresh, 40, err));
  const msim_stats s = stats_of(kept);
  assert_in_range(s.factorizations, 1, 4);
  assert_int_equal(s.kept_factors, 40 - s.factorizations);
  assert_in_range(s.iterations, s.kept_factors, 10 * s.kept_factors);
  assert_int_equal(stats_of(fresh).factorizations, 40);
  assert_int_equal(stats_of(fresh).kept_factors, 0);
  assert_close(difference(kept, fresh), 0, 1e-9);
  msim_sim_destroy(kept), msim_sim_destroy(fresh);
  msim_scene_destroy(scene);
}

/* Folding cloth: a lagged factorization does not help, and attempts to use it become rare. */
static void a_useless_lagged_factor_is_rarely_tried(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  msim_scene *scene = hanging_cloth(24, 1e8, 0);
  msim_options opt = automatic(1.0 / 60);
  opt.jacobian = MSIM_JACOBIAN_CLAMP;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 30, err)); /* until the cloth folds */
  const msim_stats before = stats_of(sim);
  assert_ok(msim_sim_step(sim, 200, err));
  const msim_stats after = stats_of(sim);
  assert_true(after.factorizations - before.factorizations >= 190);
  assert_true(after.iterations - before.iterations < 200);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static msim_sim *in_motion(msim_scene *scene, unsigned skip_off, int32_t threads, int64_t steps) {
  msim_options opt = automatic(1.0 / 60);
  msim_plan plan = {.size = sizeof plan};
  opt.skip_off = skip_off, opt.threads = threads;
  msim_sim *sim = make_sim(scene, &opt);
  msim_sim_plan(sim, &plan);
  assert_string_equal(plan.solver, "pcg"); /* otherwise nothing is tested */
  assert_ok(msim_sim_step(sim, steps, err));
  return sim;
}

/* On a cube that hardly deforms pcg costs more than a factorization, which auto then computes:
 * steps take few iterations, to the same tolerance, with the same bits for any number of
 * threads. */
static void pcg_is_replaced_by_a_factorization_that_costs_less(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  enum { STEPS = 60 };
  msim_scene *scene = block(9, 3000);
  msim_sim *kept = in_motion(scene, 0, 1, STEPS), *again = in_motion(scene, 0, 2, STEPS);
  msim_sim *fresh = in_motion(scene, MSIM_SKIP_KEPT_FACTOR, 1, STEPS);
  const msim_stats s = stats_of(kept), f = stats_of(fresh);
  assert_in_range(s.factorizations, 1, 3);
  assert_int_equal(s.analyses, 1);
  assert_int_equal(f.factorizations + f.analyses, 0);
  assert_true(s.iterations < f.iterations / 2);
  assert_close(difference(kept, fresh), 0, 1e-9);
  assert_true(difference(kept, again) == 0);
  assert_int_equal(stats_of(again).iterations, s.iterations);
  msim_sim_destroy(kept), msim_sim_destroy(again), msim_sim_destroy(fresh);
  msim_scene_destroy(scene);
}

/* The steps after msim_sim_set_state() depend on that state only. */
static void a_set_state_discards_the_factor(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  msim_scene *scene = stiff_block();
  msim_options opt = automatic(1e-2);
  msim_sim *a = make_sim(scene, &opt), *b = make_sim(scene, &opt);
  assert_ok(msim_sim_step(a, 7, err));
  msim_state s = state_of(a);
  assert_ok(msim_sim_set_state(b, &s, err));
  assert_ok(msim_sim_set_state(
      a,
      &(msim_state){
          .size = sizeof s, .step = s.step, .t = s.t, .n = s.n, .x = s.x, .v = s.v, .h = s.h},
      err));
  assert_ok(msim_sim_step(a, 20, err));
  assert_ok(msim_sim_step(b, 20, err));
  assert_memory_equal(state_of(a).x, state_of(b).x, 3 * (size_t)s.n * sizeof *s.x);
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene);
}

/* Costs are compared only where pcg could solve the systems, too. */
static void the_reason_for_cholmod_is_explained(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  msim_scene *scene = stiff_block();
  msim_options opt = automatic(1e-2);
  const char *const reasons[] = {
      [MSIM_INDEFINITE_CLAMP] = "cholmod (auto: a factorization of ",
      [MSIM_INDEFINITE_SOLVE] = "cholmod (auto: indefinite = solve requires a direct solver)"};
  for (opt.indefinite = MSIM_INDEFINITE_CLAMP; opt.indefinite <= MSIM_INDEFINITE_SOLVE;
       opt.indefinite++) {
    const char *text;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_non_null(strstr(text, reasons[opt.indefinite]));
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* Without cholmod auto uses pcg, and explains that cholmod is missing. */
static void without_cholmod(void **state) {
  (void)state;
  require(getenv("MSIM_PLUGIN_PATH") != NULL, "MSIM_PLUGIN_PATH");
  const char *text;
  char *folder = strdup(getenv("MSIM_PLUGIN_PATH"));
  msim_scene *scene = stiff_block();
  msim_options opt = automatic(1e-2);
  msim_sim *sim;
  msim_error why;
  unsetenv("MSIM_PLUGIN_PATH");
  const int is_linked = is_solver_available("cholmod");
  if (!is_linked) {
    sim = make_sim(scene, &opt);
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_non_null(strstr(text, "pcg (auto: "));
    assert_non_null(strstr(text, "; cholmod is not available)"));
    assert_non_null(strstr(text, "cholmod (if available) factors it"));
    assert_ok(msim_sim_step(sim, 20, err)); /* now it has searched for cholmod, in vain */
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_null(strstr(text, "cholmod (if available)"));
    msim_sim_destroy(sim);
    opt.indefinite = MSIM_INDEFINITE_SOLVE;
    assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_NAME);
    assert_non_null(
        strstr(why.text, "indefinite = solve requires cholmod, which is not available"));
  }
  setenv("MSIM_PLUGIN_PATH", folder, 1);
  free(folder);
  msim_scene_destroy(scene);
  if (is_linked) skip();
}

static void pcg_that_does_not_converge_is_replaced(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  msim_scene *scene = hanging_cloth(6, 100, 0);
  msim_options opt = automatic(2e-3);
  msim_sim *sim = make_sim(scene, &opt);
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(sim, &plan);
  assert_string_equal(plan.solver, "pcg"); /* otherwise nothing is tested */
  msim_sim_destroy(sim);
  opt.solver_max_iterations = 2;
  sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10, err));
  msim_sim_plan(sim, &plan);
  assert_string_equal(plan.solver, "cholmod");
  assert_int_equal(stats_of(sim).fallbacks, 1);
  assert_int_equal(stats_of(sim).analyses, 1);
  msim_sim_destroy(sim);
  opt.solver = "pcg"; /* a solver requested by name is never replaced */
  sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_step(sim, 10, NULL), MSIM_NOT_CONVERGED);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- changes --------------------------------------------------*/

/* A changed sim makes the same steps as a new one from the same state. */
static void expect_same_as_new(msim_sim *changed, const msim_scene *scene, const msim_options *opt,
                               int analyses) {
  msim_state s = state_of(changed);
  msim_sim *fresh = make_sim(scene, opt);
  assert_ok(msim_sim_set_state(fresh, &s, err));
  assert_ok(msim_sim_step(changed, 5, err));
  assert_ok(msim_sim_step(fresh, 5, err));
  assert_memory_equal(state_of(changed).x, state_of(fresh).x, 3 * (size_t)s.n * sizeof *s.x);
  assert_int_equal(stats_of(changed).analyses, analyses);
  msim_sim_destroy(fresh);
}

static void a_new_step_needs_no_analysis(void **state) {
  (void)state;
  static const char *const pairs[][2] = {{"linearly-implicit-euler", "cholmod"},
                                         {"linearly-implicit-euler", "pcg"},
                                         {"velocity-verlet", "auto"}};
  for (size_t p = 0; p < 3; p++) {
    const int direct = strcmp(pairs[p][1], "cholmod") == 0;
    if (direct && !is_solver_available("cholmod")) continue;
    msim_scene *scene = hanging_cloth(6, 100, 0.1);
    msim_options opt = options(pairs[p][0], 1e-3);
    opt.solver = pairs[p][1];
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_set_step(sim, opt.h = 2e-3, err));
    expect_same_as_new(sim, scene, &opt, direct);
    assert_close(state_of(sim).t, 0.005 + 5 * 2e-3, 1e-15);
    assert_int_equal(state_of(sim).step, 10);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void steps_that_are_left_are_made_with_the_new_step(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_options opt = options("verlet", 1e-3);
  opt.steps = 10;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 4, err));
  assert_ok(msim_sim_set_step(sim, 5e-4, err));
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_int_equal(state_of(sim).step, 10);
  assert_close(state_of(sim).t, 4e-3 + 6 * 5e-4, 1e-15);
  assert_int_equal(msim_sim_set_step(sim, 0, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_set_step(sim, NAN, NULL), MSIM_ERR_ARG);
  assert_close(state_of(sim).h, 5e-4, 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void other_springs_need_no_analysis(void **state) {
  (void)state;
  enum { SIDE = 5 };
  for (int direct = 0; direct < 2; direct++) {
    if (direct && !is_solver_available("cholmod")) continue;
    msim_scene *scene = hanging_cloth(SIDE, 100, 0), *other = hanging_cloth(SIDE, 250, 0.2);
    msim_scene_view view = {.size = sizeof view}, wanted = {.size = sizeof wanted};
    msim_options opt = options("linearly-implicit-euler", 1e-3);
    opt.solver = direct ? "cholmod" : "pcg";
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 5, err));
    msim_scene_get(other, &wanted);
    assert_ok(msim_sim_set_springs(sim, wanted.k, NULL, wanted.damping, err));
    expect_same_as_new(sim, other, &opt, direct);
    msim_scene_get(scene, &view); /* the scene behind the handle is unchanged */
    assert_true(view.k[0] == 100 && view.damping[0] == 0);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene), msim_scene_destroy(other);
  }
}

static void bad_springs_are_refused(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(2, 100, 0);
  msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  msim_error why;
  double k[6] = {1, 2, 3, -4, 5, 6};
  assert_int_equal(msim_sim_set_springs(sim, k, NULL, NULL, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "k[3] is -4; it must be a finite number >= 0");
  k[3] = INFINITY;
  assert_int_equal(msim_sim_set_springs(sim, NULL, NULL, k, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "damping[3] is inf; it must be a finite number >= 0");
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_factorization_is_reused_while_it_helps),
      cmocka_unit_test(pcg_is_replaced_by_a_factorization_that_costs_less),
      cmocka_unit_test(a_useless_lagged_factor_is_rarely_tried),
      cmocka_unit_test(a_set_state_discards_the_factor),
      cmocka_unit_test(the_reason_for_cholmod_is_explained),
      cmocka_unit_test(without_cholmod),
      cmocka_unit_test(pcg_that_does_not_converge_is_replaced),
      cmocka_unit_test(a_new_step_needs_no_analysis),
      cmocka_unit_test(steps_that_are_left_are_made_with_the_new_step),
      cmocka_unit_test(other_springs_need_no_analysis),
      cmocka_unit_test(bad_springs_are_refused)};
  return cmocka_run_group_tests_name("solver_choice", tests, NULL, NULL);
}
