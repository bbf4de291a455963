/* Tests of Newton's method on several ranks: all nonlinear implicit methods give the velocities of
 * one process to newton.rtol, and the same bits in each run; steps that fail are retried by all
 * ranks. */
#include "angle_scenes.h"
#include "laws.h"
#include "rank_implicit.h"

/* By all nonlinear methods */
static void check_newton(const char *name, const msim_scene *scene, double h, int32_t steps) {
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++)
    if (is_implicit(method) && strcmp(method, "linearly-implicit-euler") != 0)
      check_implicit(name, scene, options(method, h), steps, 1.25);
}

static void regular_and_shuffled_meshes(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(10, 800, 0), *jelly = pinned_block(6, 1, 3000, 0),
             *mesh = random_mesh(300, 2, 0.02);
  check_newton("cloth", cloth, 5e-3, 4);
  check_implicit("jelly", jelly, options("implicit-euler", 5e-3), 4, 1.25);
  check_implicit("jelly", jelly, options("tr-bdf2", 5e-3), 4, 1.25);
  check_newton("damped mesh", mesh, 2e-3, 3);
  msim_scene_destroy(cloth);
  msim_scene_destroy(jelly);
  msim_scene_destroy(mesh);
}

/* Long steps: line searches, matrices that are not positive definite, strong dampers, which take
 * the full matrix, and dominant ones, which limit rotations */
static void hard_steps(void **state) {
  (void)state;
  msim_scene *mesh = random_mesh(300, 3, 0), *rope = folded_rope(60),
             *strong = random_mesh(300, 4, 0.2), *dominant = random_mesh(300, 5, 1.25);
  check_newton("long steps", mesh, 0.02, 3);
  check_implicit("rope", rope, options("implicit-midpoint", 2e-3), 5, 1.25);
  check_implicit("strong dampers", strong, options("implicit-euler", 0.05), 1, 1.25);
  check_implicit("dominant dampers", dominant, options("implicit-euler", 0.01), 3, 1.25);
  plane(mesh, 0, 0, 1, 0.02, 0.5, 0.3);
  check_implicit("plane", mesh, options("newmark", 0.01), 4, 1.25);
  check_implicit("plane", mesh, options("bdf2", 0.01), 4, 1.25);
  msim_scene_destroy(mesh);
  msim_scene_destroy(rope);
  msim_scene_destroy(strong);
  msim_scene_destroy(dominant);
}

/* Ranks that differ most: one of them has the only damper, or the only force, which springs have
 * balanced after a few steps; and few unknowns, for which one process eliminates. */
static void unequal_ranks(void **state) {
  (void)state;
  const int32_t ij[2] = {3, 5};
  const double k = 10, rest = 0.1, damping = 5;
  double force[3 * 216] = {[3 * 215] = 500};
  msim_scene *rope = folded_rope(41), *jelly = pinned_block(6, 1, 5e5, 0),
             *small = random_mesh(60, 7, 2);
  assert_ok(msim_scene_add_springs(rope, 1, ij, &k, &rest, &damping, err));
  assert_ok(msim_scene_set_forces(jelly, force, err));
  check_implicit("one damper", rope, options("implicit-euler", 2e-3), 3, 1.25);
  check_implicit("one force", jelly, options("implicit-euler", 0.05), 5, 1.25);
  check_implicit("small mesh", small, options("implicit-midpoint", 0.01), 3, 100);
  msim_scene_destroy(rope);
  msim_scene_destroy(jelly);
  msim_scene_destroy(small);
}

static void laws_and_angles(void **state) {
  (void)state;
  msim_scene *laws = law_net(90, 600, 0, 0, 3), *damped = law_net(90, 600, 0, 0.1, 3),
             *cloth = bending_cloth(10, 400, 0, 0.001), *bent = bending_cloth(10, 400, 0.01, 0.001),
             *stiff = bent_scene((chain){9, 100, 5, 0, 0});
  check_implicit("laws", laws, options("implicit-euler", 0.01), 3, 1.25);
  check_implicit("laws", laws, options("trapezoidal", 1e-3), 3, 1.25);
  check_implicit("damped laws", damped, options("sdirk2", 1e-3), 3, 1.25);
  check_implicit("bending cloth", cloth, options("implicit-midpoint", 2e-3), 3, 1.25);
  check_implicit("chain", stiff, options("implicit-euler", 0.05), 4, 1.25);
  check_implicit("damped bending cloth", bent, options("tr-bdf2", 2e-3), 3, 1.25);
  msim_scene_destroy(laws);
  msim_scene_destroy(damped);
  msim_scene_destroy(cloth);
  msim_scene_destroy(bent);
  msim_scene_destroy(stiff);
}

/* Few iterations are too few for whole steps. All ranks retry alike. */
static void steps_are_retried_by_all_ranks(void **state) {
  (void)state;
  const char *methods[] = {"implicit-euler", "newmark", "bdf2"};
  msim_scene *mesh = random_mesh(300, 6, 0);
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    msim_options opt = options(methods[i], 0.02);
    opt.newton_max_iterations = 4;
    msim_sim *sim = make_sim(mesh, &opt);
    assert_ok(msim_sim_step(sim, 3, err));
    assert_true(stats_of(sim).rejected_steps > 0);
    msim_sim_destroy(sim);
    check_implicit("retries", mesh, opt, 3, 1.25);
  }
  msim_scene_destroy(mesh);
}

static void moving_pins(void **state) {
  (void)state;
  msim_scene *cloth = bending_cloth(10, 400, 0.01, 0.001);
  move_corners(cloth, 10);
  check_implicit("moving pins", cloth, options("implicit-midpoint", 2e-3), 5, 1.25);
  check_implicit("moving pins", cloth, options("bdf2", 1e-3), 4, 1.25);
  msim_scene_destroy(cloth);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(regular_and_shuffled_meshes),
      cmocka_unit_test(hard_steps),
      cmocka_unit_test(unequal_ranks),
      cmocka_unit_test(laws_and_angles),
      cmocka_unit_test(steps_are_retried_by_all_ranks),
      cmocka_unit_test(moving_pins),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
