/* Tests of runs of one scene on several ranks: explicit methods give the bits of one process on
 * regular, shuffled, planar and separate meshes, at planes and colliders. */
#include "rank_runs.h"
#include "sim/sim.h"

static void regular_meshes(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(17, 800, 0), *damped = hanging_cloth(16, 800, 0.01),
             *jelly = pinned_block(7, 1, 300, 0), *rope = folded_rope(41);
  check_methods("cloth", cloth, 1e-4, 15, 1, 0);
  check_methods("damped cloth", damped, 1e-4, 15, 0, 0);
  check_methods("jelly", jelly, 5e-4, 15, 1, 0);
  check_methods("rope", rope, 1e-4, 15, 1, 0);
  msim_scene_destroy(cloth);
  msim_scene_destroy(damped);
  msim_scene_destroy(jelly);
  msim_scene_destroy(rope);
}

static void shuffled_meshes(void **state) {
  (void)state;
  msim_scene *undamped = random_mesh(400, 1, 0), *damped = random_mesh(401, 2, 0.02);
  check_methods("undamped mesh", undamped, 1e-4, 12, 1, 0);
  check_methods("damped mesh", damped, 1e-4, 12, 0, 0);
  msim_scene_destroy(undamped);
  msim_scene_destroy(damped);
}

static void more_ranks_than_particles(void **state) {
  (void)state;
  msim_scene *scene = folded_rope(4);
  check_run("short rope", scene, options("velocity-verlet", 1e-3), 50, MOST_RANKS);
  msim_scene_destroy(scene);
}

/* Blocks that are not connected are one system for ranks, for which rkc chooses its stages. */
static void several_islands(void **state) {
  (void)state;
  const double g[3] = {0, 0, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 3; i++) {
    const msim_lattice lattice = {.size = sizeof lattice,
                                  .n = {9, 9, 9},
                                  .origin = {2. * i, 0, 0},
                                  .extent = {1, 1, 1},
                                  .mass = 1,
                                  .k = 100 * (i + 1)};
    assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  }
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, -0.001, 0.5, 0.3);
  check_run("islands", scene, options("velocity-verlet", 5e-4), 100, 4);
  msim_options one_system = options("rkc", 5e-4);
  one_system.skip_off = MSIM_SKIP_ISLANDS;
  check_run("islands", scene, one_system, 30, 4);
  msim_scene_destroy(scene);
}

static const char *check_bounds(msim_comm *comm, void *data) {
  const msim_sim *alone = data;
  const msim_scene scene = {.data = alone->scene};
  msim_options opt = options("rkc", 1e-4);
  msim_sim *sim;
  opt.comm = comm;
  if (msim_sim_create(&scene, &opt, &sim, NULL)) return "no sim";
  const ms_bounds *a = &alone->islands->stepper.bounds, *b = &sim->islands->stepper.bounds;
  const int same =
      a->omega == b->omega && a->rate == b->rate && a->least_rate == b->least_rate && a->omega > 0;
  msim_sim_destroy(sim);
  return same ? NULL : "other bounds";
}

/* From them rkc has the number of its stages. */
static void bounds_of_frequencies(void **state) {
  (void)state;
  msim_scene *scene = random_mesh(300, 11, 0.02);
  assert_ok(msim_scene_set_drag(scene, 1e-4, err));
  const msim_options opt = options("rkc", 1e-4);
  msim_sim *alone = make_sim(scene, &opt);
  assert_int_equal(alone->nislands, 1);
  for (int32_t n = 2; n <= MOST_RANKS; n++) {
    const char *wrong = run_ranks(n, check_bounds, alone);
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
  msim_sim_destroy(alone);
  msim_scene_destroy(scene);
}

/* Planar scenes are computed in two components, by ranks as well. */
static void planar_scenes(void **state) {
  (void)state;
  const int32_t corners[2] = {0, 19};
  const double g[3] = {1, 0, 0};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 20,
                            .columns = 20,
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 100,
                            .k_shear = 50,
                            .k_bend = 10,
                            .npinned = 2,
                            .pinned = corners};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  check_run("planar cloth", scene, options("rk4", 1e-3), 50, 4);
  msim_scene_destroy(scene);
}

/* A drop on planes and colliders at rest and in motion, with drag and constant forces */
static msim_scene *obstacle_course(double drag) {
  msim_scene *scene = random_mesh(300, 5, 0);
  double force[3 * 300];
  for (int i = 0; i < 900; i++) force[i] = 1e-3 * (i % 7 - 3);
  plane(scene, 0, 0, 1, 0.05, 0.5, 0.4);
  plane(scene, 0.6, 0, 0.8, -0.1, 0.2, 0);
  const msim_collider ball = {.size = sizeof ball,
                              .type = MSIM_COLLIDER_SPHERE,
                              .center = {0.5, 0.5, -0.15},
                              .radius = 0.4,
                              .restitution = 0.3,
                              .friction = 0.2};
  assert_ok(msim_scene_add_collider(scene, &ball, err));
  assert_ok(msim_scene_set_forces(scene, force, err));
  if (drag > 0) assert_ok(msim_scene_set_drag(scene, drag, err));
  return scene;
}

static void planes_colliders_drag_and_forces(void **state) {
  (void)state;
  msim_scene *still = obstacle_course(0), *drag = obstacle_course(1e-4);
  check_methods("obstacles", still, 1e-4, 30, 1, 1);
  check_methods("obstacles and drag", drag, 1e-4, 30, 0, 1);
  msim_scene_destroy(still);
  msim_scene_destroy(drag);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(regular_meshes),
      cmocka_unit_test(shuffled_meshes),
      cmocka_unit_test(more_ranks_than_particles),
      cmocka_unit_test(several_islands),
      cmocka_unit_test(bounds_of_frequencies),
      cmocka_unit_test(planar_scenes),
      cmocka_unit_test(planes_colliders_drag_and_forces),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
