/* Tests of checkpoints of bodies that rest on planes, for implicit methods with collision = event:
 * factorizations belong to a set of constrained unknowns. */
#include "checkpoints.h"

/* An elastic cube at that height above a plane of that slope, under gravity */
static msim_scene *jelly(double height, double slope, double restitution, double friction) {
  enum { SIDE = 6 };
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {SIDE, SIDE, SIDE},
                                .origin = {0, 0, height},
                                .extent = {1, 1, 1},
                                .mass = 1,
                                .k = 3000};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, (double[3]){0, 0, -9.81}, err));
  plane(scene, slope, 0, 1, 0, restitution, friction);
  return scene;
}

/* Returns the statistics of the whole run */
static msim_stats expect_resumable_rest(const msim_scene *scene, const char *method,
                                        const char *solver, int64_t steps) {
  static const int64_t at[] = {2, 5, 7, 9, 10, 11, 14, 19, 22};
  msim_options opt = options(method, 1.0 / 60);
  opt.collision = MSIM_COLLISION_EVENT;
  opt.solver = solver, opt.solver_rtol = 1e-10, opt.newton_rtol = 1e-6;
  int n = 0;
  while (n < 9 && at[n] < steps) n++;
  return expect_resumable(scene, &opt, steps, n, at, method);
}

/* Some particles rest while others slide or lift off: coarse factors are used for few steps. */
static void coarse_factors(void **state) {
  (void)state;
  static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler", "tr-bdf2"};
  msim_scene *scene = jelly(0.001, 0.05, 0, 0.04);
  for (int m = 0; m < 3; m++) {
    const msim_stats s = expect_resumable_rest(scene, methods[m], "pcg", m == 1 ? 12 : 24);
    assert_true(s.coarse_factors > 0); /* otherwise nothing is tested */
  }
  msim_scene_destroy(scene);
}

/* All particles of the bottom rest: few coarse factors are computed, and one factorization by
 * cholmod. */
static void lagged_factors(void **state) {
  (void)state;
  msim_scene *scene = jelly(0, 0, 0, 1);
  const char *const solver = is_solver_available("cholmod") ? "auto" : "pcg";
  const msim_stats s = expect_resumable_rest(scene, "linearly-implicit-euler", solver, 24);
  assert_true(s.kept_factors > 4 * s.coarse_factors); /* otherwise nothing is tested */
  assert_int_equal(s.factorizations, strcmp(solver, "auto") == 0);
  const msim_stats n = expect_resumable_rest(scene, "implicit-euler", "pcg", 12);
  assert_true(n.kept_factors > 4 * n.coarse_factors);
  msim_scene_destroy(scene);
}

/* Beside a cube at rest a ball on soft springs bounces, in the steps 9, 22 and later: the coarse
 * factor of the cube, made without it, serves all solves of these steps and those after them. */
static void bouncing_particles_keep_the_coarse_factor(void **state) {
  (void)state;
  enum { CORNER = 5 * 36 + 5 * 6, BALL = 216 };
  const double x[3] = {1.2, 1, 0.1}, mass = 0.01, k[2] = {1, 1}, rest[2] = {0.2, 0.4};
  const int32_t ij[4] = {CORNER, BALL, CORNER - 6, BALL};
  msim_scene *scene = jelly(0, 0, 0.8, 1);
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, rest, NULL, err));
  const msim_stats s = expect_resumable_rest(scene, "linearly-implicit-euler", "pcg", 24);
  assert_true(s.contacts > 0 && s.solves > 24 && s.coarse_factors < 3);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(coarse_factors),
                                     cmocka_unit_test(bouncing_particles_keep_the_coarse_factor),
                                     cmocka_unit_test(lagged_factors)};
  return cmocka_run_group_tests_name("checkpoint_resting_contact", tests, NULL, NULL);
}
