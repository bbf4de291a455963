/* Tests of linear solvers in implicit steps; the argument names the solver. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "scenes.h"

static const char *solver = "pcg";
static int direct, symmetric;

static msim_options implicit(double h) {
  msim_options opt = options("linearly-implicit-euler", h);
  opt.solver = solver;
  opt.solver_rtol = 1e-12;
  return opt;
}

/* A compressed column of two springs between pinned ends, slightly bent: it buckles. Across the
 * column the stiffness is 2 k (1 - L/l) = -25 N/m, so that the exact matrix is indefinite for h >
 * sqrt(m/25) = 0.063 s. */
static msim_scene *column(void) {
  const double x[9] = {0, 0, 0, 0.4, 1e-3, 5e-4, 0.8, 0, 0}, mass[3] = {1, 0.1, 1};
  const double k[2] = {50, 50}, rest[2] = {0.5, 0.5};
  const int32_t ij[4] = {0, 1, 1, 2}, pins[2] = {0, 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 2, pins, err));
  return scene;
}

/* A compressed triangle of free particles: its springs couple unknowns, so that A is not
 * diagonal. */
static msim_scene *compressed_triangle(void) {
  const double x[9] = {0, 0, 0, 0.5, 0, 0, 0.2, 0.4, 0}, mass[3] = {1, 1, 1};
  const double k[3] = {500, 500, 500}, rest[3] = {1, 1, 1};
  const int32_t ij[6] = {0, 1, 1, 2, 2, 0};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 3, ij, k, rest, NULL, err));
  return scene;
}

/* ||b - A v|| of the step just made, with the matrix and the forces before it. */
static void answer_solves_the_system(void **state) {
  (void)state;
  enum { SIDE = 6, N = SIDE * SIDE };
  double b[3 * N], v[3 * N] = {0}, f[3 * N], norm_b = 0, norm_r = 0;
  msim_scene *scene = hanging_cloth(SIDE, 200, 0.1);
  msim_options opt = implicit(5e-3);
  msim_sim *sim = make_sim(scene, &opt);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  assert_ok(msim_sim_step(sim, 20, err));
  msim_state s = state_of(sim);
  msim_csr A = {.size = sizeof A};
  double zero[3 * N] = {0};
  msim_sim_force(sim, s.x, zero, f);
  for (int i = 0; i < 3 * N; i++) b[i] = view.mass[i / 3] * s.v[i] + opt.h * f[i];
  assert_ok(msim_sim_matrix(sim, &A, err));
  double values[9 * 13 * N]; /* a particle has at most 12 neighbours */
  memcpy(values, A.val, (size_t)A.rowptr[A.n] * sizeof *values);
  assert_ok(msim_sim_step(sim, 1, err));
  memcpy(v, state_of(sim).v, sizeof v);
  for (int32_t r = 0; r < A.n; r++) {
    double right = b[3 * A.particle[r / 3] + r % 3], sum = right;
    for (int32_t e = A.rowptr[r]; e < A.rowptr[r + 1]; e++)
      sum -= values[e] * v[3 * A.particle[A.colind[e] / 3] + A.colind[e] % 3];
    norm_r += sum * sum, norm_b += right * right;
  }
  assert_close(sqrt(norm_r / norm_b), 0, 1.1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The matrix of a single spring between free particles is positive definite iff h^2 k (L/l - 1) <
 * m1 m2/(m1 + m2) = 1/2. On both sides of this limit the diagonal blocks are positive definite: the
 * solver has to examine the whole matrix. */
static void definiteness_ends_where_theory_says(void **state) {
  (void)state;
  for (int beyond = 0; beyond < 2; beyond++) {
    const double x[6] = {0, 0, 0, 0.5, 0, 0}, v[6] = {0, 1, 0, 0, -1, 0}, mass[2] = {1, 1};
    const double k = 1, rest = 1, h = sqrt(beyond ? 0.501 : 0.499);
    const int32_t ij[2] = {0, 1};
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
    msim_options opt = implicit(h);
    opt.indefinite = MSIM_INDEFINITE_STOP;
    opt.watch = MSIM_WATCH_OFF; /* near a singular matrix the step changes v by very much */
    msim_sim *sim = make_sim(scene, &opt);
    assert_int_equal(msim_sim_step(sim, 1, NULL), beyond ? MSIM_NOT_SPD : MSIM_OK);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Near that limit A turns v into v/c, c the curvature of A over that of M. Iterative solvers, which
 * may not notice where it is beyond, clamp A for c < 0.01; direct ones solve. */
static void nearly_singular_systems_are_clamped(void **state) {
  (void)state;
  for (int near = 0; near < 2; near++) {
    const double x[6] = {0, 0, 0, 0.5, 0, 0}, v[6] = {0, 1, 0, 0, -1, 0}, mass[2] = {1, 1};
    const double k = 1, rest = 1, c = near ? 0.008 : 0.012;
    const int32_t ij[2] = {0, 1};
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
    msim_options opt = implicit(sqrt((1 - c) / 2));
    opt.watch = MSIM_WATCH_OFF;
    msim_sim *sim = make_sim(scene, &opt);
    const int clamps = near && !direct;
    assert_ok(msim_sim_step(sim, 1, err));
    assert_int_equal(stats_of(sim).indefinite_steps, clamps);
    assert_close(state_of(sim).v[1], clamps ? 1 : 1 / c, 1e-6 / c);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void stop_reports_and_keeps_the_state(void **state) {
  (void)state;
  msim_scene *scene = column();
  msim_options opt = implicit(0.1);
  opt.indefinite = MSIM_INDEFINITE_STOP;
  msim_sim *sim = make_sim(scene, &opt);
  msim_error why;
  assert_int_equal(msim_sim_step(sim, 5, &why), MSIM_NOT_SPD);
  assert_non_null(strstr(why.text, "step 1, t = 0.1 s, particle 1:"));
  assert_non_null(strstr(why.text, "not positive definite"));
  assert_int_equal(state_of(sim).step, 0);
  assert_true(state_of(sim).x[4] == 1e-3 && state_of(sim).v[4] == 0);
  assert_int_equal(stats_of(sim).indefinite_steps, 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* If every step is indefinite, indefinite = clamp makes the same steps as jacobian = clamp. */
static void clamp_repeats_the_step_clamped(void **state) {
  (void)state;
  msim_scene *scene = compressed_triangle();
  msim_options opt = implicit(0.2);
  msim_sim *a = make_sim(scene, &opt);
  opt.jacobian = MSIM_JACOBIAN_CLAMP;
  msim_sim *b = make_sim(scene, &opt);
  assert_ok(msim_sim_step(a, 1, err));
  assert_ok(msim_sim_step(b, 1, err));
  assert_memory_equal(state_of(a).x, state_of(b).x, 9 * sizeof(double));
  assert_int_equal(stats_of(a).indefinite_steps, 1);
  assert_int_equal(stats_of(b).indefinite_steps, 0);
  assert_int_equal(stats_of(a).assemblies, 2);
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene);
}

static void indefinite_solve_needs_a_capable_solver(void **state) {
  (void)state;
  msim_scene *scene = compressed_triangle();
  msim_options opt = implicit(0.2);
  opt.indefinite = MSIM_INDEFINITE_SOLVE;
  msim_sim *sim;
  msim_error why;
  msim_status status = msim_sim_create(scene, &opt, &sim, &why);
  if (symmetric) {
    assert_int_equal(status, MSIM_OK);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_int_equal(stats_of(sim).indefinite_steps, 1);
    msim_sim_destroy(sim);
  } else {
    assert_int_equal(status, MSIM_ERR_ARG);
    assert_non_null(strstr(why.text, solver));
    assert_non_null(strstr(why.text, "' cannot solve"));
    assert_null(sim);
  }
  msim_scene_destroy(scene);
}

/* A free body has K u = 0 for a translation u: it falls like a particle, however stiff it is. */
static void a_free_solid_falls(void **state) {
  (void)state;
  enum { SIDE = 8, N = SIDE * SIDE * SIDE };
  const double g[3] = {0, 0, -9.81}, h = 0.033;
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {SIDE, SIDE, SIDE},
                                .extent = {0.3, 0.3, 0.3},
                                .mass = 1,
                                .k = 20000};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  msim_options opt = implicit(h);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  for (int i = 0; i < 3 * N; i++) assert_close(state_of(sim).v[i], 3 * h * g[i % 3], 1e-9);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Two particles on a spring of rest length 1 along x, 1.1 apart, that move along x at this
 * speed. */
static msim_scene *unequal_pair(double speed, double heavy, double light, double k) {
  const double x[6] = {0, 0, 0, 1.1, 0, 0}, v[6] = {speed, 0, 0, speed, 0, 0};
  const double mass[2] = {heavy, light}, rest = 1;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  return scene;
}

/* The tolerance is relative to the change of v in the step, not to v: neither speed nor a heavy
 * particle loosens it. The distance r obeys w' = (w - h q (r - 1))/(1 + h^2 q), r' = r + h w', q =
 * k/mu with the reduced mass mu. */
static void neither_speed_nor_mass_hides_a_spring(void **state) {
  (void)state;
  const double speeds[] = {0, 10, 1000}, masses[] = {1, 1e6};
  enum { STEPS = 50 };
  const double h = 1e-3, k = 100, light = 1e-3;
  for (int i = 0; i < 6; i++) {
    const double heavy = masses[i / 3], q = k / heavy + k / light;
    double r = 1.1, w = 0;
    for (int step = 0; step < STEPS; step++) {
      w = (w - h * q * (r - 1)) / (1 + h * h * q);
      r += h * w;
    }
    msim_scene *scene = unequal_pair(speeds[i % 3], heavy, light, k);
    msim_options opt = implicit(h);
    opt.solver_rtol = 1e-8;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, STEPS, err));
    assert_close(state_of(sim).x[3] - state_of(sim).x[0], r, 1e-8);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void gravity_acts_at_any_speed(void **state) {
  (void)state;
  const double g[3] = {0, 0, -9.81};
  msim_scene *scene = unequal_pair(1000, 1, 1, 1);
  assert_ok(msim_scene_set_gravity(scene, g, err));
  msim_options opt = implicit(1e-6);
  opt.solver_rtol = 1e-8;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1000, err));
  for (int i = 2; i < 6; i += 3) assert_close(state_of(sim).v[i] / (1e-3 * g[2]), 1, 1e-6);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* One of two bodies in a sim has a pinned particle; the other one keeps its momentum, however
 * coarse the tolerance is. */
static void momentum_is_kept_by_coarse_solves(void **state) {
  (void)state;
  enum { SIDE = 4, N = SIDE * SIDE * SIDE };
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {SIDE, SIDE, SIDE},
                                .extent = {0.3, 0.3, 0.3},
                                .mass = 1,
                                .k = 2000};
  const int32_t pin = N;
  double x[6 * N], v[6 * N];
  unsigned seed = 4;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  msim_options opt = implicit(1e-2);
  opt.solver_rtol = 1e-3;
  msim_sim *sim = make_sim(scene, &opt);
  memcpy(x, state_of(sim).x, sizeof x);
  double before[3] = {0}, after[3] = {0};
  for (int i = 0; i < 6 * N; i++) {
    v[i] = i / 3 == N ? 0 : 0.5 + uniform(&seed);
    if (i < 3 * N) before[i % 3] += v[i];
  }
  assert_ok(msim_sim_set_state(
      sim, &(msim_state){.size = sizeof(msim_state), .n = 2 * N, .x = x, .v = v}, err));
  assert_ok(msim_sim_step(sim, 200, err));
  for (int i = 0; i < 3 * N; i++) after[i % 3] += state_of(sim).v[i];
  for (int c = 0; c < 3; c++) assert_close(after[c] / before[c], 1, 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void a_tolerance_out_of_reach_is_rounding_level(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(10, 1000, 0);
  msim_options opt = implicit(1e-2);
  opt.solver_rtol = 1e-300;
  opt.solver_max_iterations = 100000;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void too_few_iterations_are_reported(void **state) {
  (void)state;
  if (direct) skip();
  msim_scene *scene = hanging_cloth(10, 1000, 0);
  msim_options opt = implicit(1e-2);
  opt.solver_max_iterations = 2;
  msim_sim *sim = make_sim(scene, &opt);
  msim_error why;
  assert_int_equal(msim_sim_step(sim, 2, &why), MSIM_NOT_CONVERGED);
  /* the first step is easy: the cloth is planar, and gravity is perpendicular to it */
  assert_non_null(strstr(why.text, "step 2, t = 0.02 s, particle "));
  char sentence[64];
  snprintf(sentence, sizeof sentence, "solver %s reached a relative residual of", solver);
  assert_non_null(strstr(why.text, sentence));
  assert_int_equal(state_of(sim).step, 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Without springs between unknowns A is diagonal, and no solver is called. */
static void no_springs_no_matrix(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 10);
  assert_ok(msim_scene_set_drag(scene, 3, err));
  msim_options opt = implicit(0.5);
  opt.solver = "klu"; /* no plugin is searched for */
  msim_sim *sim = make_sim(scene, &opt);
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(sim, &plan);
  assert_string_equal(plan.solver, "diagonal");
  assert_ok(msim_sim_step(sim, 1, err));
  assert_close(state_of(sim).v[0], 1 / (1 + 0.5 * 3), 1e-15);
  assert_close(state_of(sim).v[2], -10 * 0.5 / (1 + 0.5 * 3), 1e-15);
  const msim_stats s = stats_of(sim);
  assert_int_equal(s.factorizations + s.assemblies + s.solves + s.force_evaluations, 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Particles without springs, in three components and in two, with drag or without, over a plane:
 * the general code with pcg gives the same motion as the code without a matrix. */
static void no_springs_no_difference(void **state) {
  (void)state;
  for (int i = 0; i < 4; i++) {
    const double drag = i % 2 ? 0.3 : 0, y = i / 2 ? 0.2 : 0;
    const double x[6] = {0, 0, 0.5, 1, 0, 0.7}, v[6] = {1, y, 0.1, 0.5, 0, -1};
    const double mass[2] = {0.5, 2};
    msim_scene *scene = make_single_particle(x, v, 10);
    assert_ok(msim_scene_add_particles(scene, 1, x + 3, v + 3, mass + 1, err));
    assert_ok(msim_scene_set_drag(scene, drag, err));
    plane(scene, 0, 0, 1, 0, 0.7, 0.1);
    msim_options opt = implicit(0.02);
    msim_sim *lean = make_sim(scene, &opt);
    opt.solver = "pcg", opt.solver_rtol = 1e-14;
    assert_ok(msim_options_set(&opt, "skip.springs", "off", err));
    msim_sim *general = make_sim(scene, &opt);
    assert_ok(msim_sim_step(lean, 100, err));
    assert_ok(msim_sim_step(general, 100, err));
    assert_int_equal(stats_of(general).solves, 100);
    const msim_state a = state_of(lean), b = state_of(general);
    for (int q = 0; q < 6; q++) {
      assert_close(a.x[q], b.x[q], 1e-12);
      assert_close(a.v[q], b.v[q], 1e-12);
    }
    assert_true(stats_of(lean).contacts > 0);
    assert_int_equal(stats_of(lean).contacts, stats_of(general).contacts);
    msim_sim_destroy(lean), msim_sim_destroy(general);
    msim_scene_destroy(scene);
  }
}

static void all_pinned_is_an_empty_system(void **state) {
  (void)state;
  msim_scene *scene = column();
  const int32_t middle = 1;
  assert_ok(msim_scene_pin(scene, 1, &middle, err));
  msim_options opt = implicit(0.1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  assert_true(state_of(sim).x[4] == 1e-3);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void analyses_once_factors_when_values_are_new(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(8, 100, 0);
  msim_options opt = implicit(1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 7, err));
  msim_stats s = stats_of(sim);
  assert_int_equal(s.assemblies, 7);
  assert_int_equal(s.solves, 7);
  assert_int_equal(s.analyses, direct || strcmp(solver, "petsc") == 0); /* with a matrix */
  assert_int_equal(s.factorizations, direct ? 7 : 0);
  assert_true(direct ? s.iterations == 0 : s.iterations > 7);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A hanging cloth of 32 x 32, k = 1000, h = 1e-3, 100 steps: this solver and pcg agree to 1e-9
 * m. */
static void agrees_with_conjugate_gradients(void **state) {
  (void)state;
  enum { SIDE = 32 };
  msim_scene *scene = hanging_cloth(SIDE, 1000, 0);
  msim_options opt = implicit(1e-3);
  msim_sim *a = make_sim(scene, &opt);
  opt.solver = "pcg";
  msim_sim *b = make_sim(scene, &opt);
  assert_ok(msim_sim_step(a, 100, err));
  assert_ok(msim_sim_step(b, 100, err));
  msim_state sa = state_of(a), sb = state_of(b);
  double worst = 0;
  for (int i = 0; i < 3 * SIDE * SIDE; i++) worst = fmax(worst, fabs(sa.x[i] - sb.x[i]));
  print_message("  %s and pcg differ by %.3g m\n", solver, worst);
  assert_true(worst <= 1e-9);
  assert_true(sa.x[3 * SIDE * SIDE / 2 + 2] < -0.01);
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene);
}

int main(int argc, char **argv) {
  if (argc > 1) solver = argv[1];
  if (!is_solver_available(solver)) return missing_status(solver);
  direct = !(solver_flags(solver) & MSIM_BACKEND_ITERATIVE);
  symmetric = (solver_flags(solver) & MSIM_BACKEND_SYMMETRIC) != 0;
  const struct CMUnitTest tests[] = {cmocka_unit_test(answer_solves_the_system),
                                     cmocka_unit_test(definiteness_ends_where_theory_says),
                                     cmocka_unit_test(nearly_singular_systems_are_clamped),
                                     cmocka_unit_test(stop_reports_and_keeps_the_state),
                                     cmocka_unit_test(clamp_repeats_the_step_clamped),
                                     cmocka_unit_test(indefinite_solve_needs_a_capable_solver),
                                     cmocka_unit_test(a_free_solid_falls),
                                     cmocka_unit_test(neither_speed_nor_mass_hides_a_spring),
                                     cmocka_unit_test(gravity_acts_at_any_speed),
                                     cmocka_unit_test(momentum_is_kept_by_coarse_solves),
                                     cmocka_unit_test(a_tolerance_out_of_reach_is_rounding_level),
                                     cmocka_unit_test(too_few_iterations_are_reported),
                                     cmocka_unit_test(no_springs_no_matrix),
                                     cmocka_unit_test(no_springs_no_difference),
                                     cmocka_unit_test(all_pinned_is_an_empty_system),
                                     cmocka_unit_test(analyses_once_factors_when_values_are_new),
                                     cmocka_unit_test(agrees_with_conjugate_gradients)};
  return cmocka_run_group_tests_name("solver", tests, NULL, NULL);
}
