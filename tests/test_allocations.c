/* Tests that no step with msim's own solvers or with SUNDIALS allocates: every method makes
 * steps while all allocations fail, those of malloc or, under sanitizers, those of the scene's
 * allocator. */
#include <string.h>

#include "failing_allocator.h"
#include "scenes.h"

enum { STEPS = 20 };

/* A cloth with a corner 1e-6 m above a plane that it falls on, if the method takes planes. More
 * than three contacts are sorted by qsort, for which glibc allocates. */
static msim_scene *falling_cloth(const char *method) {
  const msim_plane floor = {{0.3, 0.3, 1}, -1e-6, 0.5, 0.2};
  const double g[3] = {0, 0, -9.81};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 16,
                            .columns = 16,
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 1000,
                            .k_shear = 1000,
                            .damping = takes_positions_only(method) ? 0 : 1e-4};
  msim_scene *scene;
  assert_ok(msim_scene_create(failing_allocator_get(), &scene, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  if (!refuses_planes(method)) assert_ok(msim_scene_add_plane(scene, &floor, err));
  return scene;
}

/* Make steps while every allocation of this thread fails; returns 1 if there was one. */
static int steps_allocate(msim_sim *sim, int32_t steps, msim_status *status) {
  failing_allocator_count(FAILING_MALLOC ? FAILING_BY_MALLOC : FAILING_BY_ALLOCATOR);
  failing_allocator_arm(0, 1);
  *status = msim_sim_step(sim, steps, NULL);
  const int failed = failing_allocator_has_failed();
  failing_allocator_arm(-1, 0);
  failing_allocator_count(FAILING_NONE);
  return failed;
}

static int check_method(const char *method, const char *solver, double tol, int32_t collision) {
  msim_scene *scene = falling_cloth(method);
  msim_options opt = options(method, 1e-4);
  opt.solver = solver, opt.threads = 1, opt.collision = collision;
  if (tol > 0) opt.tol = tol, opt.t_end = 1;
  else opt.steps = STEPS;
  msim_sim *sim = NULL;
  msim_status status = msim_sim_create(scene, &opt, &sim, NULL);
  const int made = status == MSIM_OK;
  if (!made) assert_int_equal(status, MSIM_ERR_ARG); /* no tol, or no located impacts */
  if (made && steps_allocate(sim, STEPS, &status))
    fail_msg("%s, solver %s, tol %g: a step allocates", method, solver, tol);
  assert_int_equal(status, made ? MSIM_OK : MSIM_ERR_ARG);
  if (made && !refuses_planes(method)) assert_true(stats_of(sim).contacts > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return made;
}

static void check_all_methods(const char *solver) {
  int made = 0;
  for (int32_t i = 0; method_at(i); i++) {
    made += check_method(method_at(i), solver, 0, MSIM_COLLISION_REFLECT);
    made += check_method(method_at(i), solver, 0, MSIM_COLLISION_EVENT);
    made += check_method(method_at(i), solver, 1e-4, MSIM_COLLISION_EVENT);
  }
  print_message("  solver %s: %d sims\n", solver, made);
  assert_true(made > 50);
}

static void no_step_by_pcg_allocates(void **state) {
  (void)state;
  check_all_methods("pcg");
}

static void no_step_by_sundials_allocates(void **state) {
  (void)state;
  static const char *const solvers[] = {"sundials-pcg", "sundials-spgmr", "sundials-spfgmr",
                                        "sundials-spbcgs", "sundials-sptfqmr"};
  int tried = 0;
  for (size_t i = 0; i < sizeof solvers / sizeof *solvers; i++) {
    if (!is_solver_available(solvers[i])) continue;
    check_all_methods(solvers[i]);
    tried++;
  }
  require(tried > 0, "SUNDIALS");
}

/* Checks the check: an allocation within a library is detected. */
static void steps_by_cholmod_are_seen_to_allocate(void **state) {
  (void)state;
  if (!FAILING_MALLOC) skip();
  require(is_solver_available("cholmod"), "the solver cholmod");
  msim_scene *scene = falling_cloth("linearly-implicit-euler");
  msim_options opt = options("linearly-implicit-euler", 1e-3);
  opt.solver = "cholmod", opt.threads = 1;
  msim_sim *sim = make_sim(scene, &opt);
  msim_status status;
  assert_true(steps_allocate(sim, 1, &status));
  assert_int_equal(status, MSIM_ERR_MEMORY);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A step that fails leaves the state after the last complete one, and the sim goes on from there to
 * the same bits. */
static void a_step_without_memory_can_be_repeated(void **state) {
  (void)state;
  if (!FAILING_MALLOC) skip();
  require(is_solver_available("cholmod"), "the solver cholmod");
  msim_scene *scene = falling_cloth("linearly-implicit-euler");
  msim_options opt = options("linearly-implicit-euler", 1e-3);
  opt.solver = "cholmod", opt.threads = 1;
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  msim_status status;
  assert_ok(msim_sim_step(other, 3, err));
  assert_ok(msim_sim_step(sim, 3, err));
  assert_true(steps_allocate(sim, 2, &status));
  assert_int_equal(status, MSIM_ERR_MEMORY);
  for (int i = 0; i < 2; i++) {
    const msim_state s = state_of(sim), t = state_of(other);
    assert_true(s.step == t.step && s.t == t.t);
    expect_same_motion(sim, other);
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(other, 5, err));
  }
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(no_step_by_pcg_allocates),
                                     cmocka_unit_test(no_step_by_sundials_allocates),
                                     cmocka_unit_test(steps_by_cholmod_are_seen_to_allocate),
                                     cmocka_unit_test(a_step_without_memory_can_be_repeated)};
  return cmocka_run_group_tests_name("allocations", tests, NULL, NULL);
}
