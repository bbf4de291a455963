/* Tests of msim_sim_modes against closed forms: a clamped string, a membrane with pairs of equal
 * frequencies, a hanging chain, a free tetrahedron, an unstable strut; shapes satisfy K u = w^2 M u
 * and are orthonormal; every solver, wrong calls and failing allocations. */
#include <math.h>

#include "limited_allocator.h"
#include "scenes.h"

#define PI 3.14159265358979323846

static double *modes_of(msim_sim *sim, int32_t n, double *shape) {
  double *f = calloc((size_t)n, sizeof *f);
  assert_ok(msim_sim_modes(sim, n, f, shape, err));
  return f;
}

static void assert_relative(double a, double b, double tol) { assert_close(a / b, 1, tol); }

/*------------------------------------- strings and membranes ------------------------------------*/

/* rows x columns particles of 0.01 kg at unit distances, those at the border pinned (of a single
 * row its ends), with springs of k = 5000 N/m along rows and columns and the tension T = 20 N. */
static msim_scene *membrane(int32_t rows, int32_t columns) {
  const double k = 5000, rest = 1 - 20. / 5000, mass = 0.01;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t r = 0; r < rows; r++)
    for (int32_t c = 0; c < columns; c++) {
      const int32_t p = r * columns + c;
      const double x[3] = {c, r, 0};
      const int32_t left[2] = {p - 1, p}, up[2] = {p - columns, p};
      assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
      if (c) assert_ok(msim_scene_add_springs(scene, 1, left, &k, &rest, NULL, err));
      if (r) assert_ok(msim_scene_add_springs(scene, 1, up, &k, &rest, NULL, err));
      const int border = c == 0 || c == columns - 1 || (rows > 1 && (r == 0 || r == rows - 1));
      if (border) assert_ok(msim_scene_pin(scene, 1, &p, err));
    }
  return scene;
}

/* w_j = 2 sqrt(T/(m l)) sin(j pi/(2 (n + 1))) for n free particles, in both planes */
static void a_clamped_string(void **state) {
  (void)state;
  enum { N = 40, MODES = 10 };
  msim_scene *scene = membrane(1, N + 2);
  const msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim = make_sim(scene, &opt);
  double *f = modes_of(sim, MODES, NULL);
  for (int j = 0; j < MODES; j++)
    assert_relative(f[j], sqrt(2000) * sin((j / 2 + 1) * PI / (2 * (N + 1))) / PI, 1e-9);
  free(f);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* w_ij^2 = 4 T/(m l) (sin^2(i pi/(2 (n + 1))) + sin^2(j pi/(2 (n + 1)))), across the plane */
static void a_membrane_of_equal_sides(void **state) {
  (void)state;
  enum { N = 28, MODES = 12 };
  double wanted[N * N];
  msim_scene *scene = membrane(N + 2, N + 2);
  msim_options opt = options("velocity-verlet", 1e-4);
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) {
      const double a = sin((i + 1) * PI / (2 * (N + 1))), b = sin((j + 1) * PI / (2 * (N + 1)));
      wanted[i * N + j] = sqrt(4 * 2000 * (a * a + b * b)) / (2 * PI);
    }
  qsort(wanted, N * N, sizeof *wanted, ascending);
  for (int threads = 1; threads <= 2; threads++) {
    opt.threads = threads;
    msim_sim *sim = make_sim(scene, &opt);
    double *f = modes_of(sim, MODES, NULL);
    for (int j = 0; j < MODES; j++) assert_relative(f[j], wanted[j], 1e-9);
    free(f);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- hanging chain --------------------------------------------*/

/* n particles of equal mass at distances l below a support: w^2 = g/l times the zeros of the
 * Laguerre polynomial L_n, in two directions. The first five of L_10 (Abramowitz and Stegun, table
 * 25.9). */
static void a_hanging_chain(void **state) {
  (void)state;
  enum { N = 10 };
  const double zeros[5] = {0.137793470540, 0.729454549503, 1.808342901740, 3.401433697855,
                           5.552496140064};
  const double l = 0.1, mass = 0.2, k = 1e7, g[3] = {0, 0, -9.81}, top[3] = {0, 0, 0};
  const int32_t pin = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 1, top, NULL, &mass, err));
  for (int32_t p = 1; p <= N; p++) { /* stretched to l by the weight below */
    const double x[3] = {0, 0, -l * p}, rest = l - (N + 1 - p) * mass * 9.81 / k;
    const int32_t ij[2] = {p - 1, p};
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  }
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  const msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim = make_sim(scene, &opt);
  double *f = modes_of(sim, 10, NULL);
  for (int j = 0; j < 10; j++)
    assert_relative(f[j], sqrt(9.81 / l * zeros[j / 2]) / (2 * PI), 1e-8);
  free(f);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- free and unstable ----------------------------------------*/

/* A regular tetrahedron of equal masses m and springs k: six rigid motions, w^2 = k/m (twice), 2
 * k/m (three times) and 4 k/m. */
static void a_free_tetrahedron(void **state) {
  (void)state;
  const double x[12] = {1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1}, mass[4] = {2, 2, 2, 2},
               k[6] = {30, 30, 30, 30, 30, 30};
  const int32_t ij[12] = {0, 1, 0, 2, 0, 3, 1, 2, 1, 3, 2, 3};
  const double w2[12] = {0, 0, 0, 0, 0, 0, 1, 1, 2, 2, 2, 4};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 4, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 6, ij, k, NULL, NULL, err));
  const msim_options opt = options("implicit-euler", 1e-2);
  msim_sim *sim = make_sim(scene, &opt);
  double *f = modes_of(sim, 12, NULL);
  for (int j = 0; j < 6; j++) assert_true(f[j] == 0);
  for (int j = 6; j < 12; j++) assert_relative(f[j], sqrt(w2[j] * 15) / (2 * PI), 1e-9);
  free(f);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Nothing resists: all frequencies are 0, not the square root of a rounding error. */
static void particles_without_springs(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  const msim_options opt = options("velocity-verlet", 1e-2);
  msim_sim *sim = make_sim(scene, &opt);
  double *f = modes_of(sim, 6, NULL);
  for (int j = 0; j < 6; j++) assert_true(f[j] == 0);
  free(f);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A strut of two springs under the compressive force P, straight: w^2 = -2 P/(m l) in two
 * directions, 2 k/m along it. */
static void an_unstable_strut(void **state) {
  (void)state;
  msim_scene *scene = compressed_strut(3);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  double *f = modes_of(sim, 3, NULL);
  assert_relative(f[0], -sqrt(2 * 25 / 3.) / (2 * PI), 1e-9);
  assert_relative(f[1], -sqrt(2 * 25 / 3.) / (2 * PI), 1e-9);
  assert_relative(f[2], sqrt(2 * 100 / 3.) / (2 * PI), 1e-9);
  free(f);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- shapes ---------------------------------------------------*/

/* F(x + e u) - F(x - e u) = -2 e w^2 M u + O(e^3), and u_i.M u_j = delta_ij. */
static void shapes_vibrate(void **state) {
  (void)state;
  enum { MODES = 8 };
  msim_scene *scene = hanging_cloth(7, 300, 0.5);
  msim_options opt = options("velocity-verlet", 1e-4);
  const char *const solvers[] = {"auto", "pcg", "cholmod", "klu"};
  for (int i = 0; i < 4; i++) {
    opt.solver = solvers[i];
    if (i >= 2 && !is_solver_available(opt.solver)) continue;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_equilibrium(sim, 1e-9, 1000, NULL, err));
    const msim_state s = state_of(sim);
    const size_t n = 3 * (size_t)s.n;
    double *u = malloc(MODES * n * sizeof *u), *at = calloc(5 * n, sizeof *at);
    for (size_t c = 0; c < MODES * n; c++) u[c] = NAN;
    double *f = modes_of(sim, MODES, u), *force[2] = {at + n, at + 2 * n}, *v = at + 3 * n;
    const double e = 1e-6, mass = 0.3 / 49;
    for (int j = 0; j < MODES; j++) {
      const double w2 = 4 * PI * PI * f[j] * f[j];
      for (int side = 0; side < 2; side++) {
        for (size_t c = 0; c < n; c++) at[c] = s.x[c] + (side ? -e : e) * u[(size_t)j * n + c];
        msim_sim_force(sim, at, v, force[side]);
      }
      for (size_t c = 0; c < n; c++)
        assert_close(force[0][c] - force[1][c], -2 * e * w2 * mass * u[(size_t)j * n + c],
                     1e-5 * e * w2);
      for (int k = 0; k < MODES; k++) {
        double product = 0;
        for (size_t c = 0; c < n; c++)
          product += mass * u[(size_t)j * n + c] * u[(size_t)k * n + c];
        assert_close(product, j == k, 1e-8);
      }
    }
    free(f), free(u), free(at);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- calls ----------------------------------------------------*/

static void wrong_calls(void **state) {
  (void)state;
  msim_error why;
  double f[3];
  msim_scene *scene = hanging_cloth(3, 300, 0);
  const msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_modes(NULL, 1, f, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_modes(sim, 1, NULL, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_modes(sim, 0, f, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_modes(sim, 22, f, NULL, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "from 1 to 21"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static msim_status find_modes(const msim_allocator *alloc, void *data) {
  (void)data;
  const msim_options opt = options("velocity-verlet", 1e-4);
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, k = 100;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  double f[2];
  msim_status status = msim_scene_create(alloc, &scene, NULL);
  if (!status) status = msim_scene_add_particles(scene, 2, x, NULL, mass, NULL);
  if (!status) status = msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, NULL);
  if (!status) status = msim_sim_create(scene, &opt, &sim, NULL);
  if (!status) status = msim_sim_modes(sim, 2, f, NULL, NULL);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return status;
}

static void every_allocation_may_fail(void **state) {
  (void)state;
  assert_true(expect_memory_errors(find_modes, NULL) > 50);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_clamped_string),
      cmocka_unit_test(a_membrane_of_equal_sides),
      cmocka_unit_test(a_hanging_chain),
      cmocka_unit_test(a_free_tetrahedron),
      cmocka_unit_test(particles_without_springs),
      cmocka_unit_test(an_unstable_strut),
      cmocka_unit_test(shapes_vibrate),
      cmocka_unit_test(wrong_calls),
      cmocka_unit_test(every_allocation_may_fail),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
