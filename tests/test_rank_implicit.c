/* Tests of linearly implicit Euler on several ranks: the velocities of one process to the tolerance
 * of the solver, and the same bits in each run. */
#include "angle_scenes.h"
#include "laws.h"
#include "rank_implicit.h"

static void check_linear(const char *name, const msim_scene *scene, double h) {
  check_implicit(name, scene, options("linearly-implicit-euler", h), 4, 1.5);
}

static void regular_and_shuffled_meshes(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(24, 800, 0.01), *jelly = pinned_block(9, 1, 3000, 0),
             *mesh = random_mesh(400, 1, 0.02);
  check_linear("cloth", cloth, 5e-3);
  check_linear("jelly", jelly, 5e-3);
  check_linear("mesh", mesh, 2e-3);
  plane(cloth, 0, 0, 1, -1e-3, 0.5, 0.3);
  check_linear("cloth on a plane", cloth, 5e-3);
  msim_scene_destroy(cloth);
  msim_scene_destroy(jelly);
  msim_scene_destroy(mesh);
}

static void laws_and_angles(void **state) {
  (void)state;
  msim_scene *laws = law_net(90, 600, 0, 0.1, 3), *cloth = bending_cloth(16, 400, 0.01, 0.001);
  check_linear("laws", laws, 1e-3);
  check_linear("bending cloth", cloth, 5e-3);
  msim_scene_destroy(laws);
  msim_scene_destroy(cloth);
}

/* The modes of ranks make up for coarse spaces that end at their borders. */
static void coarse_spaces(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(48, 20000, 0.01), *jelly = pinned_block(12, 1, 1e5, 0);
  check_linear("stiff cloth", cloth, 5e-3);
  check_linear("stiff jelly", jelly, 5e-3);
  msim_scene_destroy(cloth);
  msim_scene_destroy(jelly);
}

/* A net in a plane that contains gravity, and a straight rope, oblique: two components move, and
 * affine motions of the rope's ranks depend on each other. */
static void dependent_modes(void **state) {
  (void)state;
  const double g[3] = {3, 0, -9};
  const msim_cloth net = {.size = sizeof net,
                          .rows = 40,
                          .columns = 40,
                          .row = {0.6, 0, 0.8},
                          .column = {0.8, 0, -0.6},
                          .mass = 0.3,
                          .k_structural = 20000,
                          .k_shear = 20000,
                          .npinned = 1,
                          .pinned = (int32_t[]){0}};
  const msim_rope rope = {.size = sizeof rope,
                          .n = 1200,
                          .to = {0.8, 0, -0.6},
                          .mass = 0.3,
                          .k = 1e5,
                          .npinned = 1,
                          .pinned = (int32_t[]){0}};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(i ? msim_scene_add_rope(scene, &rope, err) : msim_scene_add_cloth(scene, &net, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    check_implicit(i ? "oblique rope" : "planar net", scene, 5e-3);
    msim_scene_destroy(scene);
  }
}

/* Rest lengths 0: the matrix is scalar, and constant. */
static void scalar_matrices(void **state) {
  (void)state;
  msim_scene *like = hanging_cloth(16, 100, 0), *scene;
  msim_scene_view w = {.size = sizeof w};
  const double g[3] = {0.1, 0, -9.81};
  msim_scene_get(like, &w);
  double *rest = calloc((size_t)w.nsprings, sizeof *rest);
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, w.nparticles, w.x, w.v, w.mass, err));
  assert_ok(msim_scene_add_springs(scene, w.nsprings, w.ij, w.k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 2, (int32_t[]){0, 15}, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  check_linear("scalar matrix", scene, 5e-3);
  free(rest);
  msim_scene_destroy(like);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(regular_and_shuffled_meshes),
      cmocka_unit_test(laws_and_angles),
      cmocka_unit_test(coarse_spaces),
      cmocka_unit_test(dependent_modes),
      cmocka_unit_test(scalar_matrices),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
