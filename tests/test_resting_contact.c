/* Tests of resting contact on planes with stiff springs, for implicit methods with collision =
 * event: stability, cost of the solvers, friction. */
#include <math.h>

#include "event_options.h"

/* A mass on a light foot, joined by a spring that oscillates many times per step. The oscillation
 * must not grow, for any slope of the plane and any solver. */
static void a_mass_on_a_stiff_spring_stays_at_rest(void **state) {
  (void)state;
  static const char *const methods[] = {"linearly-implicit-euler",
                                        "implicit-euler",
                                        "implicit-midpoint",
                                        "trapezoidal",
                                        "newmark",
                                        "bdf2",
                                        "tr-bdf2",
                                        "sdirk2"};
  static const char *const solvers[] = {"pcg", "cholmod", "klu"};
  const double u[2][3] = {{0, 0, 1}, {0.48, 0.64, 0.6}}, mass[2] = {0.01, 1}, k = 1e4, rest = 1;
  const double sunk = 10 / k, none = 0;
  const int32_t ij[2] = {0, 1};
  for (int m = 0; m < 8; m++)
    for (int i = 0; i < 6; i++) {
      const double *n = u[i / 3], length = rest - 1.001 * sunk;
      const double x[6] = {0, 0, 0, length * n[0], length * n[1], length * n[2]};
      const double g[3] = {-10 * n[0], -10 * n[1], -10 * n[2]};
      msim_scene *scene;
      if (!is_solver_available(solvers[i % 3])) continue;
      assert_ok(msim_scene_create(NULL, &scene, err));
      assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
      assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &none, err));
      assert_ok(msim_scene_set_gravity(scene, g, err));
      plane(scene, n[0], n[1], n[2], 0, 0.5, 0.3);
      msim_options opt = event_options(methods[m], 0.05);
      opt.solver = solvers[i % 3], opt.newton_rtol = 1e-10;
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 100, err)); /* before it tips over */
      const double *at = state_of(sim).x;
      for (int c = 0; c < 3; c++) {
        assert_close(at[c], 0, 1e-15);
        assert_close(at[3 + c], (rest - sunk) * n[c], 0.01 * sunk);
      }
      assert_int_equal(stats_of(sim).contacts, 0);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* An elastic cube that stands on the ground */
static msim_scene *jelly(void) {
  const double gravity[3] = {0, 0, -9.81};
  const msim_lattice block = {
      .size = sizeof block, .n = {6, 6, 6}, .extent = {0.3, 0.3, 0.3}, .mass = 1, .k = 3000};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  plane(scene, 0, 0, 1, 0, 0.3, 0.5);
  return scene;
}

static msim_stats run(const msim_scene *scene, const char *method, const char *solver,
                      int64_t steps) {
  msim_options opt = event_options(method, 1.0 / 60);
  opt.solver = solver, opt.solver_rtol = opt.newton_rtol = 1e-8;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  const msim_stats s = stats_of(sim);
  msim_sim_destroy(sim);
  assert_true(s.coarse_factors > 0); /* otherwise the coarse space is not tested */
  return s;
}

/* A constrained unknown has a large diagonal entry in the matrix. The modes of the coarse space are
 * 0 there; otherwise its corrections would move that unknown, at the cost of 20 times as many
 * iterations. */
static void constraints_cost_no_iterations(void **state) {
  (void)state;
  msim_scene *scene = jelly();
  const msim_stats s = run(scene, "implicit-euler", "pcg", 20);
  assert_true(s.newton_iterations < 6 * s.steps);
  assert_true(s.iterations < 30 * s.newton_iterations);
  msim_scene_destroy(scene);
}

/* While the set of constrained unknowns is the same, the coarse factor is computed once, and so is
 * a factorization used as a preconditioner. */
static void resting_bodies_reuse_their_factorizations(void **state) {
  (void)state;
  static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler", "tr-bdf2"};
  msim_scene *scene = jelly();
  for (int m = 0; m < 3; m++) {
    const msim_stats s = run(scene, methods[m], "pcg", 30);
    assert_int_equal(s.coarse_factors, 1);
    assert_int_equal(s.kept_factors, s.solves - 1);
  }
  if (is_solver_available("cholmod")) {
    const msim_stats s = run(scene, methods[0], "auto", 60);
    assert_int_equal(s.factorizations, 1);
    assert_true(s.iterations < 20 * s.solves);
  }
  msim_scene_destroy(scene);
}

/* A particle without springs belongs to no aggregate, and may be constrained all the same. */
static void single_particles_are_constrained_too(void **state) {
  (void)state;
  const double x[3] = {5, 0, 0}, mass = 1;
  msim_scene *scene = jelly();
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  const msim_stats s = run(scene, "linearly-implicit-euler", "pcg", 10);
  assert_int_equal(s.coarse_factors, 1);
  msim_scene_destroy(scene);
}

/* A particle next to the cube falls from 1 cm and lands in the third step, without a bounce. From
 * then on one more unknown is constrained, and the coarse factor is computed anew once, by a linear
 * method in the fourth step, as all solves of a step share one. With 8 kg neither the inverses of
 * the diagonal blocks nor their scale would require that. */
static void a_coarse_factor_belongs_to_a_constraint_set(void **state) {
  (void)state;
  static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler"};
  const double x[3] = {5, 0, 0.01}, mass = 8;
  msim_scene *scene = jelly();
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  for (int m = 0; m < 2; m++) {
    assert_int_equal(run(scene, methods[m], "pcg", 2).coarse_factors, 1);
    assert_int_equal(run(scene, methods[m], "pcg", 3).coarse_factors, 1 + m);
    assert_int_equal(run(scene, methods[m], "pcg", 4).coarse_factors, 2);
    assert_int_equal(run(scene, methods[m], "pcg", 30).coarse_factors, 2);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- friction -------------------------------------------------*/

/* Masses of 1 kg, at rest, and of 1000 kg, at speed v, 1 m apart on a rough floor, joined by a
 * spring that oscillates several times per step. */
static const double MU = 0.3, G = 10, STIFF = 6400, STEP = 0.05, pulled_mass[2] = {1, 1000};

static msim_sim *pulled(const char *method, double v) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, vs[6] = {0, 0, 0, v}, rest = 1, g[3] = {0, 0, -G};
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, vs, pulled_mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &STIFF, &rest, NULL, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 0, MU);
  msim_options opt = event_options(method, STEP);
  opt.solver = "pcg";
  msim_sim *sim = make_sim(scene, &opt);
  msim_scene_destroy(scene);
  return sim;
}

static const char *const backward[] = {"implicit-euler", "linearly-implicit-euler"};

/* The force of the spring exceeds the friction limit only during the step: the mass that stuck
 * begins to slip. For both masses m (v' - v)/h = force of the spring at the end -+ mu m g, up to a
 * tenth, by which friction may lag. */
static void slipping_obeys_coulombs_law(void **state) {
  (void)state;
  for (int m = 0; m < 2; m++) {
    msim_sim *sim = pulled(backward[m], 1);
    assert_ok(msim_sim_step(sim, 1, err));
    const msim_state s = state_of(sim);
    const double pull = STIFF * (s.x[3] - s.x[0] - 1), v[2] = {0, 1};
    assert_true(s.v[0] > 0 && s.v[3] > 0);
    for (int p = 0; p < 2; p++) {
      const double force = pulled_mass[p] * (s.v[3 * p] - v[p]) / STEP;
      const double friction = (p ? -pull : pull) - force, expected = MU * pulled_mass[p] * G;
      assert_close(friction, expected, 0.1 * expected);
    }
    assert_int_equal(stats_of(sim).contacts, 0);
    msim_sim_destroy(sim);
  }
}

/* Friction can stop the heavy mass in a seventh of the step. It then stays at rest exactly. */
static void a_mass_that_stops_in_a_step_sticks(void **state) {
  (void)state;
  for (int m = 0; m < 2; m++) {
    msim_sim *sim = pulled(backward[m], STEP * MU * G / 7);
    for (int i = 0; i < 3; i++) {
      assert_ok(msim_sim_step(sim, 1, err));
      const msim_state s = state_of(sim);
      for (int c = 0; c < 6; c++) assert_true(s.v[c] == 0 && s.x[c] == (c == 3));
    }
    msim_sim_destroy(sim);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_mass_on_a_stiff_spring_stays_at_rest),
                                     cmocka_unit_test(constraints_cost_no_iterations),
                                     cmocka_unit_test(resting_bodies_reuse_their_factorizations),
                                     cmocka_unit_test(single_particles_are_constrained_too),
                                     cmocka_unit_test(a_coarse_factor_belongs_to_a_constraint_set),
                                     cmocka_unit_test(slipping_obeys_coulombs_law),
                                     cmocka_unit_test(a_mass_that_stops_in_a_step_sticks)};
  return cmocka_run_group_tests_name("resting_contact", tests, NULL, NULL);
}
