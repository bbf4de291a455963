/* Tests of stiff bodies on colliders at long steps of implicit methods: energy does not grow,
 * nothing ends in a collider, and a step takes few solves. */
#include <math.h>

#include "checkpoints.h"
#include "event_options.h"
#include "moving_colliders.h"
#include "stiff_bodies.h"

enum { STEPS = 90 };

static void expect_outside(int i, msim_sim *sim) {
  const msim_state s = state_of(sim);
  for (int32_t p = 0; p < s.n; p++)
    if (!(distance_from(i, s.x + 3 * p) >= -1e-11)) fail_msg("scene %d: inside", i);
}

/* Solves for a step of this method, on average. */
static double run_stiff_body(int i, const char *method, int32_t collision, double k, double e,
                             double mu) {
  msim_scene *scene = stiff_body(i, k, e, mu);
  msim_options opt = event_options(method, 1.0 / 60);
  opt.collision = collision;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energies_of(sim).total;
  for (int step = 0; step < STEPS; step++) {
    assert_ok(msim_sim_step(sim, 1, err));
    expect_outside(i, sim);
    const double now = energies_of(sim).total;
    if (!(now <= start + 1e-9)) fail_msg("%s, scene %d: %g J, from %g J", method, i, now, start);
  }
  const msim_stats s = stats_of(sim);
  assert_true(s.contacts > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return (double)s.solves / STEPS;
}

/* Two rough solves and an accurate one are enough for most steps; impacts of stiff bodies take
 * substeps. */
static void energy_does_not_grow_in_few_solves(void **state) {
  (void)state;
  static const double stiffness[] = {300, 3000, 30000}, most[] = {4.5, 6, 10};
  for (int i = 0; i < SCENES; i++)
    for (int n = 0; n < 12; n++) {
      const double solves = run_stiff_body(i, "linearly-implicit-euler", MSIM_COLLISION_EVENT,
                                           stiffness[n / 4], 0.5 * (n % 2), 0.5 * (n / 2 % 2));
      if (!(solves <= most[n / 4]))
        fail_msg("scene %d, k %g: %g solves", i, stiffness[n / 4], solves);
    }
}

static void nonlinear_methods_keep_the_bound_too(void **state) {
  (void)state;
  static const char *const methods[] = {"implicit-euler", "tr-bdf2", "bdf2"};
  for (int i = 0; i < SCENES; i++)
    for (int collision = 0; collision < 2; collision++)
      run_stiff_body(i, methods[i % 3], collision, 3000, 0.5 * (i % 2), 0.3);
}

/* Counts of steps number `begin` to STEPS, h = 1/60 s, of a jelly that lies on top of a sphere, or
 * falls onto a plane with friction mu along which gravity pulls it */
static msim_stats count_steps_of_jelly(int on_sphere, double k, double mu, double rtol, int begin) {
  const msim_lattice jelly = {.size = sizeof jelly,
                              .n = {4, 4, 4},
                              .origin = {-0.19, -0.2, on_sphere ? 1e-3 : 0.2},
                              .extent = {0.4, 0.4, 0.4},
                              .mass = 1,
                              .k = k};
  const msim_plane floor = {.normal = {0, 0, 1}, .friction = mu};
  const double slope[3] = {4, 0.5, -9.81};
  msim_scene *scene = new_scene();
  assert_ok(msim_scene_add_lattice(scene, &jelly, err));
  if (on_sphere) add(scene, sphere(0, 0, -1, 1, 0, mu), 0);
  else assert_ok(msim_scene_add_plane(scene, &floor, err));
  if (!on_sphere) assert_ok(msim_scene_set_gravity(scene, slope, err));
  msim_options opt = options("implicit-euler", 1.0 / 60);
  opt.collision = MSIM_COLLISION_EVENT, opt.newton_rtol = rtol;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, begin, err));
  const msim_stats before = stats_of(sim);
  assert_ok(msim_sim_step(sim, STEPS - begin, err));
  msim_stats s = stats_of(sim);
  assert_true(s.contacts > 0);
  s.newton_iterations -= before.newton_iterations, s.solves -= before.solves;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return s;
}

/* A step of implicit Euler whose contacts are predicted to change is solved once, not first with
 * the contacts that there were. Such steps take about 3 iterations, as the jelly hardly moves, and
 * twice as many if they are made in vain before. */
static void steps_with_predicted_changes_are_solved_once(void **state) {
  (void)state;
  const struct {
    int on_sphere;
    double k, mu;
    int64_t most; /* iterations in a step */
  } of[] = {{1, 3000, 0.4, 4}, {0, 300, 0.8, 4}, {0, 1e5, 0.8, 3}};
  for (int i = 0; i < 3; i++) {
    const msim_stats s = count_steps_of_jelly(of[i].on_sphere, of[i].k, of[i].mu, 1e-8, 0);
    if (!(s.newton_iterations <= of[i].most * STEPS))
      fail_msg("jelly %d: %d iterations", i, (int)s.newton_iterations);
  }
}

/* A column tips over on a sphere to which it sticks. Errors of implicit Euler add energy there, but
 * the law of impacts that does no work would prescribe the same: the step is not made again, for
 * which 7 iterations were needed instead of 4.6. */
static void laws_that_agree_are_not_tried_in_turn(void **state) {
  (void)state;
  const msim_lattice column = {.size = sizeof column,
                               .n = {2, 2, 4},
                               .origin = {0, 0, 1e-3},
                               .extent = {0.1, 0.12, 0.3},
                               .mass = 1,
                               .k = 1000};
  const double slope[3] = {2, 0.5, -9.6};
  msim_scene *scene = new_scene();
  assert_ok(msim_scene_add_lattice(scene, &column, err));
  add(scene, sphere(0.05, 0.06, -1, 1, 1, 1), 0);
  assert_ok(msim_scene_set_gravity(scene, slope, err));
  const msim_options opt = event_options("implicit-euler", 1.0 / 60);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 40, err));
  assert_true(stats_of(sim).newton_iterations <= 40 * 5.5);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Convergence is superlinear, so that 4 more digits take few more iterations: along the normals of
 * contacts, which prescribe the velocities, there is no residual that solves could not reduce. */
static void four_more_digits_take_few_iterations(void **state) {
  (void)state;
  static const double k[] = {30, 100, 300};
  for (int i = 0; i < 6; i++) {
    const double mu = 0.6 * (i % 2);
    const int64_t usual = count_steps_of_jelly(0, k[i / 2], mu, 1e-8, 0).newton_iterations,
                  more = count_steps_of_jelly(0, k[i / 2], mu, 1e-12, 0).newton_iterations;
    if (!((double)more <= 1.3 * (double)usual))
      fail_msg("k = %g: %d iterations, %d with 4 more digits", k[i / 2], (int)usual, (int)more);
  }
}

/* Where contacts last, sticking or sliding, the own step is the result: no rough solve is made
 * beside those of Newton's method. */
static void steps_in_lasting_contact_need_no_rough_solves(void **state) {
  (void)state;
  static const double mu[] = {0.8, 0.1};
  for (int i = 0; i < 2; i++) {
    const msim_stats s = count_steps_of_jelly(0, 3000, mu[i], 1e-8, STEPS / 2);
    if (s.solves != s.newton_iterations)
      fail_msg("mu %g: %d solves, %d iterations", mu[i], (int)s.solves, (int)s.newton_iterations);
  }
}

/* collision = reflect: a rough solve and an accurate one, however stiff the body is; a step that
 * would add energy is shortened. */
static void reflection_takes_two_solves(void **state) {
  (void)state;
  for (int i = 0; i < SCENES; i++)
    for (int n = 0; n < 12; n++)
      assert_true(run_stiff_body(i, "linearly-implicit-euler", MSIM_COLLISION_REFLECT,
                                 300 * pow(10, n / 4), 0.5 * (n % 2), 0.5 * (n / 2 % 2)) <= 2);
}

/* On a sphere that moves and turns energy less work stays below that at the start, where pins do
 * not carry the body. */
static void moving_solids_do_the_work(void **state) {
  (void)state;
  static const double at[3] = {0}, u[3] = {0.3, 0.1, 0.4}, w[3] = {0, 1, 2};
  for (int n = 0; n < 6; n++) {
    msim_scene *scene = stiff_body(0, 300 * pow(10, n / 2), 0.5 * (n % 2), 0.5 * (n % 2));
    set_uniform(scene, at, u, w);
    msim_options opt = event_options("linearly-implicit-euler", 1.0 / 60);
    opt.collision = MSIM_COLLISION_REFLECT;
    msim_sim *sim = make_sim(scene, &opt);
    const double start = balance_of(sim);
    for (int step = 0; step < STEPS; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      assert_true(least_distance(sim) >= -1e-11);
      const double now = balance_of(sim);
      if (!(now <= start + 1e-9)) fail_msg("%d, step %d: %g J, from %g J", n, step, now, start);
    }
    assert_true(fabs(energies_of(sim).work) > 0.1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static int32_t return_zero(void *data, const msim_force_batch *batch) {
  (void)data, (void)batch;
  return 0;
}

/* A cloth hangs from two handles that a program moves, over a sphere: no frame is refused, and the
 * motion stays slow. */
static void moved_handles_refuse_no_frame(void **state) {
  (void)state;
  static const int32_t handles[2] = {0, SIDE - 1};
  for (int n = 0; n < 6; n++) {
    msim_scene *scene = stiff_body(SCENES, 300 * pow(10, n / 2), 0, 0.3);
    msim_options opt = event_options("linearly-implicit-euler", 1.0 / 60);
    opt.incomplete = MSIM_INCOMPLETE_ACCEPT;
    opt.collision = n % 2 ? MSIM_COLLISION_REFLECT : MSIM_COLLISION_EVENT;
    msim_sim *sim = make_sim(scene, &opt);
    for (int frame = 0; frame < 120; frame++) {
      const double a = frame / 60.;
      const double to[6] = {-0.5 + 0.2 * sin(a), -0.5, 0.32 + 0.1 * sin(2 * a),
                            -0.5 + 0.2 * sin(a), 0.5,  0.22 + 0.1 * cos(a)};
      if (frame % 10 == 0) assert_ok(msim_sim_move_pinned(sim, 2, handles, to, 10. / 60, err));
      assert_ok(msim_sim_step(sim, 1, err));
      expect_outside(0, sim);
    }
    msim_energy e = {.size = sizeof e};
    msim_sim_energy(sim, &e);
    assert_true(e.kinetic + e.elastic < 1);
    assert_true(stats_of(sim).solves <= 120 * (n % 2 ? 2 : 8));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A large cloth, whose solver has a coarse space, falls on a sphere: the solves of a step share a
 * coarse factor, of the clamped matrix if the exact one is not positive definite. With a force
 * function factors are not reused in later steps, and their constraints not recorded. */
static void solves_of_a_step_share_a_coarse_factor(void **state) {
  enum { FRAMES = 12 };
  static const int64_t at[] = {8};
  (void)state;
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 50,
                            .columns = 50,
                            .origin = {-0.5, -0.5, 0.32},
                            .row = {1, 0, 0.01},
                            .column = {0, 1, 0.02},
                            .mass = 0.3,
                            .k_structural = 500};
  const msim_force_function none = {.size = sizeof none, .name = "none", .evaluate = return_zero};
  msim_scene *scene = new_scene();
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  add(scene, sphere(0, 0, 0, 0.3, 0, 0.3), 0);
  assert_ok(msim_scene_set_force_function(scene, &none, err));
  msim_options opt = event_options("linearly-implicit-euler", 1.0 / 60);
  opt.solver_rtol = 1e-4;
  const msim_stats with = expect_resumable(scene, &opt, FRAMES, 1, at, "with a force function");
  assert_ok(msim_scene_set_force_function(scene, NULL, err));
  const msim_stats without = expect_resumable(scene, &opt, FRAMES, 1, at, "without");
  assert_true(with.contacts > 0 && without.contacts > 0);
  assert_in_range(with.coarse_factors, FRAMES, 2 * FRAMES + with.rejected_steps * 4);
  assert_in_range(without.coarse_factors, FRAMES, 2 * FRAMES + without.rejected_steps * 4);
  msim_scene_destroy(scene);
}

/* The two solves of a step share the iterations that a loop allows. */
static void both_solves_keep_the_budget(void **state) {
  (void)state;
  msim_scene *scene = stiff_body(0, 3000, 0, 0.3);
  msim_options opt = options("linearly-implicit-euler", 1.0 / 60);
  opt.incomplete = MSIM_INCOMPLETE_ACCEPT, opt.solver = "pcg", opt.solver_max_iterations = 20;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, STEPS, err));
  const msim_stats s = stats_of(sim);
  assert_true(s.solves > 1.5 * STEPS && s.incomplete_steps > STEPS / 2);
  assert_true(s.iterations <= 1.1 * 20 * STEPS);
  expect_outside(0, sim);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Contacts follow from the state: a run goes on to the bit after a checkpoint, by any number of
 * threads. */
static void resumed_runs_are_the_same(void **state) {
  (void)state;
  static const int64_t at[] = {8, 14, 20, 31, 40};
  static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler"};
  for (int i = 0; i < 4 * SCENES; i++) {
    const char *method = methods[i / SCENES % 2];
    msim_scene *scene = stiff_body(i % SCENES, 3000, 0.3, 0.3);
    msim_options opt = event_options(method, 1.0 / 60);
    opt.threads = 1 + i % 2, opt.newton_rtol = 1e-8;
    if (i >= 2 * SCENES) opt.collision = MSIM_COLLISION_REFLECT;
    const msim_stats s = expect_resumable(scene, &opt, 50, 5, at, method);
    assert_true(s.contacts > 0);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(steps_with_predicted_changes_are_solved_once),
      cmocka_unit_test(steps_in_lasting_contact_need_no_rough_solves),
      cmocka_unit_test(laws_that_agree_are_not_tried_in_turn),
      cmocka_unit_test(four_more_digits_take_few_iterations),
      cmocka_unit_test(energy_does_not_grow_in_few_solves),
      cmocka_unit_test(nonlinear_methods_keep_the_bound_too),
      cmocka_unit_test(reflection_takes_two_solves),
      cmocka_unit_test(moving_solids_do_the_work),
      cmocka_unit_test(moved_handles_refuse_no_frame),
      cmocka_unit_test(both_solves_keep_the_budget),
      cmocka_unit_test(solves_of_a_step_share_a_coarse_factor),
      cmocka_unit_test(resumed_runs_are_the_same)};
  return cmocka_run_group_tests_name("stiff_contact", tests, NULL, NULL);
}
