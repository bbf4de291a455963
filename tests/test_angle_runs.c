/* Tests of runs with angular springs: vibrations of beams, orders, conserved quantities, Newton's
 * method, large steps, solvers, the exported matrix. */
#include "angle_scenes.h"
#include "linear/jacobi.h"
#include "sim/sim.h"

/*------------------------------------- vibrations -----------------------------------------------*/

/* Three masses on a line, edges a and b, without springs: w^2 = k sum g_i^2/m_i in each plane, g =
 * (1/a, -1/a - 1/b, 1/b). */
static void three_masses_have_their_frequency(void **state) {
  (void)state;
  const double mass[3] = {0.3, 0.5, 0.2}, a = 0.7, b = 0.4, k = 1.3, amplitude = 1e-5;
  const double g[3] = {1 / a, -1 / a - 1 / b, 1 / b};
  double w2 = 0, x[9] = {-a, 0, 0, 0, 0, 0, b, 0, 0};
  for (int i = 0; i < 3; i++) w2 += k * g[i] * g[i] / mass[i];
  for (int i = 0; i < 3; i++) {
    x[3 * i + 1] = 0.6 * amplitude * g[i] / mass[i];
    x[3 * i + 2] = 0.8 * amplitude * g[i] / mass[i];
  }
  msim_scene *scene;
  const double straight = PI;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){0, 1, 2}, &k, &straight, NULL, err));
  for (int quarter = 1; quarter <= 4; quarter++) {
    const msim_options opt = accurate(quarter * PI / 2 / sqrt(w2));
    msim_sim *sim = make_sim(scene, &opt);
    run_to(sim);
    const msim_state s = state_of(sim);
    const double cosine = quarter % 2 ? 0 : quarter == 4 ? 1 : -1;
    for (int i = 0; i < 3; i++)
      for (int c = 1; c < 3; c++)
        assert_close(s.x[3 * i + c], cosine * x[3 * i + c], 2e-4 * amplitude);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

enum { BEAM = 24 };

/* The matrix of small transverse vibrations of a free beam of unit masses: k/a^2 D^T D, D the
 * second differences */
static void beam_matrix(double m[BEAM][BEAM]) {
  const double d[3] = {1, -2, 1};
  memset(m, 0, sizeof(double[BEAM][BEAM]));
  for (int e = 0; e + 2 < BEAM; e++)
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) m[e + i][e + j] += d[i] * d[j];
}

/* The lowest bending mode by inverse iteration with a shift, kept orthogonal to the rigid modes;
 * returns its eigenvalue. */
static double lowest_mode(double u[BEAM]) {
  double m[BEAM][BEAM], value = 0;
  beam_matrix(m);
  for (int i = 0; i < BEAM; i++) u[i] = pow((double)i / (BEAM - 1) - 0.5, 2);
  for (int round = 0; round < 20; round++) {
    double a[BEAM][BEAM], mean = 0, tilt = 0, size = 0, arms = 0;
    memcpy(a, m, sizeof a);
    for (int i = 0; i < BEAM; i++) mean += u[i] / BEAM;
    for (int i = 0; i < BEAM; i++) {
      const double arm = i - (BEAM - 1) / 2.;
      tilt += arm * u[i], arms += arm * arm;
    }
    for (int i = 0; i < BEAM; i++) u[i] -= mean + tilt / arms * (i - (BEAM - 1) / 2.);
    for (int i = 0; i < BEAM; i++) size += u[i] * u[i];
    for (int i = 0; i < BEAM; i++) u[i] /= sqrt(size), a[i][i] += 1e-7;
    value = 0;
    for (int i = 0; i < BEAM; i++)
      for (int j = 0; j < BEAM; j++) value += u[i] * m[i][j] * u[j];
    for (int k = 0; k < BEAM; k++) /* Gauss */
      for (int i = k + 1; i < BEAM; i++) {
        const double by = a[i][k] / a[k][k];
        for (int j = k; j < BEAM; j++) a[i][j] -= by * a[k][j];
        u[i] -= by * u[k];
      }
    for (int i = BEAM - 1; i >= 0; i--) {
      for (int j = i + 1; j < BEAM; j++) u[i] -= a[i][j] * u[j];
      u[i] /= a[i][i];
    }
  }
  double size = 0;
  for (int i = 0; i < BEAM; i++) size += u[i] * u[i];
  for (int i = 0; i < BEAM; i++) u[i] /= sqrt(size);
  return value;
}

/* Also w = 4.730^2 sqrt(E I/(mu L^4)) of Euler and Bernoulli with E I = k a, mu = m/a, up to the
 * discretization, whose length is L = (n - 1) a + a */
static void free_beam_has_its_frequency(void **state) {
  (void)state;
  const double a = 0.1, k = 0.5, axial = 1e4, amplitude = 1e-7;
  double u[BEAM], x[3 * BEAM] = {0}, mass[BEAM], bend[BEAM], rest[BEAM];
  int32_t ijk[3 * BEAM];
  const double w = sqrt(k / (a * a) * lowest_mode(u)), L = BEAM * a;
  assert_close(w, 4.730041 * 4.730041 * sqrt(k * a * a / pow(L, 4)), 0.01 * w);
  for (int i = 0; i < BEAM; i++) {
    x[3 * i] = a * i, x[3 * i + 2] = amplitude * u[i], mass[i] = 1;
    bend[i] = k, rest[i] = PI, ijk[3 * i] = i, ijk[3 * i + 1] = i + 1, ijk[3 * i + 2] = i + 2;
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, BEAM, x, NULL, mass, err));
  for (int32_t i = 0; i + 1 < BEAM; i++)
    assert_ok(msim_scene_add_springs(scene, 1, (int32_t[]){i, i + 1}, &axial, &a, NULL, err));
  assert_ok(msim_scene_add_angles(scene, BEAM - 2, ijk, bend, rest, NULL, err));
  const msim_options opt = accurate(PI / w);
  msim_sim *sim = make_sim(scene, &opt);
  run_to(sim);
  const msim_state s = state_of(sim);
  for (int i = 0; i < BEAM; i++) assert_close(s.x[3 * i + 2], -x[3 * i + 2], 1e-4 * amplitude);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- orders and invariants ------------------------------------*/

enum { N = 7 };

static void end_state(const msim_scene *scene, const char *method, int steps, double *x) {
  msim_options opt = options(method, 0.2 / steps);
  opt.solver_rtol = 1e-13;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  memcpy(x, state_of(sim).x, 3 * N * sizeof *x);
  msim_sim_destroy(sim);
}

static double distance(const double *x, const double *y) {
  double sum = 0;
  for (int i = 0; i < 3 * N; i++) sum += (x[i] - y[i]) * (x[i] - y[i]);
  return sqrt(sum);
}

/* With damping in a plane: in space it is not smooth at straight edges (angle.h). */
static void methods_keep_their_order(void **state) {
  (void)state;
  for (int damped = 0; damped < 2; damped++) {
    msim_scene *scene = bent_scene((chain){N, 20, 0.02, damped ? 0.02 : 0, damped});
    const msim_integrator_entry *entry;
    double exact[3 * N], x[3 * N], y[3 * N];
    end_state(scene, "dop853", 2000, exact);
    for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++) {
      if (entry->order == 0 || !takes_angles(entry->name, damped)) continue;
      const int steps = entry->order > 4 ? 15 : 200;
      end_state(scene, entry->name, steps, x), end_state(scene, entry->name, 2 * steps, y);
      const double order = log2(distance(x, exact) / distance(y, exact));
      print_message("  %-24s %.3f\n", entry->name, order);
      const double want = damped && strcmp(entry->name, "verlet") == 0            ? 1
                          : damped && strcmp(entry->name, "takahashi-imada") == 0 ? 3
                                                                                  : entry->order;
      assert_close(order, want, entry->order > 4 ? 0.6 : 0.15);
    }
    msim_scene_destroy(scene);
  }
}

static void energy_is_conserved(void **state) {
  (void)state;
  msim_scene *scene = bent_scene((chain){10, 20, 0.05, 0, 0});
  const msim_options opt = accurate(2);
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energy_of(sim).total;
  run_to(sim);
  assert_true(energy_of(sim).elastic > 0.01 * start);
  assert_close(energy_of(sim).total, start, 1e-12 * start);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

static void momentum_is_conserved(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "rkn6", "implicit-midpoint", "dop853"};
  for (int i = 0; i < 4; i++) {
    msim_scene *scene = bent_scene((chain){10, 20, 0.05, i % 3 ? 0 : 0.05, 0});
    msim_options opt = options(methods[i], i == 3 ? 1e-4 : 1e-3);
    opt.solver_rtol = 1e-12, opt.newton_rtol = 1e-12;
    msim_sim *sim = make_sim(scene, &opt);
    const msim_energy start = energy_of(sim);
    assert_ok(msim_sim_step(sim, 300, err));
    const msim_energy end = energy_of(sim);
    for (int c = 0; c < 3; c++) {
      assert_close(end.momentum[c], start.momentum[c], 1e-13);
      assert_close(end.angular_momentum[c], start.angular_momentum[c], i == 2 ? 1e-11 : 1e-13);
    }
    if (i == 0) assert_true(end.total < start.total);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/*------------------------------------- implicit steps -------------------------------------------*/

/* The matrix is exact: the last corrections shrink quadratically, so that few are needed. */
static void newton_converges_quadratically(void **state) {
  (void)state;
  const char *const solvers[] = {"pcg", "cholmod", "klu"};
  for (int i = 0; i < 3; i++) {
    if (i && !is_solver_available(solvers[i])) continue;
    msim_scene *scene = bent_scene((chain){20, 200, 0.5, 0, 0});
    msim_options opt = options("implicit-euler", 5e-3);
    opt.solver = solvers[i], opt.newton_rtol = 1e-12, opt.solver_rtol = 1e-12;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 20, err));
    print_message("  %s: %g iterations a step\n", solvers[i],
                  (double)stats_of(sim).newton_iterations / 20);
    assert_true(stats_of(sim).newton_iterations <= 20 * 8);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/* Diagonal blocks of a zigzag may be indefinite; for iterations they are shifted. */
static void indefinite_blocks_are_shifted(void **state) {
  (void)state;
  enum { ZIGZAG = 9 };
  double mass[ZIGZAG], x[3 * ZIGZAG] = {0};
  const double k = 1, straight = PI;
  msim_scene *scene;
  ms_model m;
  ms_coefficients a;
  ms_jacobi jacobi;
  for (int i = 0; i < ZIGZAG; i++) mass[i] = 1e-3, x[3 * i] = 0.3 * i, x[3 * i + 1] = i % 2;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, ZIGZAG, x, NULL, mass, err));
  for (int32_t i = 0; i + 2 < ZIGZAG; i++)
    assert_ok(
        msim_scene_add_angles(scene, 1, (int32_t[]){i, i + 1, i + 2}, &k, &straight, NULL, err));
  assert_ok(ms_model_create(scene->data, 0, &m, err));
  assert_ok(ms_coefficients_create(&m, &a, err));
  assert_ok(ms_jacobi_create(&m, &a, &jacobi, err));
  double *at = ms_unknowns_new_vector(m.scene, &m.unknowns);
  ms_unknowns_gather(&m.unknowns, x, at);
  ms_coefficients_compute(&m, at, 1, 0, &a);
  assert_int_equal(ms_jacobi_invert(&m, &a, MSIM_FACTOR_SPD, &jacobi), MSIM_NOT_SPD);
  assert_int_equal(ms_jacobi_invert(&m, &a, MSIM_FACTOR_SYMMETRIC, &jacobi), MSIM_OK);
  ms_coefficients_compute(&m, at, 1, 1, &a);
  assert_int_equal(ms_jacobi_invert(&m, &a, MSIM_FACTOR_SPD, &jacobi), MSIM_OK);
  ms_memory_free(&m.scene->alloc, at);
  ms_jacobi_destroy(&m, &jacobi), ms_coefficients_destroy(&m, &a), ms_model_destroy(&m);
  msim_scene_destroy(scene);
}

static void large_steps_are_stable(void **state) {
  (void)state;
  for (int clamp = 0; clamp < 2; clamp++) {
    msim_scene *scene = bending_cloth(12, 1e4, 1, 0);
    msim_options opt = options("linearly-implicit-euler", 0.05);
    opt.jacobian = clamp ? MSIM_JACOBIAN_CLAMP : MSIM_JACOBIAN_EXACT;
    msim_sim *sim = make_sim(scene, &opt);
    const double start = energy_of(sim).total;
    for (int i = 0; i < 20; i++) {
      assert_ok(msim_sim_step(sim, 10, err));
      assert_true(energy_of(sim).total <= start + 0.3 * 9.81 * 0.1);
    }
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/* Every solver makes the motion of an accurate direct one. */
static void solvers_agree(void **state) {
  (void)state;
  static const char *const solvers[] = {"auto",
                                        "pcg",
                                        "cholmod",
                                        "klu",
                                        "sundials-pcg",
                                        "sundials-spgmr",
                                        "sundials-spbcgs",
                                        "sundials-sptfqmr"};
  for (int damped = 0; damped < 2; damped++)
    for (int nonlinear = 0; nonlinear < 2; nonlinear++) {
      msim_scene *scene = bending_cloth(9, 500, 0.02, damped ? 0.001 : 0);
      double first[3 * 81];
      int have = 0;
      for (size_t i = 0; i < sizeof solvers / sizeof *solvers; i++) {
        if (i > 1 && !is_solver_available(solvers[i])) continue;
        msim_options opt =
            options(nonlinear ? "implicit-midpoint" : "linearly-implicit-euler", 0.01);
        opt.solver = solvers[i], opt.solver_rtol = 1e-12, opt.newton_rtol = 1e-10;
        msim_sim *sim = make_sim(scene, &opt);
        assert_ok(msim_sim_step(sim, 20, err));
        const msim_state s = state_of(sim);
        for (int c = 0; c < 3 * 81 && have; c++) assert_close(s.x[c], first[c], 1e-7);
        if (!have) memcpy(first, s.x, sizeof first);
        have = 1;
        msim_sim_destroy(sim);
      }
      msim_scene_destroy(scene);
    }
}

/* The coarse space, with constraints by planes, too */
static void coarse_space_takes_angles(void **state) {
  (void)state;
  msim_scene *scene = bending_cloth(60, 2e4, 2e-3, 0);
  double x[2][3 * 3600];
  int64_t iterations[2];
  for (int i = 0; i < 2; i++) {
    msim_options opt = options("linearly-implicit-euler", 0.02);
    opt.solver = i ? "cholmod" : "pcg", opt.solver_rtol = 1e-10;
    if (i && !is_solver_available("cholmod")) continue;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 5, err));
    iterations[i] = stats_of(sim).iterations;
    if (i == 0) assert_true(sim->islands->stepper.solver->linear->aggregates > 0);
    memcpy(x[i], state_of(sim).x, sizeof x[i]);
    msim_sim_destroy(sim);
  }
  print_message("  %g iterations a step\n", (double)iterations[0] / 5);
  assert_true(iterations[0] / 5 < 250);
  for (int c = 0; c < 3 * 3600 && is_solver_available("cholmod"); c++)
    assert_close(x[0][c], x[1][c], 1e-7);
  msim_scene_destroy(scene);
}

/* msim_sim_matrix is M - h D - h^2 J, for straight edges by its formula. */
static void exported_matrix_contains_angles(void **state) {
  (void)state;
  const double mass[3] = {1, 2, 3}, x[9] = {-0.5, 0, 0, 0, 0, 0, 0.25, 0, 0}, k = 2, c = 0.3,
               h = 0.1;
  const double g[3] = {2, -6, 4}, stiffness = h * h * k + h * c;
  msim_scene *scene;
  msim_csr A = {.size = sizeof A};
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){0, 1, 2}, &k, NULL, &c, err));
  const msim_options opt = options("linearly-implicit-euler", h);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_matrix(sim, &A, err));
  assert_int_equal(A.n, 9);
  for (int r = 0; r < 9; r++)
    for (int32_t e = A.rowptr[r]; e < A.rowptr[r + 1]; e++) {
      const int col = A.colind[e], same = r % 3 == col % 3 && r % 3 > 0;
      assert_close(A.val[e], (r == col) * mass[r / 3] + same * stiffness * g[r / 3] * g[col / 3],
                   1e-14);
    }
  assert_int_equal(A.rowptr[9], 81);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(three_masses_have_their_frequency),
      cmocka_unit_test(free_beam_has_its_frequency),
      cmocka_unit_test(methods_keep_their_order),
      cmocka_unit_test(energy_is_conserved),
      cmocka_unit_test(momentum_is_conserved),
      cmocka_unit_test(newton_converges_quadratically),
      cmocka_unit_test(indefinite_blocks_are_shifted),
      cmocka_unit_test(large_steps_are_stable),
      cmocka_unit_test(solvers_agree),
      cmocka_unit_test(coarse_space_takes_angles),
      cmocka_unit_test(exported_matrix_contains_angles),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
