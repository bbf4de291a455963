/* Tests of planes that constrain implicit steps, as they do in scenes with meshes: bodies that fall
 * gain no energy at long steps with default options, and planes act as they do beside colliders. */
#include <math.h>
#include <stdio.h>

#include "checkpoints.h"
#include "colliders.h"
#include "meshes.h"
#include "moving_colliders.h"
#include "scene_check.h"

enum { FRAMES = 120 };
static const double FRAME = 1.0 / 60;

/* A soft ball of radius 0.5 m, 1 m above a floor, or over the corner of three planes; i odd: thin
 * like a coin */
static msim_scene *falling_mesh(int i, double k, double damping) {
  double *x = malloc(180 * 4 * 4 * sizeof *x);
  const int32_t n = make_sphere(2, x);
  int32_t *faces = malloc(3 * (size_t)n * sizeof *faces);
  for (int32_t c = 0; c < 3 * n; c++) faces[c] = c;
  for (int32_t c = 2; i % 2 && c < 9 * n; c += 3) x[c] *= 0.3;
  msim_mesh mesh = make_mesh(3 * n, x, n, faces);
  mesh.scale = 0.5, mesh.translate[2] = 1.5, mesh.fill = i % 2 ? 0.1 : 0.25;
  mesh.k = k, mesh.damping = damping;
  msim_scene *scene = new_scene();
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  plane(scene, 0, 0, 1, 0, 0.5 * (i % 3), 0.3 * (i % 2));
  if (i >= 2) plane(scene, 1, 0, 1, -0.2, 0, 0.2), plane(scene, 0.2, -1, 0.5, -0.3, 0.5, 0);
  free(x), free(faces);
  return scene;
}

static msim_options frames_of(const char *method) {
  msim_options opt = options(method, FRAME);
  opt.solver_rtol = 1e-12, opt.newton_rtol = 1e-10;
  return opt;
}

static double lowest_height(const msim_scene *scene, msim_sim *sim) {
  const msim_scene_view view = view_of(scene);
  const msim_state s = state_of(sim);
  double lowest = INFINITY;
  for (int32_t i = 0; i < view.nplanes; i++)
    for (int32_t p = 0; p < s.n; p++) {
      const double *n = view.planes[i].normal, *x = s.x + 3 * p;
      lowest = fmin(lowest, n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - view.planes[i].offset);
    }
  return lowest;
}

/* The most energy after a step, less that at the start; infinite where a step fails */
static double energy_gained(const msim_scene *scene, const msim_options *opt) {
  msim_sim *sim = make_sim(scene, opt);
  const double start = energies_of(sim).total;
  double most = -INFINITY;
  for (int frame = 0; frame < FRAMES && most < INFINITY; frame++) {
    if (msim_sim_step(sim, 1, NULL)) most = INFINITY;
    else most = fmax(most, energies_of(sim).total - start);
    assert_true(lowest_height(scene, sim) >= -1e-11);
  }
  assert_true(stats_of(sim).contacts > 0);
  msim_sim_destroy(sim);
  return most;
}

static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler", "tr-bdf2",
                                      "bdf2"};

/* Without planes that constrain, stiff ones gain energy. */
static void meshes_gain_no_energy(void **state) {
  (void)state;
  static const double stiffness[] = {300, 3000, 30000};
  for (int i = 0; i < 12; i++) {
    msim_scene *scene = falling_mesh(i % 4, stiffness[i / 4], 0.05);
    const msim_options opt = frames_of(methods[(i + i / 4) % 4]);
    const double with = energy_gained(scene, &opt);
    if (!(with <= 1e-9)) fail_msg("scene %d: %s gains %g J", i, opt.integrator, with);
    assert_ok(msim_scene_set_planes_constrain(scene, 0, err));
    if (i >= 8) assert_true(energy_gained(scene, &opt) > 1);
    msim_scene_destroy(scene);
  }
}

/* A small sphere below the plane makes the scene one with colliders, and touches nothing. */
static void planes_act_as_beside_colliders(void **state) {
  (void)state;
  const msim_lattice block = {.size = sizeof block,
                              .n = {5, 4, 5},
                              .origin = {0, 0, 0.1},
                              .extent = {0.4, 0.3, 0.4},
                              .mass = 1,
                              .k = 3000};
  for (int i = 0; i < 4; i++) {
    msim_scene *scene = new_scene(), *beside = new_scene();
    for (int k = 0; k < 2; k++) {
      assert_ok(msim_scene_add_lattice(k ? beside : scene, &block, err));
      plane(k ? beside : scene, 0.2, 0, 1, 0, 0.4, 0.3);
    }
    add(beside, sphere(-0.3, -0.3, -0.5, 0.05, 0, 0), 0);
    assert_ok(msim_scene_set_planes_constrain(scene, 1, err));
    const msim_options opt = frames_of(methods[i]);
    msim_sim *a = make_sim(scene, &opt), *b = make_sim(beside, &opt);
    assert_ok(msim_sim_step(a, FRAMES, err));
    assert_ok(msim_sim_step(b, FRAMES, err));
    const msim_state s = state_of(a), t = state_of(b);
    for (int32_t c = 0; c < 3 * s.n; c++) assert_close(s.x[c], t.x[c], 1e-11);
    assert_true(stats_of(a).contacts > 0 && stats_of(a).contacts == stats_of(b).contacts);
    msim_sim_destroy(a), msim_sim_destroy(b);
    msim_scene_destroy(scene), msim_scene_destroy(beside);
  }
}

static void meshes_set_and_files_keep_the_value(void **state) {
  (void)state;
  const msim_options opt = frames_of("linearly-implicit-euler");
  msim_scene *scene = falling_mesh(3, 3000, 0.1), *read;
  assert_int_equal(view_of(scene).planes_constrain, 1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 50, err));
  assert_ok(msim_scene_save(scene, "planes.json", err)); /* arrays, and no mesh */
  assert_ok(msim_scene_load(NULL, "planes.json", &read, err));
  assert_int_equal(view_of(read).planes_constrain, 1);
  msim_sim *same = make_sim(read, &opt);
  assert_ok(msim_sim_step(same, 50, err));
  expect_same(sim, same, "from a file");
  msim_sim_destroy(same);
  msim_scene_destroy(read);
  remove("planes.json");
  assert_ok(msim_scene_set_drag(scene, 0.1, err)); /* changes a copy, as the sim uses the data */
  assert_int_equal(view_of(scene).planes_constrain, 1);
  msim_sim_destroy(sim);
  assert_int_equal(msim_scene_set_planes_constrain(NULL, 1, NULL), MSIM_ERR_ARG);
  assert_ok(msim_scene_set_planes_constrain(scene, -5, err));
  assert_int_equal(view_of(scene).planes_constrain, 1);
  assert_ok(msim_scene_set_planes_constrain(scene, 0, err));
  assert_int_equal(view_of(scene).planes_constrain, 0);
  msim_scene_destroy(scene);
}

static void they_are_explained(void **state) {
  (void)state;
  for (int i = 0; i < 3; i++) { /* they constrain, they do not, the method is explicit */
    const char *text;
    msim_scene *scene = falling_mesh(0, 3000, 0.1);
    if (i == 1) assert_ok(msim_scene_set_planes_constrain(scene, 0, err));
    msim_options opt = frames_of(i < 2 ? "implicit-euler" : "velocity-verlet");
    opt.steps = 5, opt.h = 1e-3;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_explain(sim, &text, err));
    const int holds = strstr(text, "the matrix holds particles in contact if h omega > 2") != NULL;
    const int advises = strstr(text, "use collision = event") != NULL;
    assert_int_equal(holds, i == 0);
    assert_int_equal(advises, i == 1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void a_file_may_say_otherwise(void **state) {
  (void)state;
  static const char text[] =
      "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0]], \"mass\": 1}, "
      "\"planes_constrain\": %s}";
  for (int i = 0; i < 2; i++) {
    char json[128];
    msim_scene *scene;
    const int length = snprintf(json, sizeof json, text, i ? "true" : "false");
    assert_ok(msim_scene_parse(NULL, "text", json, (size_t)length, &scene, err));
    assert_int_equal(view_of(scene).planes_constrain, i);
    msim_scene_destroy(scene);
  }
}

static void runs_are_resumable(void **state) {
  (void)state;
  static const int64_t at[] = {20, 33, 40};
  for (int i = 0; i < 4; i++) {
    msim_scene *scene = falling_mesh(i, 3000, 0.1);
    msim_options opt = frames_of(methods[i]);
    opt.threads = 1 + i % 2;
    assert_true(expect_resumable(scene, &opt, 50, 3, at, methods[i]).contacts > 0);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(meshes_gain_no_energy),
                                     cmocka_unit_test(planes_act_as_beside_colliders),
                                     cmocka_unit_test(meshes_set_and_files_keep_the_value),
                                     cmocka_unit_test(they_are_explained),
                                     cmocka_unit_test(a_file_may_say_otherwise),
                                     cmocka_unit_test(runs_are_resumable)};
  return cmocka_run_group_tests_name("meshes_on_planes", tests, NULL, NULL);
}
