/* Tests of checkpoints of runs that the energy monitor ends: resumed, they end in the same step
 * with the same message, and return the same state. */
#include <math.h>
#include <stdio.h>

#include "checkpoints.h"

/* A mass on a spring of 1 m, which starts beside its pin and falls. */
static msim_scene *pendulum(void) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, g[3] = {0, -9.81, 0}, k = 100;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, ij, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

static void add_block(msim_scene *scene, double x, int32_t side) {
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {side, side, side},
                                .origin = {x, 0, 0},
                                .extent = {0.2, 0.2, 0.2},
                                .mass = 1,
                                .k = 300};
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
}

/* Two islands without gravity: a block with an oscillating mass, and one at rest; also at rest is a
 * mass between two stretched springs. */
static msim_scene *islands(void) {
  enum { SIDE = 8, BLOCK = SIDE * SIDE * SIDE, SWINGS = 2 * BLOCK, HELD };
  const double x[12] = {0.5, 0.1, 0.1, 2, 0, 0, 3, 0, 0, 4, 0, 0}, mass[4] = {0.5, 1, 1, 1};
  const double k[3] = {10, 800, 800}, rest[3] = {0.2, 0.5, 0.5};
  const int32_t ij[6] = {0, SWINGS, HELD, HELD + 1, HELD + 1, HELD + 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  add_block(scene, 0, SIDE), add_block(scene, 1, SIDE);
  assert_ok(msim_scene_add_particles(scene, 4, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 3, ij, k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 2, (int32_t[2]){HELD, HELD + 2}, err));
  return scene;
}

static msim_scene *stiff_cloth(void) { return hanging_cloth(6, 1e6, 0); }

/* The sim has returned to an earlier state: it goes on as one that never left that state. */
static void expect_same_next_step(const msim_scene *scene, const msim_options *opt, msim_sim *sim) {
  msim_sim *alone = make_sim(scene, opt);
  assert_ok(msim_sim_step(alone, state_of(sim).step, err));
  assert_ok(msim_sim_step(alone, 1, err));
  assert_ok(msim_sim_step(sim, 1, err));
  const msim_state s = state_of(sim), t = state_of(alone);
  assert_true(s.step == t.step && s.t == t.t && s.h == t.h);
  assert_memory_equal(s.x, t.x, 3 * (size_t)s.n * sizeof *s.x);
  assert_memory_equal(s.v, t.v, 3 * (size_t)s.n * sizeof *s.v);
  msim_sim_destroy(alone);
}

/* The whole run, and the run continued in a new sim at each of these steps, from a checkpoint each:
 * all end with the same status and message. */
static void expect_same_report(const msim_scene *scene, const msim_options *opt,
                               msim_status reported, int n, const int64_t *at) {
  enum { MOST = 10000 };
  msim_error why, again;
  msim_sim *whole = make_sim(scene, opt), *parts = make_sim(scene, opt);
  assert_int_equal(msim_sim_step(whole, MOST, &why), reported);
  for (int i = 0; i < n; i++) {
    assert_ok(msim_sim_step(parts, at[i] - state_of(parts).step, err));
    const checkpoint c = save(parts);
    msim_sim *other = resume(scene, opt, &c);
    msim_sim_destroy(parts);
    parts = resume(scene, opt, &c);
    free(c.bytes);
    assert_int_equal(msim_sim_step(other, MOST, &again), reported);
    assert_string_equal(why.text, again.text);
    expect_same(whole, other, opt->integrator);
    msim_sim_destroy(other);
  }
  expect_same_next_step(scene, opt, whole);
  msim_sim_destroy(whole), msim_sim_destroy(parts);
}

/* The last good state is that of step 0 or 160, or of the last step. */
static void a_report_is_the_same(void **state) {
  (void)state;
  static const int64_t late[] = {1, 159, 160, 161, 319};
  msim_scene *scene = pendulum();
  msim_options opt = options("explicit-euler", 0.1);
  expect_same_report(scene, &opt, MSIM_UNSTABLE, 2, late);
  opt.h = 0.02; /* smaller growth */
  expect_same_report(scene, &opt, MSIM_UNSTABLE, 5, late);
  msim_scene_destroy(scene);
}

/* These methods carry transformed variables, and store the state of the start separately. */
static void the_initial_state_is_restored_exactly(void **state) {
  (void)state;
  static const char *const methods[] = {"verlet", "takahashi-imada"};
  static const int64_t early[] = {1, 80, 159};
  double x[6] = {0, 0, 0, 0.9, 0.3, 0.2}, v[6] = {0, 0, 0, 0.1, 0, 0.3};
  const msim_state start = {.size = sizeof start, .step = 7, .t = 2, .n = 2, .x = x, .v = v};
  msim_scene *scene = pendulum();
  for (int m = 0; m < 2; m++) {
    const msim_options opt = options(methods[m], m ? 0.36 : 0.22);
    expect_same_report(scene, &opt, MSIM_UNSTABLE, 3, early);
    msim_error why;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_set_state(sim, &start, err));
    assert_ok(msim_sim_step(sim, 9, err));
    const checkpoint c = save(sim);
    msim_sim *other = resume(scene, &opt, &c);
    free(c.bytes);
    assert_int_equal(msim_sim_step(sim, 1000, &why), MSIM_UNSTABLE);
    assert_int_equal(msim_sim_step(other, 1000, &why), MSIM_UNSTABLE);
    expect_same(sim, other, methods[m]);
    assert_memory_equal(state_of(other).x, x, sizeof x);
    assert_memory_equal(state_of(other).v, v, sizeof v);
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(scene);
}

/* The energy of islands at rest is part of the sum. */
static void what_is_at_rest_counts(void **state) {
  (void)state;
  static const int64_t late[] = {2, 161};
  msim_scene *scene = islands();
  const msim_options opt = options("explicit-euler", 1e-4);
  expect_same_report(scene, &opt, MSIM_UNSTABLE, 2, late);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 2, err));
  assert_true(stats_of(sim).islands_at_rest > 0); /* otherwise nothing is tested */
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Another event, in a state that is beyond the bounds already */
static void a_restored_state_is_the_same(void **state) {
  (void)state;
  static const int64_t early[] = {1, 5, 11};
  msim_scene *scene = stiff_cloth();
  const msim_options opt = options("explicit-euler", 0.05);
  expect_same_report(scene, &opt, MSIM_NOT_FINITE, 3, early);
  msim_scene_destroy(scene);
}

/* With a tol so loose that error control accepts unstable steps; its state is restored, too. */
static void error_control_is_restored_too(void **state) {
  (void)state;
  static const int64_t late[] = {1, 100, 160, 161, 319};
  static const char *const methods[] = {"rkn6", "force-gradient"};
  msim_scene *scene = pendulum();
  for (int m = 0; m < 2; m++) {
    msim_options opt = options(methods[m], 0.02);
    opt.tol = 2000, opt.t_end = 1000, opt.steps = -1;
    expect_same_report(scene, &opt, MSIM_UNSTABLE, 5, late);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_report_is_the_same),
                                     cmocka_unit_test(the_initial_state_is_restored_exactly),
                                     cmocka_unit_test(what_is_at_rest_counts),
                                     cmocka_unit_test(a_restored_state_is_the_same),
                                     cmocka_unit_test(error_control_is_restored_too)};
  return cmocka_run_group_tests_name("checkpoint_energy_monitor", tests, NULL, NULL);
}
