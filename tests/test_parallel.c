/* Tests that several threads give the same bits as one, for every method and several meshes, and
 * that the plan states the number of threads. */
#include <stdlib.h>

#include "scenes.h"

enum { MOST = 2000 };
static const int32_t threads[] = {1, 2, 3, 7};
enum { NTHREADS = sizeof threads / sizeof *threads };

static msim_scene *jelly(void) {
  const double g[3] = {0, 0, -9.81};
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {12, 12, 12},
                                .extent = {1, 1, 1},
                                .mass = 1,
                                .k = 100,
                                .damping = 0.01,
                                .npinned = 1,
                                .pinned = (const int32_t[]){5}};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, -0.001, 0.5, 0.1);
  return scene;
}

/* 3 n springs between random pairs of n particles. */
static msim_scene *tangle(int32_t n) {
  static double x[3 * MOST], mass[MOST], k[3 * MOST];
  static int32_t ij[6 * MOST];
  unsigned seed = 11;
  msim_scene *scene;
  for (int32_t i = 0; i < 3 * n; i++) x[i] = uniform(&seed), k[i] = 10 + 90 * uniform(&seed);
  for (int32_t i = 0; i < n; i++) mass[i] = 0.1 + uniform(&seed);
  for (int32_t e = 0; e < 3 * n; e++) {
    ij[2 * e] = e % n;
    ij[2 * e + 1] = (e + 1 + (int32_t)(uniform(&seed) * (n - 1))) % n;
  }
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, n, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 3 * n, ij, k, NULL, NULL, err));
  assert_ok(msim_scene_set_drag(scene, 0.1, err));
  return scene;
}

static void run(const msim_scene *scene, const char *method, int32_t nthreads, int32_t *n,
                double *x, double *v) {
  /* with a step this long the linearly implicit method uses its coarse space */
  const int linear = strcmp(method, "linearly-implicit-euler") == 0;
  msim_options opt = options(method, linear ? 0.05 : is_implicit(method) ? 5e-3 : 1e-3);
  opt.newton_rtol = 1e-4; /* the test compares bits, so that accuracy does not matter */
  opt.threads = nthreads, opt.solver = "pcg", opt.jacobian = MSIM_JACOBIAN_CLAMP;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim,
                          linear || !is_implicit(method) ? 25
                          : HAS_ADDRESS_SANITIZER        ? 1
                                                         : 4,
                          err));
  const msim_state state = state_of(sim);
  assert_true(state.n <= MOST);
  *n = state.n;
  memcpy(x, state.x, 3 * (size_t)state.n * sizeof *x);
  memcpy(v, state.v, 3 * (size_t)state.n * sizeof *v);
  msim_sim_destroy(sim);
}

static void check_scene(msim_scene *scene, int is_damped) {
  static double x[NTHREADS][3 * MOST], v[NTHREADS][3 * MOST];
  const msim_integrator_entry *method;
  int32_t n = 0;
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  for (int32_t i = 0; (method = msim_integrator_info(i)) != NULL; i++) {
    if (method->order == 0) continue; /* planned for a later version */
    if (is_damped && takes_positions_only(method->name)) continue;
    if (view.nplanes && refuses_planes(method->name)) continue;
    for (int t = 0; t < NTHREADS; t++) {
      run(scene, method->name, threads[t], &n, x[t], v[t]);
      assert_memory_equal(x[t], x[0], 3 * (size_t)n * sizeof **x);
      assert_memory_equal(v[t], v[0], 3 * (size_t)n * sizeof **v);
    }
  }
  msim_scene_destroy(scene);
}

static void cloth_has_the_same_bits(void **state) {
  (void)state;
  check_scene(hanging_cloth(44, 200, 0.1), 1);
}

static void jelly_has_the_same_bits(void **state) {
  (void)state;
  check_scene(jelly(), 1);
}

static void tangles_have_the_same_bits(void **state) {
  (void)state;
  check_scene(tangle(9), 1);
  check_scene(tangle(MOST), 1);
}

/*------------------------------------- plans ----------------------------------------------------*/

static void expect_threads(msim_scene *scene, int32_t asked, int32_t want, const char *words) {
  msim_options opt = options("verlet", 1e-4);
  opt.threads = asked;
  msim_sim *sim = make_sim(scene, &opt);
  msim_plan plan = {.size = sizeof plan};
  const char *text, *line;
  msim_sim_plan(sim, &plan);
  assert_int_equal(plan.threads, want);
  assert_ok(msim_sim_explain(sim, &text, err));
  line = strstr(text, "\nthreads ");
  assert_non_null(line);
  assert_int_equal(strtol(line + strlen("\nthreads "), NULL, 10), want);
  assert_non_null(strstr(line, words));
  msim_sim_destroy(sim);
}

static void plans_tell_how_many(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(12, 200, 0);
  expect_threads(scene, 0, 1, "one"); /* reason: one core, or a second one is not cost-effective */
  expect_threads(scene, 1, 1, "requested");
  expect_threads(scene, 3, 3, "requested");
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(cloth_has_the_same_bits), cmocka_unit_test(jelly_has_the_same_bits),
      cmocka_unit_test(tangles_have_the_same_bits), cmocka_unit_test(plans_tell_how_many)};
  return cmocka_run_group_tests_name("parallel", tests, NULL, NULL);
}
