/* Tests that the measured order of accuracy of each method is the declared one, on a swinging chain
 * without impacts. */
#include <math.h>
#include <string.h>

#include "scenes.h"

enum { N = 5 };
#define T_END 0.5

/* 1: springs have the force k (e + 0.2 e^2 + 0.5 e^3) */
static int has_law;

static void add_law(msim_scene *scene) {
  const double coefficients[] = {1, 0.2, 0.5};
  const int32_t springs[N - 1] = {0, 1, 2, 3};
  const msim_law law = {.size = sizeof law,
                        .kind = MSIM_LAW_POLYNOMIAL,
                        .n = 3,
                        .coefficients = coefficients,
                        .limit = 10};
  assert_ok(msim_scene_add_law(scene, &law, NULL, err));
  assert_ok(msim_scene_set_law(scene, N - 1, springs, 1, err));
}

/* A displaced, stretched and moving chain that hangs from its first particle. */
static msim_scene *chain(double damping, double drag) {
  const double g[3] = {0, 0, -9.81};
  double x[3 * N], v[3 * N], mass[N], k[N - 1], rest[N - 1], c[N - 1];
  int32_t ij[2 * (N - 1)], pin = 0;
  for (int i = 0; i < N; i++) {
    x[3 * i] = 0.3 * i, x[3 * i + 1] = 0.05 * i * i, x[3 * i + 2] = -0.1 * i;
    v[3 * i] = 0, v[3 * i + 1] = 0.2 * i, v[3 * i + 2] = 0.1 * i;
    mass[i] = 0.5 + 0.1 * i;
  }
  for (int e = 0; e < N - 1; e++)
    ij[2 * e] = e, ij[2 * e + 1] = e + 1, k[e] = 60, rest[e] = 0.3, c[e] = damping;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, N - 1, ij, k, rest, c, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  assert_ok(msim_scene_set_drag(scene, drag, err));
  if (has_law) add_law(scene);
  return scene;
}

static void run(const msim_scene *scene, const char *method, int start, int steps, double *x,
                double *v) {
  msim_options opt = options(method, T_END / steps);
  opt.solver_rtol = 1e-13;
  opt.verlet_start = start;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  msim_state s = state_of(sim);
  memcpy(x, s.x, 3 * N * sizeof *x);
  memcpy(v, s.v, 3 * N * sizeof *v);
  msim_sim_destroy(sim);
}

static double off(const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < 3 * N; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sqrt(sum);
}

static void check(const char *method, int start, double damping, double drag, double order) {
  msim_scene *scene = chain(damping, drag);
  double x[3][3 * N], v[3][3 * N];
  /* their errors are still far above rounding; those of rk6 contain much of order 7 */
  const int is_rk6 = strcmp(method, "rk6") == 0;
  const int steps = is_rk6 ? 25 : order > 4 ? 15 : 200;
  run(scene, "rk4", 0, 20000, x[0], v[0]);
  run(scene, method, start, steps, x[1], v[1]);
  run(scene, method, start, 2 * steps, x[2], v[2]);
  double in_x = log2(off(x[1], x[0]) / off(x[2], x[0]));
  double in_v = log2(off(v[1], v[0]) / off(v[2], v[0]));
  print_message("  %-24s x: %.3f  v: %.3f\n", method, in_x, in_v);
  /* rounding prevents shorter steps */
  const double margin = is_rk6 ? 0.3 : order > 6 ? 0.25 : 0.15;
  assert_close(in_x, order, margin);
  assert_close(in_v, order, margin);
  msim_scene_destroy(scene);
}

static void measured_order_is_the_declared_one(void **state) {
  (void)state;
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++)
    if (entry->order) check(entry->name, MSIM_VERLET_TAYLOR, 0, 0, entry->order);
}

/* With a smooth law of springs */
static void laws_keep_the_order(void **state) {
  (void)state;
  const msim_integrator_entry *entry;
  has_law = 1;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++)
    if (entry->order) check(entry->name, MSIM_VERLET_TAYLOR, 0, 0, entry->order);
  has_law = 0;
}

static void plain_start_is_first_order(void **state) {
  (void)state;
  check("verlet", MSIM_VERLET_PLAIN, 0, 0, 1);
}

static void damping_costs_two_methods_an_order(void **state) {
  (void)state;
  check("verlet", MSIM_VERLET_TAYLOR, 0.5, 0.3, 1);
  check("takahashi-imada", 0, 0.5, 0.3, 3);
  check("velocity-verlet", 0, 0.5, 0.3, 2);
  check("heun", 0, 0.5, 0.3, 2);
  check("rk4", 0, 0.5, 0.3, 4);
  check("ssprk102", 0, 0.5, 0.3, 2);
  check("ssprk104", 0, 0.5, 0.3, 4);
  check("rk6", 0, 0.5, 0.3, 6);
  check("dop853", 0, 0.5, 0.3, 8);
  check("linearly-implicit-euler", 0, 0.5, 0.3, 1);
}

/* verlet with start = plain is symplectic Euler, bit by bit */
static void plain_verlet_is_symplectic_euler(void **state) {
  (void)state;
  msim_scene *scene = chain(0, 0);
  msim_options opt = options("verlet", 1e-3);
  opt.verlet_start = MSIM_VERLET_PLAIN;
  msim_sim *a = make_sim(scene, &opt);
  opt.integrator = "symplectic-euler";
  msim_sim *b = make_sim(scene, &opt);
  assert_ok(msim_sim_step(a, 500, err));
  assert_ok(msim_sim_step(b, 500, err));
  msim_state sa = state_of(a), sb = state_of(b);
  assert_memory_equal(sa.x, sb.x, 3 * N * sizeof *sa.x);
  assert_memory_equal(sa.v_half, sb.v, 3 * N * sizeof *sa.x);
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene);
}

/* v = g t up to rounding, for any method and direction of g; the plan does not call gravity 0 */
static void free_fall_is_exact_along_each_axis(void **state) {
  (void)state;
  const double x[3] = {0}, v[3] = {0}, h = 0.01;
  for (int32_t i = 0; method_at(i); i++)
    for (int axis = 0; axis < 3; axis++) {
      double g[3] = {0};
      g[axis] = 5;
      msim_scene *scene = make_single_particle(x, v, 0);
      assert_ok(msim_scene_set_gravity(scene, g, err));
      const msim_options opt = options(method_at(i), h);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 20, err));
      for (int c = 0; c < 3; c++) assert_close(state_of(sim).v[c], g[c] * 20 * h, 1e-12);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(measured_order_is_the_declared_one),
                                     cmocka_unit_test(laws_keep_the_order),
                                     cmocka_unit_test(plain_start_is_first_order),
                                     cmocka_unit_test(damping_costs_two_methods_an_order),
                                     cmocka_unit_test(plain_verlet_is_symplectic_euler),
                                     cmocka_unit_test(free_fall_is_exact_along_each_axis)};
  return cmocka_run_group_tests_name("orders", tests, NULL, NULL);
}
