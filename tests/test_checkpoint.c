/* Tests of msim_sim_save and msim_sim_load: an interrupted run ends with the same bits and the same
 * counts, for every method and solver. */
#include <math.h>
#include <stdio.h>

#include "checkpoints.h"

/*------------------------------------- scenes ---------------------------------------------------*/

static msim_scene *cloth(void) { return hanging_cloth(6, 300, 0); }
static msim_scene *damped(void) { return hanging_cloth(5, 300, 0.05); }

static msim_scene *flat(void) {
  const double sideways[3] = {9.81, 0, 0};
  msim_scene *scene = hanging_cloth(6, 300, 0);
  assert_ok(msim_scene_set_gravity(scene, sideways, err));
  return scene;
}

static void add_block(msim_scene *scene, int32_t side, double x, double z, double k) {
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {side, side, side},
                                .origin = {x, 0, z},
                                .extent = {0.2, 0.2, 0.2},
                                .mass = 1,
                                .k = k};
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
}

/* It lands on a slope after some steps, and comes to rest on it. */
static msim_scene *jelly(void) {
  const double g[3] = {0, 0, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  add_block(scene, 3, 0, 0.001, 300);
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0.05, 0, 1, 0, 0.3, 0.5);
  return scene;
}

/* All rest lengths are 0: the matrix is constant. */
static msim_scene *net(void) {
  enum { N = 30 };
  const double g[3] = {0, -9.81, 3};
  const int32_t pinned = 0;
  double x[3 * N], mass[N], k[2 * N], rest[2 * N] = {0};
  int32_t ij[4 * N], n = 0;
  for (int32_t i = 0; i < N; i++) {
    x[3 * i] = 0.1 * i, x[3 * i + 1] = 0.01 * (i % 5), x[3 * i + 2] = 0.02 * (i % 3);
    mass[i] = 0.01 + 0.001 * (i % 7);
    for (int32_t j = i + 1; j < N && j <= i + 2; j++, n++)
      ij[2 * n] = i, ij[2 * n + 1] = j, k[n] = 10 + n % 4;
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, n, ij, k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pinned, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* Two islands without gravity: one at rest, one hit by a particle. */
static msim_scene *islands(void) {
  enum { SIDE = 8 };
  const double x[3] = {0.9, 0.1, 0.1}, v[3] = {-1, 0.5, 0.2}, mass = 0.1, k = 400, rest = 0.2;
  const int32_t ij[2] = {2 * SIDE * SIDE * SIDE, SIDE * SIDE * SIDE};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  add_block(scene, SIDE, 0, 0, 300);
  add_block(scene, SIDE, 1, 0, 300);
  assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  return scene;
}

/*------------------------------------- methods --------------------------------------------------*/

enum { STEPS = 24 };
static const int64_t points[] = {0, 1, 2, 11, 23};
enum { NPOINTS = sizeof points / sizeof *points };

typedef struct kind {
  const char *name;
  msim_scene *(*make)(void);
  int collision;
} kind;

static const kind kinds[] = {{"cloth", cloth, MSIM_COLLISION_REFLECT},
                             {"damped cloth", damped, MSIM_COLLISION_REFLECT},
                             {"flat cloth", flat, MSIM_COLLISION_REFLECT},
                             {"net of rest length 0", net, MSIM_COLLISION_REFLECT},
                             {"jelly on a slope", jelly, MSIM_COLLISION_REFLECT},
                             {"jelly that rests", jelly, MSIM_COLLISION_EVENT}};
enum { NKINDS = sizeof kinds / sizeof *kinds };

/* 1 if the method takes the scene. */
static int takes(const msim_scene *scene, const msim_options *opt) {
  msim_sim *sim = NULL;
  const msim_status status = msim_sim_create(scene, opt, &sim, NULL);
  msim_sim_destroy(sim);
  return status == MSIM_OK;
}

static void every_method_goes_on_to_the_same_bits(void **state) {
  (void)state;
  const char *method;
  for (int32_t m = 0; (method = method_at(m)) != NULL; m++)
    for (int i = 0; i < NKINDS; i++) {
      char label[100];
      snprintf(label, sizeof label, "%s, %s", kinds[i].name, method);
      msim_scene *scene = kinds[i].make();
      msim_options opt = options(method, 2e-3);
      opt.collision = kinds[i].collision, opt.solver = "pcg";
      if (takes(scene, &opt)) expect_resumable(scene, &opt, STEPS, NPOINTS, points, label);
      msim_scene_destroy(scene);
    }
}

/* Steps that are divided by retries, and a few springs that are much stiffer than the others */
static void parts_of_steps_and_of_springs(void **state) {
  (void)state;
  const double k = 1e6;
  msim_scene *scene = hanging_cloth(6, 300, 0);
  assert_ok(msim_scene_add_springs(scene, 1, (int32_t[2]){7, 9}, &k, NULL, NULL, err));
  msim_options opt = options("respa", 2e-3);
  expect_resumable(scene, &opt, STEPS, NPOINTS, points, "respa");
  opt = options("bdf2", 5e-3);
  opt.newton_max_iterations = 4, opt.newton_retries = 8, opt.solver = "pcg";
  const msim_stats s = expect_resumable(scene, &opt, STEPS, NPOINTS, points, "bdf2 in parts");
  assert_true(s.rejected_steps > 0); /* otherwise nothing is tested */
  msim_scene_destroy(scene);
}

static void islands_rest_and_move(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler", "bdf2"};
  static const int64_t at[] = {3};
  msim_scene *scene = islands();
  for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
    msim_options opt = options(methods[m], 2e-3);
    const msim_stats s = expect_resumable(scene, &opt, 6, 1, at, methods[m]);
    assert_true(s.islands_at_rest > 0); /* otherwise nothing is tested */
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- solvers --------------------------------------------------*/

static void every_solver_goes_on_to_the_same_bits(void **state) {
  (void)state;
  static const char *const solvers[] = {"auto", "pcg",          "cholmod",
                                        "klu",  "sundials-pcg", "sundials-spgmr"};
  static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler", "bdf2"};
  for (size_t i = 0; i < sizeof solvers / sizeof *solvers; i++) {
    if (i && !is_solver_available(solvers[i])) continue;
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++)
      for (int k = 0; k < 4; k++) {
        char label[100];
        msim_scene *scene = kinds[k].make();
        msim_options opt = options(methods[m], 1.0 / 60);
        opt.solver = solvers[i];
        snprintf(label, sizeof label, "%s, %s, %s", kinds[k].name, methods[m], solvers[i]);
        expect_resumable(scene, &opt, STEPS, NPOINTS, points, label);
        msim_scene_destroy(scene);
      }
  }
}

/* Compressed along one edge: its exact matrix is indefinite. */
static msim_scene *crushed(void) {
  enum { SIDE = 7, N = SIDE * SIDE };
  msim_scene *made = hanging_cloth(SIDE, 300, 0.01), *scene;
  msim_scene_view view = {.size = sizeof view};
  double x[3 * N];
  const int32_t corners[2] = {0, SIDE - 1};
  msim_scene_get(made, &view);
  for (int i = 0; i < 3 * N; i++) x[i] = view.x[i] * (i % 3 == 1 ? 0.7 : 1);
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, view.mass, err));
  assert_ok(
      msim_scene_add_springs(scene, view.nsprings, view.ij, view.k, view.rest, view.damping, err));
  assert_ok(msim_scene_pin(scene, 2, corners, err));
  assert_ok(msim_scene_set_gravity(scene, view.gravity, err));
  msim_scene_destroy(made);
  return scene;
}

/* A cloth that falls on its edge, with steps so long that pivots of one matrix are bad for
 * another. */
static msim_scene *thrown(void) {
  msim_scene *scene = hanging_cloth(6, 2000, 0.01);
  assert_ok(msim_scene_set_gravity(scene, (double[3]){3, -20, -1}, err));
  plane(scene, 0, 1, 0, -0.2, 0, 0);
  return scene;
}

static void indefinite_matrices(void **state) {
  (void)state;
  static const char *const solvers[] = {"auto", "cholmod", "klu"};
  static const int64_t late[] = {3, 10, 31, 52};
  for (size_t i = 0; i < sizeof solvers / sizeof *solvers; i++)
    for (int32_t way = MSIM_INDEFINITE_CLAMP; way <= MSIM_INDEFINITE_SOLVE; way++) {
      if (!is_solver_available(i ? solvers[i] : "cholmod")) continue;
      msim_scene *scene = crushed(), *other = thrown();
      msim_options opt = options("linearly-implicit-euler", 0.02);
      opt.solver = solvers[i],
      opt.watch = MSIM_WATCH_OFF; /* solved without clamping, the motion is unbounded */
      opt.indefinite = way;
      expect_resumable(scene, &opt, STEPS, NPOINTS, points, solvers[i]);
      opt.h = 0.1;
      expect_resumable(other, &opt, 60, 4, late, solvers[i]);
      msim_scene_destroy(scene), msim_scene_destroy(other);
    }
}

/* A solid with solver = auto; returns the statistics of the run */
static msim_stats expect_resumable_solid(const msim_scene *scene, const char *method, double h,
                                         int64_t steps, int n, const int64_t *at) {
  msim_options opt = options(method, h);
  opt.solver_rtol = 1e-10;
  return expect_resumable(scene, &opt, steps, n, at, method);
}

/* The factorization is that of an earlier step. */
static void a_lagged_factor_is_restored(void **state) {
  (void)state;
  static const int64_t at[] = {1, 2, 9, 21, 33};
  require(is_solver_available("cholmod"), "the solver cholmod");
  const char *const methods[] = {"linearly-implicit-euler", "implicit-euler"};
  msim_scene *scene = pinned_block(5, 1, 1e8, 0);
  for (int m = 0; m < 2; m++) {
    const msim_stats s = expect_resumable_solid(scene, methods[m], 1e-2, 40, 5, at);
    assert_true(s.factorizations > 0 && s.kept_factors > 0); /* otherwise nothing is tested */
  }
  msim_scene_destroy(scene);
}

/* the coarse factor of pcg, and the factorization by cholmod that auto computes in mid-run */
static void coarse_and_lagged_factors_are_restored(void **state) {
  (void)state;
  static const int64_t at[] = {1, 5, 7, 8, 9, 10, 16, 29};
  msim_scene *scene = pinned_block(9, 1, 3000, 0);
  const msim_stats s =
      expect_resumable_solid(scene, "linearly-implicit-euler", 1.0 / 60, 32,
                             HAS_ADDRESS_SANITIZER ? 3 : 8, at + (HAS_ADDRESS_SANITIZER ? 4 : 0));
  assert_true(s.coarse_factors > 0 && s.kept_factors > 0);
  if (is_solver_available("cholmod")) assert_true(s.factorizations > 0 && s.analyses > 0);
  const msim_stats n =
      expect_resumable_solid(scene, "implicit-euler", 1.0 / 60, 6, 2, (int64_t[2]){2, 5});
  assert_true(n.coarse_factors > 0 && n.kept_factors > 0);
  msim_scene_destroy(scene);
}

/* A moving cloth computes a coarse factor in each step. */
static void coarse_factors_of_cloth(void **state) {
  (void)state;
  static const int64_t at[] = {2, 7};
  static const char *const methods[] = {"linearly-implicit-euler", "bdf2"};
  msim_scene *scene = hanging_cloth(24, 1e4, 0.01);
  for (int m = 0; m < 2; m++) {
    msim_options opt = options(methods[m], 1.0 / 60);
    opt.solver = "pcg";
    expect_resumable(scene, &opt, 10, 2, at, methods[m]);
  }
  msim_scene_destroy(scene);
}

static void pcg_may_have_been_replaced(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  msim_scene *scene = cloth();
  msim_options opt = options("linearly-implicit-euler", 2e-3);
  opt.solver_max_iterations = 2;
  expect_resumable(scene, &opt, STEPS, NPOINTS, points, "fallback");
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, STEPS, err));
  assert_int_equal(stats_of(sim).fallbacks, 1); /* otherwise nothing is tested */
  const checkpoint c = save(sim);
  msim_sim *other = resume(scene, &opt, &c);
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(other, &plan);
  assert_string_equal(plan.solver, "cholmod");
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(every_method_goes_on_to_the_same_bits),
                                     cmocka_unit_test(parts_of_steps_and_of_springs),
                                     cmocka_unit_test(islands_rest_and_move),
                                     cmocka_unit_test(every_solver_goes_on_to_the_same_bits),
                                     cmocka_unit_test(indefinite_matrices),
                                     cmocka_unit_test(a_lagged_factor_is_restored),
                                     cmocka_unit_test(coarse_and_lagged_factors_are_restored),
                                     cmocka_unit_test(coarse_factors_of_cloth),
                                     cmocka_unit_test(pcg_may_have_been_replaced)};
  return cmocka_run_group_tests_name("checkpoint", tests, NULL, NULL);
}
