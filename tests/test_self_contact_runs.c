/* Tests of self-contact in motion: folded cloth, cloths that cross, ropes, solids and random scenes
 * at high speed have no intersecting triangles after any step, by a test of its own; momentum,
 * energy and friction. */
#include "surfaces.h"

/*------------------------------------- folds ----------------------------------------------------*/

static msim_scene *cloth_over_sphere(int32_t side, double k) {
  const double up = 1;
  msim_scene *scene = surfaces(9.81, 0.3);
  add_sheet(scene, side, k, 1, 0, 0, 0, NULL);
  add_sphere(scene, 0.05, 0.03, -0.22, 0.2);
  plane(scene, 0, 0, up, -0.6, 0, 0.5);
  assert_ok(msim_scene_set_self_contact(scene, side > 40 ? 0.005 : THICKNESS, 0.3, err));
  return scene;
}

/* The energy does not grow, except by what lifts layers that are closer than the thickness. */
static void fold(const char *method, int32_t side, double k, double h, double t_end) {
  msim_scene *scene = cloth_over_sphere(side, k);
  const msim_options opt = options(method, h);
  msim_sim *sim = make_sim(scene, &opt);
  const double before = total_energy(sim), weight = 0.3 * 9.81;
  const double most = run_without_intersections(sim, scene, (int64_t)(t_end / h + 0.5), 0, NULL);
  assert_true(most <= before + weight * THICKNESS);
  assert_true(total_energy(sim) < before - 0.4); /* it fell and folded */
  assert_true(stats_of(sim).contacts > 200);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void cloth_folds_over_a_sphere(void **state) {
  (void)state;
  fold("velocity-verlet", 24, 100, 1e-3, 1);
  fold("linearly-implicit-euler", 24, 100, 1 / 120., 2);
  fold("implicit-euler", 20, 1000, 1 / 60., 1.5);
}

/* A stiff cloth in long steps: no step adds energy, as pushing single particles out of each other
 * would, beyond 1e-4 of the energy of motion. */
static void no_step_adds_energy(void **state) {
  (void)state;
  msim_scene *scene = cloth_over_sphere(24, 3000);
  const msim_options opt = options("implicit-euler", 1 / 60.);
  msim_sim *sim = make_sim(scene, &opt);
  double before = total_energy(sim);
  for (int i = 0; i < 60; i++) {
    msim_energy e = {.size = sizeof e};
    assert_ok(msim_sim_step(sim, 1, err));
    msim_sim_energy(sim, &e);
    assert_true(total_energy(sim) <= before + 1e-4 * (e.kinetic + e.elastic) + 1e-9);
    before = total_energy(sim);
  }
  assert_true(before < -0.5);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Planes hold stiff cloths and reflect no single particles of them, which would stretch springs. */
static void cloth_collapses_on_a_floor(void **state) {
  (void)state;
  static const char *const methods[] = {"implicit-euler", "linearly-implicit-euler", "bdf2"};
  for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
    msim_scene *scene = surfaces(9.81, 0.3);
    add_cloth(scene, 12, 4000, (const double[3]){0, 0, 0.05}, (const double[3]){0.2, 1, 0},
              (const double[3]){0.2, 0, 1}, NULL);
    plane(scene, 0, 0, 1, 0, 0, 0.3);
    const msim_options opt = options(methods[m], 1 / 60.);
    msim_sim *sim = make_sim(scene, &opt);
    const double before = total_energy(sim);
    const double most = run_without_intersections(sim, scene, 60, 0, NULL);
    assert_true(most <= before * (1 + 1e-4));
    assert_true(total_energy(sim) < 0.9 * before && stats_of(sim).contacts > 0);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void large_cloth_folds_over_a_sphere(void **state) {
  (void)state;
  if (HAS_ADDRESS_SANITIZER) skip();
  fold("linearly-implicit-euler", 64, 100, 1 / 60., 3);
}

/*------------------------------------- impacts --------------------------------------------------*/

static void momentum(msim_sim *sim, const msim_scene *scene, double p[3]) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  const msim_state s = state_of(sim);
  p[0] = p[1] = p[2] = 0;
  for (int32_t i = 0; i < 3 * s.n; i++) p[i % 3] += view.mass[i / 3] * s.v[i];
}

/* Of three cloths that cross at right angles in the air; momentum is conserved. */
static void cross_in_the_air(const char *method, double h, double speed) {
  msim_scene *scene = surfaces(0, 0.2);
  const double down[3] = {0, 0, -speed}, left[3] = {-speed, 0, 0};
  add_sheet(scene, 10, 100, 0.8, 0, 0, 0, NULL);
  add_sheet(scene, 11, 100, 0.7, 0.05, 0.03, 0.11, down);
  add_cloth(scene, 9, 100, (const double[3]){0.6, -0.3, -0.32}, (const double[3]){0, 0.6, 0},
            (const double[3]){0, 0, 0.6}, left);
  const msim_options opt = options(method, h);
  msim_sim *sim = make_sim(scene, &opt);
  const double before = total_energy(sim);
  double p0[3], p1[3];
  momentum(sim, scene, p0);
  const double most = run_without_intersections(sim, scene, (int64_t)(0.6 / h), 0, NULL);
  momentum(sim, scene, p1);
  for (int c = 0; c < 3; c++) assert_close(p1[c], p0[c], 1e-4 * 0.3 * speed);
  assert_true(most <= before * (1 + 1e-3));
  assert_true(stats_of(sim).contacts > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void cloths_cross(void **state) {
  (void)state;
  cross_in_the_air("velocity-verlet", 1e-3, 2);
  cross_in_the_air("verlet", 1e-3, 2);
  cross_in_the_air("rk4", 1e-3, 2);
}

/* A fast sheet, which passes many thicknesses in a step, is stopped by one that is pinned. */
static void fast_sheets_are_stopped(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "explicit-euler",
                                        "linearly-implicit-euler", "trapezoidal"};
  for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
    msim_scene *scene = surfaces(0, 0.3);
    const double down[3] = {0.3, 0.1, -40};
    int32_t pinned[36];
    add_sheet(scene, 6, 100, 1, 0, 0, 0, NULL);
    for (int32_t i = 0; i < 36; i++) pinned[i] = i;
    assert_ok(msim_scene_pin(scene, 36, pinned, err));
    add_sheet(scene, 5, 100, 0.5, 0.02, 0.01, 0.5, down);
    const msim_options opt = options(methods[m], 2e-3);
    msim_sim *sim = make_sim(scene, &opt);
    run_without_intersections(sim, scene, 100, 0, NULL);
    const msim_state s = state_of(sim);
    for (int32_t i = 36; i < s.n; i++) assert_true(s.x[3 * i + 2] > 0);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Pairs that were far from each other while all was at rest are found in the first fast step. */
static void sudden_accelerations_are_stopped(void **state) {
  (void)state;
  const double gravity[3] = {0, 0, -1e7};
  int32_t pinned[36];
  msim_scene *scene = surfaces(0, 0.3);
  add_sheet(scene, 6, 100, 1, 0, 0, 0, NULL);
  for (int32_t i = 0; i < 36; i++) pinned[i] = i;
  assert_ok(msim_scene_pin(scene, 36, pinned, err));
  add_sheet(scene, 5, 100, 0.5, 0.02, 0.01, 0.5, NULL);
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.watch = MSIM_WATCH_OFF;
  msim_sim *sim = make_sim(scene, &opt);
  run_without_intersections(sim, scene, 2, 0, NULL);
  assert_ok(msim_sim_set_gravity(sim, gravity, err));
  run_without_intersections(sim, scene, 1, 0, NULL); /* of 5 m */
  const msim_state s = state_of(sim);
  for (int32_t i = 36; i < s.n; i++) assert_true(s.x[3 * i + 2] > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- ropes and solids -----------------------------------------*/

static void add_rope(msim_scene *scene, const double from[3], const double to[3], double mass) {
  msim_rope rope = {.size = sizeof rope, .n = 9, .mass = mass, .k = 200, .damping = 0.02};
  memcpy(rope.from, from, sizeof rope.from);
  memcpy(rope.to, to, sizeof rope.to);
  assert_ok(msim_scene_add_rope(scene, &rope, err));
}

/* A rope that falls on end, and one that lies across, do not pass through a cloth that hangs
 * between its corners. */
static void ropes_stay_above(void **state) {
  (void)state;
  enum { SIDE = 9, N = SIDE * SIDE };
  const int32_t corners[4] = {0, SIDE - 1, N - SIDE, N - 1};
  int32_t segments[2 * 16];
  msim_scene *scene = surfaces(9.81, 0.3);
  add_sheet(scene, SIDE, 400, 1, 0, 0, 0, NULL);
  assert_ok(msim_scene_pin(scene, 4, corners, err));
  add_rope(scene, (const double[3]){0.03, 0.02, 0.05}, (const double[3]){0.04, 0.01, 0.45}, 0.05);
  add_rope(scene, (const double[3]){-0.4, 0.1, 0.1}, (const double[3]){-0.1, -0.4, 0.15}, 0.05);
  for (int32_t i = 0; i < 16; i++) {
    segments[2 * i] = N + i + i / 8;
    segments[2 * i + 1] = segments[2 * i] + 1;
  }
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  run_without_intersections(sim, scene, 1000, 16, segments);
  assert_true(stats_of(sim).contacts > 100);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* An octahedron with an inner lattice falls on a cloth. */
static void solid_falls_on_cloth(void **state) {
  (void)state;
  const double vertices[18] = {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1};
  const int32_t faces[24] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                             2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
  enum { SIDE = 10, N = SIDE * SIDE };
  const int32_t corners[4] = {0, SIDE - 1, N - SIDE, N - 1};
  const msim_mesh mesh = {.size = sizeof mesh,
                          .nvertices = 6,
                          .nfaces = 8,
                          .vertices = vertices,
                          .faces = faces,
                          .scale = 0.2,
                          .translate = {0.02, 0.01, 0.3},
                          .mass = 0.2,
                          .k = 300,
                          .damping = 0.02,
                          .fill = MSIM_FILL_AUTO};
  msim_scene *scene = surfaces(9.81, 0.3);
  add_sheet(scene, SIDE, 400, 1, 0, 0, 0, NULL);
  assert_ok(msim_scene_pin(scene, 4, corners, err));
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const double before = total_energy(sim);
  const double most = run_without_intersections(sim, scene, 1000, 0, NULL);
  assert_true(most <= before + 1e-3 * fabs(before) + 0.5 * 9.81 * THICKNESS);
  const msim_state s = state_of(sim);
  double z = 0;
  for (int32_t i = N; i < s.n; i++) z += s.x[3 * i + 2] / (s.n - N);
  assert_true(z > -0.6); /* it lies in the cloth */
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- friction -------------------------------------------------*/

/* The mean speed after 0.4 s on a pinned slope of tan 0.5 */
static double slide(double friction, const char *method, double h) {
  enum { SIDE = 6, N = SIDE * SIDE };
  int32_t pinned[N];
  const double c = 2 / sqrt(5), s = 1 / sqrt(5), above = 1.2 * THICKNESS;
  msim_scene *scene = surfaces(9.81, friction);
  add_cloth(scene, SIDE, 400, (const double[3]){-2 * c, -0.5, -2 * s}, (const double[3]){0, 1, 0},
            (const double[3]){4 * c, 0, 4 * s}, NULL);
  for (int32_t i = 0; i < N; i++) pinned[i] = i;
  assert_ok(msim_scene_pin(scene, N, pinned, err));
  add_cloth(scene, 5, 400, (const double[3]){-0.13 * c - above * s, -0.11, -0.13 * s + above * c},
            (const double[3]){0, 0.2, 0}, (const double[3]){0.2 * c, 0, 0.2 * s}, NULL);
  const msim_options opt = options(method, h);
  msim_sim *sim = make_sim(scene, &opt);
  run_without_intersections(sim, scene, (int64_t)(0.4 / h + 0.5), 0, NULL);
  const msim_state now = state_of(sim);
  double v = 0;
  for (int32_t i = N; i < now.n; i++) v -= (now.v[3 * i] * c + now.v[3 * i + 2] * s) / 25;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return v;
}

/* Coulomb's law: it sticks where friction exceeds the slope, and else accelerates by g (sin - mu
 * cos). */
static void friction_follows_coulomb(void **state) {
  (void)state;
  const double c = 2 / sqrt(5), s = 1 / sqrt(5);
  assert_close(slide(0, "velocity-verlet", 1e-3), 9.81 * s * 0.4, 0.05);
  assert_close(slide(0.3, "velocity-verlet", 1e-3), 9.81 * (s - 0.3 * c) * 0.4, 0.1);
  assert_close(slide(0.7, "velocity-verlet", 1e-3), 0, 0.02);
  assert_close(slide(0.7, "linearly-implicit-euler", 4e-3), 0, 0.02);
}

/*------------------------------------- random scenes --------------------------------------------*/

/* Cloths in layers with random sizes, tilts and velocities */
static msim_scene *random_scene(unsigned *seed) {
  msim_scene *scene = surfaces(uniform(seed) < 0.5 ? 9.81 : 0, uniform(seed));
  const int n = 2 + (int)(2 * uniform(seed));
  for (int i = 0; i < n; i++) {
    const double size = 0.2 + 0.5 * uniform(seed), tilt = 0.15 * (uniform(seed) - 0.5);
    const double v[3] = {10 * (uniform(seed) - 0.5), 10 * (uniform(seed) - 0.5),
                         30 * (uniform(seed) - 0.5)};
    const double origin[3] = {0.2 * uniform(seed) - size / 2, 0.2 * uniform(seed) - size / 2,
                              0.25 * i};
    add_cloth(scene, 4 + (int)(5 * uniform(seed)), 50 + 300 * uniform(seed), origin,
              (const double[3]){0, size, tilt * size}, (const double[3]){size, 0, tilt * size}, v);
  }
  if (uniform(seed) < 0.5) plane(scene, 0, 0, 1, -0.3, uniform(seed), uniform(seed));
  if (uniform(seed) < 0.3) add_sphere(scene, 0, 0, -0.35, 0.2);
  return scene;
}

/* Make n steps, in which particles that stay where they are are at rest; returns their number. */
static int64_t expect_rest_where_stopped(msim_sim *sim, int64_t n) {
  const size_t bytes = 3 * (size_t)state_of(sim).n * sizeof(double);
  double *x = malloc(bytes);
  int64_t stopped = 0;
  for (int64_t i = 0; i < n; i++) {
    memcpy(x, state_of(sim).x, bytes);
    assert_ok(msim_sim_step(sim, 1, err));
    const msim_state s = state_of(sim);
    for (int32_t p = 0; p < s.n; p++) {
      const double *v = s.v + 3 * p;
      if (memcmp(x + 3 * p, s.x + 3 * p, 3 * sizeof *x) != 0) continue;
      assert_true(v[0] == 0 && v[1] == 0 && v[2] == 0);
      stopped++;
    }
  }
  free(x);
  return stopped;
}

static void particles_stop_where_pushes_do_not_help(void **state) {
  (void)state;
  unsigned seed = 11;
  int64_t stopped = 0;
  for (int i = 0; i < 5; i++) {
    msim_scene *scene = random_scene(&seed);
    const msim_options opt = options("velocity-verlet", 4e-3);
    msim_sim *sim = make_sim(scene, &opt);
    stopped += expect_rest_where_stopped(sim, 50);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  assert_true(stopped > 0);
}

static void random_scenes_at_high_speed(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler",
                                        "implicit-euler", "trapezoidal"};
  unsigned seed = 42;
  int64_t contacts = 0;
  for (int i = 0; i < 100; i++) {
    const double h = i % 4 == 0 ? 1e-3 : 4e-3;
    msim_scene *scene = random_scene(&seed);
    const msim_options opt = options(methods[i % 4], h);
    msim_sim *sim = make_sim(scene, &opt);
    run_without_intersections(sim, scene, (int64_t)(0.12 / h), 0, NULL);
    contacts += stats_of(sim).contacts;
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  assert_true(contacts > 10000);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(cloth_folds_over_a_sphere),
                                     cmocka_unit_test(large_cloth_folds_over_a_sphere),
                                     cmocka_unit_test(no_step_adds_energy),
                                     cmocka_unit_test(cloth_collapses_on_a_floor),
                                     cmocka_unit_test(cloths_cross),
                                     cmocka_unit_test(fast_sheets_are_stopped),
                                     cmocka_unit_test(sudden_accelerations_are_stopped),
                                     cmocka_unit_test(ropes_stay_above),
                                     cmocka_unit_test(solid_falls_on_cloth),
                                     cmocka_unit_test(friction_follows_coulomb),
                                     cmocka_unit_test(random_scenes_at_high_speed),
                                     cmocka_unit_test(particles_stop_where_pushes_do_not_help)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
