/* Tests of nonlinear implicit steps: accuracy of Newton's method, failures, conserved quantities
 * and damping. */
#include <math.h>
#include <string.h>

#include "scenes.h"
#include "sim/island_step.h"

static const char *const methods[] = {
    "implicit-euler", "implicit-midpoint", "trapezoidal", "newmark", "bdf2", "tr-bdf2", "sdirk2"};
enum { NMETHODS = sizeof methods / sizeof *methods, SIDE = 8, N = SIDE * SIDE };

static msim_sim *sim_of(const msim_scene *scene, const char *method, double h, double rtol) {
  msim_options opt = options(method, h);
  opt.solver = "pcg";
  opt.newton_rtol = rtol, opt.solver_rtol = 1e-14;
  return make_sim(scene, &opt);
}

/* ||a - b||, or ||a|| if b is NULL; all particles of the cloth have the same mass */
static double distance(const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < 3 * N; i++) sum += (a[i] - (b ? b[i] : 0)) * (a[i] - (b ? b[i] : 0));
  return sqrt(sum);
}

/* A step from the same state with a looser newton.rtol: the distance of its velocity from the
 * solution is at most that share of the change in the step. */
static void steps_are_solved_as_well_as_asked(void **state) {
  (void)state;
  static const double asked[] = {1e-3, 1e-6, 1e-9, 1e-12};
  for (int damped = 0; damped < 2; damped++)
    for (int m = 0; m < NMETHODS; m++) {
      msim_scene *scene = hanging_cloth(SIDE, 1e4, damped ? 1 : 0);
      msim_sim *exact = sim_of(scene, methods[m], 0.02, 1e-13);
      assert_ok(msim_sim_step(exact, 10, err));
      const msim_state s = state_of(exact);
      double x[3 * N], v[3 * N];
      memcpy(x, s.x, sizeof x), memcpy(v, s.v, sizeof v);
      const msim_state start = {.size = sizeof start, .n = N, .x = x, .v = v};
      assert_ok(msim_sim_set_state(exact, &start, err));
      assert_ok(msim_sim_step(exact, 1, err));
      for (size_t i = 0; i < sizeof asked / sizeof *asked; i++) {
        msim_sim *sim = sim_of(scene, methods[m], 0.02, asked[i]);
        assert_ok(msim_sim_set_state(sim, &start, err));
        assert_ok(msim_sim_step(sim, 1, err));
        const double *want = state_of(exact).v;
        const double error = distance(state_of(sim).v, want) / distance(want, v);
        if (!(error <= asked[i]))
          fail_msg("%s%s: error %.3g, asked for %.3g", methods[m], damped ? ", damped" : "", error,
                   asked[i]);
        msim_sim_destroy(sim);
      }
      msim_sim_destroy(exact);
      msim_scene_destroy(scene);
    }
}

/* However short a step is, its v' - v - h a is no more than the rounding of v and O(h^2), though
 * the guess for a body that mostly rotates is off by the rounding of x over h, up to 0.1 m/s. */
static void short_steps_are_solved_to_rounding(void **state) {
  (void)state;
  enum { BODY = 6, PAIRS = BODY * (BODY - 1) / 2 };
  double x[3 * BODY], v[3 * BODY], mass[BODY], k[PAIRS], rest[PAIRS];
  int32_t ij[2 * PAIRS], n = 0;
  for (int i = 0; i < 3 * BODY; i++) x[i] = sin(7 * i);
  for (int i = 0; i < BODY; i++) mass[i] = 1 + 0.3 * i;
  for (int i = 0; i < BODY; i++) {
    const double *at = x + 3 * i;
    v[3 * i] = 0.3 * cos(i) - 2 * at[2] - 3 * at[1];
    v[3 * i + 1] = 3 * at[0] - at[2];
    v[3 * i + 2] = at[1] + 2 * at[0];
  }
  for (int32_t i = 0; i < BODY; i++)
    for (int32_t j = 0; j < i; j++, n++) {
      ij[2 * n] = i, ij[2 * n + 1] = j;
      k[n] = 10 + 10 * n, rest[n] = 1;
    }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, BODY, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, PAIRS, ij, k, rest, NULL, err));
  for (double h = 1e-8; h > 1e-15; h /= 100)
    for (int m = 0; m < NMETHODS; m++) {
      msim_options opt[] = {options(methods[m], h), options("rk4", h)};
      opt[0].solver = "pcg";
      msim_sim *sim[] = {make_sim(scene, &opt[0]), make_sim(scene, &opt[1])};
      for (int i = 0; i < 2; i++) assert_ok(msim_sim_step(sim[i], 1, err));
      for (int i = 0; i < 3 * BODY; i++)
        assert_close(state_of(sim[0]).v[i], state_of(sim[1]).v[i], 4e-15 + 1e6 * h * h);
      for (int i = 0; i < 2; i++) msim_sim_destroy(sim[i]);
    }
  msim_scene_destroy(scene);
}

/* A step that does not converge leaves the state unchanged, and the message states what was
 * reached. */
static void what_does_not_converge_is_said(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1e4, 0);
  for (int m = 0; m < NMETHODS; m++) {
    msim_options opt = options(methods[m], 0.05);
    opt.newton_max_iterations = 1, opt.newton_retries = 0;
    msim_sim *sim = make_sim(scene, &opt);
    double x[3 * N], v[3 * N];
    memcpy(x, state_of(sim).x, sizeof x), memcpy(v, state_of(sim).v, sizeof v);
    msim_error why;
    assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_CONVERGED);
    assert_non_null(strstr(why.text, "step 1, t = 0.05 s, particle "));
    assert_non_null(strstr(why.text, "newton.rtol requires 1e-08"));
    assert_memory_equal(state_of(sim).x, x, sizeof x);
    assert_memory_equal(state_of(sim).v, v, sizeof v);
    assert_int_equal(state_of(sim).step, 0);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* From random positions, inverted and crumpled: with the clamped matrix and the line search
 * Newton's method converges, with any solver. */
static void a_crumpled_start_is_solved(void **state) {
  (void)state;
  static const double steps[] = {1e-4, 1e-3, 0.02};
  static const char *const solvers[] = {"pcg", "cholmod"};
  msim_scene *scene = hanging_cloth(SIDE, 1e5, 0);
  double x[3 * N], v[3 * N] = {0};
  unsigned seed = 5;
  for (int i = 0; i < 5; i++) { /* long steps are too difficult for cholmod */
    msim_options opt = options("implicit-euler", steps[i % 3]);
    opt.solver = solvers[i / 3], opt.solver_rtol = 1e-14;
    if (!is_solver_available(opt.solver)) continue;
    msim_sim *sim = make_sim(scene, &opt);
    const msim_state s = state_of(sim);
    for (int q = 0; q < 3 * N; q++) x[q] = s.x[q] + uniform(&seed) - 0.5;
    msim_scene_view view = {.size = sizeof view};
    msim_scene_get(scene, &view);
    for (int q = 0; q < 3 * N; q++)
      if (view.pinned[q / 3]) x[q] = view.x[q];
    assert_ok(
        msim_sim_set_state(sim, &(msim_state){.size = sizeof s, .n = N, .x = x, .v = v}, err));
    msim_energy before = {.size = sizeof before}, after = {.size = sizeof after};
    msim_sim_energy(sim, &before);
    assert_ok(msim_sim_step(sim, 20, err));
    msim_sim_energy(sim, &after);
    assert_true(after.total < before.total);
    assert_true(stats_of(sim).newton_iterations < 20 * 60);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* A falling cloth buckles: every step is made whole, in few iterations. */
static void cloth_that_buckles_is_solved(void **state) {
  (void)state;
  static const struct {
    int32_t side;
    double k, rtol;
    int64_t most; /* iterations of Newton's method in 60 steps */
  } cases[] = {{32, 1e3, 1e-2, 420},
               {32, 1e3, 1e-4, 520},
               {32, 1e3, 1e-8, 540},
               {32, 1e5, 1e-4, 1000},
               {64, 1e3, 1e-4, 780}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    msim_scene *scene = hanging_cloth(cases[i].side, cases[i].k, 0);
    msim_options opt = options("implicit-euler", 1. / 60);
    opt.solver = "pcg", opt.newton_rtol = cases[i].rtol;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 60, err));
    assert_int_equal(stats_of(sim).rejected_steps, 0);
    assert_in_range(stats_of(sim).newton_iterations, 60, cases[i].most);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A method that fails in its call of that number */
static struct {
  const ms_integrator *real;
  int calls, fails_at;
} failing;

static msim_status failing_step(ms_stepper *s, msim_error *err) {
  if (++failing.calls == failing.fails_at) return ms_error_set(err, MSIM_NOT_CONVERGED, "by order");
  return failing.real->step(s, err);
}

static void make_part_fail(msim_sim *sim, ms_integrator *method, int fails_at) {
  *method = *(failing.real = sim->config.integrator);
  method->step = failing_step;
  failing.calls = 0, failing.fails_at = fails_at;
  sim->config.integrator = method;
}

/* The second half of a step fails, and with it the step. The method state of the step before was
 * replaced in the first half: the next step is that of a new sim from the state, which is
 * unchanged. */
static void a_part_that_fails_leaves_nothing(void **state) {
  (void)state;
  for (int m = 0; m < NMETHODS; m++) {
    msim_scene *scene = hanging_cloth(SIDE, 100, 0);
    msim_sim *sim = sim_of(scene, methods[m], 0.01, 1e-10);
    msim_sim *fresh = sim_of(scene, methods[m], 0.01, 1e-10);
    double x[3 * N], v[3 * N];
    ms_integrator method;
    assert_ok(msim_sim_step(sim, 4, err));
    memcpy(x, state_of(sim).x, sizeof x), memcpy(v, state_of(sim).v, sizeof v);
    make_part_fail(sim, &method, 2);
    ms_stepper *s = &sim->islands->stepper;
    assert_int_equal(ms_island_step_make_substeps(sim, sim->config.integrator, s, 2, NULL),
                     MSIM_NOT_CONVERGED);
    assert_memory_equal(state_of(sim).x, x, sizeof x);
    const msim_state start = {
        .size = sizeof start, .step = 4, .t = state_of(sim).t, .n = N, .x = x, .v = v};
    assert_ok(msim_sim_set_state(fresh, &start, err));
    assert_ok(msim_sim_step(sim, 3, err));
    assert_ok(msim_sim_step(fresh, 3, err));
    assert_memory_equal(state_of(sim).x, state_of(fresh).x, sizeof x);
    assert_memory_equal(state_of(sim).v, state_of(fresh).v, sizeof v);
    msim_sim_destroy(sim), msim_sim_destroy(fresh);
    msim_scene_destroy(scene);
  }
}

/* Two masses on a rotating spring: the midpoint rule conserves their angular momentum, implicit
 * Euler does not. */
static double angular_momentum_ratio(const char *method) {
  const double x[6] = {-0.5, 0, 0, 0.5, 0, 0}, v[6] = {0, -1, 0.3, 0, 1, -0.3}, mass[2] = {1, 2};
  const int32_t ij[2] = {0, 1};
  const double k = 1000, rest = 0.9, c = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &c, err));
  msim_sim *sim = sim_of(scene, method, 0.02, 1e-13);
  msim_energy before = {.size = sizeof before}, after = {.size = sizeof after};
  msim_sim_energy(sim, &before);
  assert_ok(msim_sim_step(sim, 200, err));
  msim_sim_energy(sim, &after);
  for (int i = 0; i < 3; i++) assert_close(after.momentum[i], before.momentum[i], 1e-11);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return after.angular_momentum[2] / before.angular_momentum[2];
}

static void the_midpoint_rule_keeps_angular_momentum(void **state) {
  (void)state;
  assert_close(angular_momentum_ratio("implicit-midpoint"), 1, 1e-10);
  assert_true(angular_momentum_ratio("implicit-euler") < 0.9);
}

/* With a carried over between steps, Newmark's method equals the trapezoidal rule. */
static void newmark_is_the_trapezoidal_rule(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1e3, 0);
  msim_sim *a = sim_of(scene, "newmark", 0.01, 1e-13),
           *b = sim_of(scene, "trapezoidal", 0.01, 1e-13);
  assert_ok(msim_sim_step(a, 30, err));
  assert_ok(msim_sim_step(b, 30, err));
  assert_close(distance(state_of(a).x, state_of(b).x), 0, 1e-10);
  assert_int_equal(stats_of(a).force_evaluations < stats_of(b).force_evaluations, 1);
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene);
}

/* The velocities of a randomly thrown free block that also moves at this speed; returns the number
 * of Newton iterations. */
static int64_t throw_block(const char *method, double speed, double v[81]) {
  const msim_lattice lattice = {
      .size = sizeof lattice, .n = {3, 3, 3}, .extent = {1, 1, 1}, .mass = 1, .k = 2000};
  const double g[3] = {0, 0, -9.81};
  double start[81], x[81];
  unsigned seed = 9;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  msim_options opt = options(method, 2e-3);
  msim_sim *sim = make_sim(scene, &opt);
  memcpy(x, state_of(sim).x, sizeof x);
  for (int i = 0; i < 81; i++) start[i] = uniform(&seed) + (i % 3 == 0 ? speed : 0);
  const msim_state thrown = {.size = sizeof thrown, .n = 27, .x = x, .v = start};
  assert_ok(msim_sim_set_state(sim, &thrown, err));
  assert_ok(msim_sim_step(sim, 10, err));
  for (int i = 0; i < 81; i++) v[i] = state_of(sim).v[i] - (i % 3 == 0 ? speed : 0);
  const int64_t iterations = stats_of(sim).newton_iterations;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return iterations;
}

/* Errors are relative to the change of v: a common velocity loosens no step. */
static void speed_does_not_matter(void **state) {
  (void)state;
  for (int m = 0; m < NMETHODS; m++) {
    double slow[81], fast[81];
    const int64_t iterations = throw_block(methods[m], 0, slow);
    assert_in_range(throw_block(methods[m], 1000, fast), iterations - 1, iterations + 1);
    for (int i = 0; i < 81; i++) assert_close(fast[i], slow[i], 1e-10);
  }
}

/* Two masses at distance 1, on a spring of this rest length */
static msim_scene *pair(double rest) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, v[6] = {0}, mass[2] = {1, 1}, k = 10, c = 0;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &c, err));
  return scene;
}

/* Linear forces take one correction per stage; if nothing moves, nothing is solved. */
static void nothing_is_solved_that_needs_no_solving(void **state) {
  (void)state;
  for (int m = 0; m < 2 * NMETHODS; m++) {
    const char *method = methods[m / 2];
    const int stages = strcmp(method, "tr-bdf2") == 0 || strcmp(method, "sdirk2") == 0;
    msim_scene *moving = pair(0), *resting = pair(1);
    assert_ok(msim_scene_set_drag(moving, m % 2 ? 30 : 0, err));
    msim_sim *a = sim_of(moving, method, 0.1, 1e-8), *b = sim_of(resting, method, 0.1, 1e-8);
    assert_ok(msim_sim_step(a, 3, err));
    assert_ok(msim_sim_step(b, 3, err));
    assert_int_equal(stats_of(a).newton_iterations, 3 * (1 + stages));
    assert_int_equal(stats_of(b).newton_iterations, 0);
    msim_sim_destroy(a), msim_sim_destroy(b);
    msim_scene_destroy(moving), msim_scene_destroy(resting);
  }
}

/* Damping and drag are refused, by name, in the scene and in later changes. */
static void rkn6_refuses_velocity_dependent_forces(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 100, 0.1), *good = hanging_cloth(SIDE, 100, 0);
  const msim_options opt = options("rkn6", 0.01);
  msim_sim *sim;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text,
                      "integrator 'rkn6' requires forces that depend on positions only, but spring "
                      "0 is damped; use dop853, rk4 or velocity-verlet");
  sim = make_sim(good, &opt);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  assert_int_equal(msim_sim_set_springs(sim, NULL, NULL, view.damping, &why), MSIM_ERR_ARG);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_int_equal(stats_of(sim).force_evaluations, 12);
  assert_ok(msim_sim_step(sim, 9, err));
  assert_int_equal(stats_of(sim).force_evaluations, 1 + 10 * 11);
  assert_ok(msim_scene_set_drag(good, 0.1, err));
  msim_sim_destroy(sim);
  assert_int_equal(msim_sim_create(good, &opt, &sim, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text,
                      "integrator 'rkn6' requires forces that depend on positions only, but drag "
                      "is set; use dop853, rk4 or velocity-verlet");
  msim_scene_destroy(scene), msim_scene_destroy(good);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(steps_are_solved_as_well_as_asked),
                                     cmocka_unit_test(short_steps_are_solved_to_rounding),
                                     cmocka_unit_test(what_does_not_converge_is_said),
                                     cmocka_unit_test(a_crumpled_start_is_solved),
                                     cmocka_unit_test(cloth_that_buckles_is_solved),
                                     cmocka_unit_test(a_part_that_fails_leaves_nothing),
                                     cmocka_unit_test(the_midpoint_rule_keeps_angular_momentum),
                                     cmocka_unit_test(speed_does_not_matter),
                                     cmocka_unit_test(newmark_is_the_trapezoidal_rule),
                                     cmocka_unit_test(nothing_is_solved_that_needs_no_solving),
                                     cmocka_unit_test(rkn6_refuses_velocity_dependent_forces)};
  return cmocka_run_group_tests_name("newton", tests, NULL, NULL);
}
