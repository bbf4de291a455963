/* Tests of forces that the program computes: against closed solutions with the order of each
 * method, against springs that exert the same force, the matrix, and the balance of energy. */
#include <complex.h>

#include "force_functions.h"

enum { T = MSIM_FORCE_TIME, V = MSIM_FORCE_VELOCITY, J = MSIM_FORCE_JACOBIAN };

static const double X0[3] = {1, -0.5, 0.25}, V0[3] = {0.3, 0.7, -0.4};

/* x'' = -k x - c (x' - wind) + push sin(omega t), m = 1: x = Re z e^{rt}, r = (-c +- sqrt(c^2 - 4
 * k))/2, and the particular solution c wind/k + Im(push e^{i omega t}/(k - omega^2 + i c omega)) */
static void solve_oscillator(const field *of, double t, double x[3], double v[3]) {
  const double complex i = I, root = csqrt(of->c * of->c - 4 * of->k + 0 * i);
  const double complex r1 = (-of->c + root) / 2, r2 = (-of->c - root) / 2;
  const double w = of->omega;
  for (int a = 0; a < 3; a++) {
    const double complex amplitude = of->push[a] / (of->k - w * w + i * of->c * w);
    const double still = of->c * of->wind[a] / of->k;
    const double complex x0 = X0[a] - still - cimag(amplitude),
                         v0 = V0[a] - cimag(i * w * amplitude);
    const double complex z1 = (v0 - r2 * x0) / (r1 - r2), z2 = x0 - z1;
    const double complex turn = cexp(i * w * t);
    x[a] = creal(z1 * cexp(r1 * t) + z2 * cexp(r2 * t)) + still + cimag(amplitude * turn);
    v[a] = creal(r1 * z1 * cexp(r1 * t) + r2 * z2 * cexp(r2 * t)) + cimag(i * w * amplitude * turn);
  }
}

/* x' rotates about e_z: with z = vx + i vy, z' = -i B z */
static void solve_magnet(const field *of, double t, double x[3], double v[3]) {
  const double complex z = V0[0] + I * V0[1], turn = cexp(-I * of->magnet * t);
  const double complex path = z * (1 - turn) / (I * of->magnet);
  v[0] = creal(z * turn), v[1] = cimag(z * turn), v[2] = V0[2];
  x[0] = X0[0] + creal(path), x[1] = X0[1] + cimag(path), x[2] = X0[2] + V0[2] * t;
}

typedef void solution(const field *of, double t, double x[3], double v[3]);

static double error_of(const char *method, field of, uint32_t flags, solution *solve,
                       int64_t steps) {
  const double end = 1.5;
  msim_scene *scene = make_single_particle(X0, V0, 0);
  set_field(scene, &of, flags);
  msim_options opt = options(method, end / (double)steps);
  opt.newton_rtol = 1e-13, opt.solver_rtol = 1e-13;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  const msim_state s = state_of(sim);
  double x[3], v[3], most = 0;
  solve(&of, end, x, v);
  for (int c = 0; c < 3; c++) most = fmax(most, fmax(fabs(s.x[c] - x[c]), fabs(s.v[c] - v[c])));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return most;
}

static void expect_orders(field of, uint32_t flags, solution *solve) {
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!takes_functions(method) || (flags & V && takes_positions_only(method))) continue;
    const int order = msim_integrator_info(i)->order;
    const int64_t steps = order >= 8 ? 5 : order >= 6 ? 8 : order >= 4 ? 24 : 400;
    const double coarse = error_of(method, of, flags, solve, steps),
                 fine = error_of(method, of, flags, solve, 2 * steps);
    const double found = log2(coarse / fine);
    print_message("  %s: %.3g %.3g, order %.2f\n", method, coarse, fine, found);
    if (!(found > order - 0.25) && fine > 1e-12)
      fail_msg("%s: order %.2f, not %d", method, found, order);
  }
}

static const field driven = {.k = 9, .omega = 4, .push = {1, -2, 0.5}};

static void driven_oscillators_keep_the_order(void **state) {
  (void)state;
  expect_orders(driven, T | J, solve_oscillator);
}

static void damped_oscillators_keep_the_order(void **state) {
  (void)state;
  field of = driven;
  of.c = 0.8, of.wind[0] = 2, of.wind[2] = -1;
  expect_orders(of, T | V | J, solve_oscillator);
}

static void magnets_keep_the_order(void **state) {
  (void)state;
  expect_orders((field){.magnet = 3}, V | J, solve_magnet);
}

/* Without a Jacobian Newton's method converges linearly, to the same solution. */
static void jacobians_may_be_missing(void **state) {
  (void)state;
  expect_orders(driven, T, solve_oscillator);
}

/* Quadratic drag in a wind along x: u = wind - v obeys u' = -c u^2. */
static int32_t blow(void *data, const msim_force_batch *b) {
  const double c = 0.5, wind[3] = {8, 0, 0};
  (void)data;
  for (int32_t i = 0; i < b->n; i++) {
    double u[3];
    for (int a = 0; a < 3; a++) u[a] = wind[a] - b->v[3 * i + a];
    const double speed = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    for (int a = 0; a < 3; a++) b->f[3 * i + a] = c * speed * u[a];
    for (int a = 0; a < 3 && b->dfdv; a++)
      for (int d = 0; d < 3; d++)
        b->dfdv[9 * i + 3 * a + d] = -c * ((a == d) * speed + u[a] * u[d] / speed);
  }
  return 0;
}

static void wind_is_exact(void **state) {
  (void)state;
  const char *const methods[] = {"dop853", "implicit-midpoint", "linearly-implicit-euler",
                                 "implicit-euler"};
  const double allowed[] = {1e-9, 2e-4, 2e-2, 2e-2}, zero[3] = {0};
  for (int i = 0; i < 4; i++) {
    const msim_force_function is = {
        .size = sizeof is, .flags = V | J, .name = "wind", .evaluate = blow};
    msim_scene *scene = make_single_particle(zero, zero, 0);
    assert_ok(msim_scene_set_force_function(scene, &is, err));
    const msim_options opt = options(methods[i], 0.005);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 200, err));
    assert_close(state_of(sim).v[0], 8 - 8 / (1 + 0.5 * 8), allowed[i]);
    if (i > 1) assert_true(stats_of(sim).newton_iterations <= 200 * 6);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A cloth in a trap: by a function, or by springs of rest length 0 to a pinned particle */
static msim_scene *trapped_cloth(int by_function, field *of, uint32_t flags) {
  enum { SIDE = 4, N = SIDE * SIDE };
  msim_scene *scene = hanging_cloth(SIDE, 40, 0);
  const double center[3] = {0}, mass = 1, k = of->k, rest = 0;
  const int32_t pin = N;
  assert_ok(msim_scene_add_particles(scene, 1, center, NULL, &mass, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  if (by_function) set_field(scene, of, flags);
  for (int32_t p = 0; p < N && !by_function; p++) {
    const int32_t ij[2] = {p, pin};
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  }
  return scene;
}

static void traps_equal_springs(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!takes_functions(method)) continue;
    field of = {.k = 25};
    msim_options opt = options(method, 2e-3);
    opt.newton_rtol = 1e-12, opt.solver_rtol = 1e-12;
    msim_scene *scenes[] = {trapped_cloth(1, &of, J), trapped_cloth(0, &of, 0)};
    msim_sim *a = make_sim(scenes[0], &opt), *b = make_sim(scenes[1], &opt);
    assert_ok(msim_sim_step(a, 150, err));
    assert_ok(msim_sim_step(b, 150, err));
    const msim_state s = state_of(a), t = state_of(b);
    for (int32_t k = 0; k < 3 * s.n; k++)
      if (!(fabs(s.x[k] - t.x[k]) <= 1e-9)) fail_msg("%s: x[%d] is off", method, k);
    msim_sim_destroy(a), msim_sim_destroy(b);
    msim_scene_destroy(scenes[0]), msim_scene_destroy(scenes[1]);
  }
}

/* A stiff trap at h omega = 100: implicit Euler multiplies x by less than 1/(h omega), and the
 * linearly implicit method is the same for a linear force. */
static void stiff_traps_are_stable(void **state) {
  (void)state;
  const char *const methods[] = {"implicit-euler", "linearly-implicit-euler", "tr-bdf2", "sdirk2"};
  for (int i = 0; i < 4; i++) {
    field of = {.k = 1e8};
    msim_scene *scene = make_single_particle(X0, V0, 0);
    set_field(scene, &of, J);
    const msim_options opt = options(methods[i], 0.01);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 100, err));
    for (int c = 0; c < 3; c++) assert_close(state_of(sim).x[c], 0, 1e-6);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* f = G x + H v, with matrices that are not symmetric */
typedef struct linear_force {
  double G[9], H[9];
} linear_force;

static int32_t apply_matrices(void *data, const msim_force_batch *b) {
  const linear_force *of = data;
  for (int32_t i = 0; i < b->n; i++)
    for (int a = 0; a < 3; a++)
      for (int c = 0; c < 3; c++) {
        b->f[3 * i + a] += of->G[3 * a + c] * b->x[3 * i + c] + of->H[3 * a + c] * b->v[3 * i + c];
        if (b->dfdx) b->dfdx[9 * i + 3 * a + c] = of->G[3 * a + c];
        if (b->dfdv) b->dfdv[9 * i + 3 * a + c] = of->H[3 * a + c];
      }
  return 0;
}

static void set_matrices(msim_scene *scene, linear_force *of) {
  const msim_force_function is = {
      .size = sizeof is, .flags = V | J, .name = "G", .evaluate = apply_matrices, .data = of};
  assert_ok(msim_scene_set_force_function(scene, &is, err));
}

/* 16 particles, none of them pinned */
static msim_scene *free_rope(void) {
  msim_scene *scene;
  const msim_rope rope = {.size = sizeof rope, .n = 16, .to = {1, 2, 3}, .mass = 0.3, .k = 400};
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  return scene;
}

/* Every solver gets the same steps, in a cloth and a rope that strong forces pull, and needs
 * few iterations of Newton's method. */
static void solvers_take_the_blocks(void **state) {
  (void)state;
  const char *const solvers[] = {"auto", "pcg", "cholmod", "klu"};
  const char *const methods[] = {"implicit-euler", "linearly-implicit-euler",
                                 "linearly-implicit-euler"};
  linear_force of = {.G = {-20, 9, 0, 9.5, -4000, -300, 0, -300, -300},
                     .H = {-1, 0, 0, 0, -20, 0.02, 0, 0, -3}};
  for (int m = 0; m < 3; m++) {
    double first[48] = {0};
    for (int i = 0; i < 4; i++) {
      field none = {0};
      msim_scene *scene = m < 2 ? trapped_cloth(1, &none, 0) : free_rope();
      set_matrices(scene, &of);
      msim_options opt = options(methods[m], 0.02);
      opt.newton_rtol = 1e-11, opt.solver_rtol = 1e-12, opt.solver = solvers[i];
      opt.solver_max_iterations = 60;
      msim_sim *sim;
      msim_error why;
      const msim_status made = msim_sim_create(scene, &opt, &sim, &why);
      if (made != MSIM_ERR_NAME) {
        assert_int_equal(made, MSIM_OK);
        assert_ok(msim_sim_step(sim, 20, err));
        assert_true(stats_of(sim).newton_iterations <= 20 * 11);
        for (int k = 0; k < 48; k++) {
          if (i == 0) first[k] = state_of(sim).x[k];
          assert_close(state_of(sim).x[k], first[k], m < 2 ? 1e-9 : 1e-7);
        }
        msim_sim_destroy(sim);
      }
      msim_scene_destroy(scene);
    }
  }
}

static double sym(const double A[9], int a, int c) { return (A[3 * a + c] + A[3 * c + a]) / 2; }

/* The block is A = m + B', with B = -h^2 sym G - h sym H and B' >= B the nearest symmetric matrix
 * whose eigenvalues are at least `least`: B' - B and B' - least I have no common direction. */
static void matrices_contain_the_blocks(void **state) {
  (void)state;
  linear_force of = {.G = {30, 5, -2, 1, -50, 4, 0, 8, 200}, .H = {1, 2, 3, -4, 5, 6, 0, 1, -9}};
  for (int clamped = 0; clamped < 2; clamped++)
    for (int large = 0; large < 2; large++) {
      const double h = large ? 0.1 : 0.01, least = clamped ? 0 : -0.5;
      msim_scene *scene = make_single_particle(X0, V0, 0);
      set_matrices(scene, &of);
      msim_options opt = options("linearly-implicit-euler", h);
      opt.jacobian = clamped ? MSIM_JACOBIAN_CLAMP : MSIM_JACOBIAN_EXACT;
      msim_sim *sim = make_sim(scene, &opt);
      msim_csr A = {.size = sizeof A};
      assert_ok(msim_sim_matrix(sim, &A, err));
      double above[3][3], raised[3][3], more = 0;
      for (int a = 0; a < 3; a++)
        for (int c = 0; c < 3; c++) {
          const double B = -h * h * sym(of.G, a, c) - h * sym(of.H, a, c);
          above[a][c] = A.val[3 * a + c] - (a == c) * (1 + least);
          raised[a][c] = A.val[3 * a + c] - (a == c) - B;
          assert_close(A.val[3 * a + c], A.val[3 * c + a], 1e-15);
          more = fmax(more, fabs(raised[a][c]));
        }
      assert_int_equal(more > 1e-14, clamped || large);
      for (int a = 0; a < 3; a++)
        for (int c = 0; c < 3; c++)
          assert_close(
              above[a][0] * raised[0][c] + above[a][1] * raised[1][c] + above[a][2] * raised[2][c],
              0, 1e-13);
      for (int a = 0; a < 3; a++) assert_true(above[a][a] >= -1e-14 && raised[a][a] >= -1e-14);
      /* A (v' - v) = h f + h^2 G v */
      double matrix[9], dv[3];
      memcpy(matrix, A.val, sizeof matrix);
      assert_ok(msim_sim_step(sim, 1, err));
      for (int c = 0; c < 3; c++) dv[c] = state_of(sim).v[c] - V0[c];
      for (int a = 0; a < 3; a++) {
        double off = 0;
        for (int c = 0; c < 3; c++)
          off += matrix[3 * a + c] * dv[c] -
                 h * (of.G[3 * a + c] * (X0[c] + h * V0[c]) + of.H[3 * a + c] * V0[c]);
        assert_close(off, 0, 1e-12);
      }
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/*------------------------------------- energy ---------------------------------------------------*/

static void work_is_balanced(void **state) {
  (void)state;
  field of = {
      .k = 3, .c = 0.4, .omega = 9, .magnet = 2, .push = {0.2, -0.1, 0.3}, .wind = {1, 2, 0}};
  msim_scene *scene = trapped_cloth(1, &of, T | V);
  expect_work_is_balanced(scene);
  msim_scene_destroy(scene);
}

static double imbalance(const char *method, field of, uint32_t flags, int64_t steps) {
  const double pin[3] = {0.2, 0.1, -0.3}, mass = 1, k = 30, rest = 0.8;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene = make_single_particle(X0, V0, 0);
  assert_ok(msim_scene_add_particles(scene, 1, pin, NULL, &mass, err));
  assert_ok(msim_scene_pin(scene, 1, &ij[1], err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  set_field(scene, &of, flags);
  msim_options opt = options(method, 1.5 / (double)steps);
  opt.newton_rtol = 1e-13, opt.solver_rtol = 1e-13;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energy_less_work(sim);
  assert_ok(msim_sim_step(sim, steps, err));
  const double off = fabs(energy_less_work(sim) - start);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return off;
}

/* The balance converges with the order of the method. */
static void work_has_the_order_of_the_method(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!takes_functions(method)) continue;
    const int order = msim_integrator_info(i)->order;
    const int64_t steps = order == 1 ? 800 : order == 2 ? 200 : order == 4 ? 50 : 150 / order;

    const double off[] = {imbalance(method, driven, T | J, steps),
                          imbalance(method, driven, T | J, 2 * steps)};
    print_message("  %s: %.3g %.3g, order %.2f\n", method, off[0], off[1], log2(off[0] / off[1]));
    assert_true(off[1] < 1e-12 || log2(off[0] / off[1]) > order - 0.4);
  }
}

/* With a potential energy is conserved, no work is done, and calls are those of force sweeps. */
static void potentials_count_as_energy(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "dop853", "rkn6", "implicit-midpoint"};
  for (int i = 0; i < 4; i++) {
    field of = {.k = 25};
    msim_force_function is = field_function(&of, J);
    is.potential = field_potential;
    msim_scene *scene = trapped_cloth(0, &of, 0), *spring_scene = scene;
    scene = trapped_cloth(1, &of, J);
    assert_ok(msim_scene_set_force_function(scene, &is, err));
    const msim_options opt = options(methods[i], 1e-3);
    msim_sim *sim = make_sim(scene, &opt), *springs = make_sim(spring_scene, &opt);
    msim_energy e = {.size = sizeof e}, s = {.size = sizeof s};
    assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
    assert_int_equal(msim_sim_energy(springs, &s), MSIM_OK);
    /* the springs of pinned corners, too, have energy: 25/2 (0 + 1) */
    assert_close(e.total, s.total - 12.5, 1e-12);
    const double start = energy_less_work(sim);
    of.calls = 0;
    assert_ok(msim_sim_step(sim, 400, err));
    assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
    assert_true(e.work == 0);
    assert_close(e.total, start, (i == 0 || i == 3 ? 1e-3 : 1e-7) * start);
    assert_int_equal(of.calls, stats_of(sim).force_evaluations + stats_of(sim).assemblies);
    msim_sim_destroy(sim), msim_sim_destroy(springs);
    msim_scene_destroy(scene), msim_scene_destroy(spring_scene);
  }
}

/* Motion that the force drives for long is not called unstable, and h = auto follows the bounds. */
static void driven_motion_is_not_unstable(void **state) {
  (void)state;
  const double zero[3] = {0};
  for (int kind = 0; kind < 3; kind++) { /* work of x, work of t, a potential */
    const int by_time = kind == 1;
    field of = {.k = by_time ? 0 : -4, .push = {by_time ? 50 : 0, 0, 0}, .omega = 0.1};
    msim_scene *scene = make_single_particle(by_time ? zero : X0, zero, 0);
    msim_force_function is = field_function(&of, by_time ? T : J);
    if (kind == 2) is.potential = field_potential;
    assert_ok(msim_scene_set_force_function(scene, &is, err));
    const msim_options opt = options(by_time ? "velocity-verlet" : "implicit-euler", 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 5000, err));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  field of = {.k = 100};
  msim_force_function is = field_function(&of, J);
  is.largest_stiffness = 100;
  msim_scene *scene = make_single_particle(X0, V0, 0);
  assert_ok(msim_scene_set_force_function(scene, &is, err));
  const msim_options opt = options("velocity-verlet", MSIM_H_AUTO);
  msim_sim *sim = make_sim(scene, &opt);
  assert_close(state_of(sim).h, 0.9 * 2 / 10, 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(driven_oscillators_keep_the_order),
      cmocka_unit_test(damped_oscillators_keep_the_order),
      cmocka_unit_test(magnets_keep_the_order),
      cmocka_unit_test(jacobians_may_be_missing),
      cmocka_unit_test(wind_is_exact),
      cmocka_unit_test(traps_equal_springs),
      cmocka_unit_test(stiff_traps_are_stable),
      cmocka_unit_test(solvers_take_the_blocks),
      cmocka_unit_test(matrices_contain_the_blocks),
      cmocka_unit_test(work_is_balanced),
      cmocka_unit_test(work_has_the_order_of_the_method),
      cmocka_unit_test(potentials_count_as_energy),
      cmocka_unit_test(driven_motion_is_not_unstable),
  };
  return cmocka_run_group_tests_name("force_functions", tests, NULL, NULL);
}
