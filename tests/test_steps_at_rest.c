/* Tests that a scene at exact rest is not stepped, which changes nothing but counters. */
#include <string.h>

#include "scenes.h"

static msim_options pcg(const char *method, double h) {
  msim_options opt = options(method, h);
  opt.solver = "pcg";
  return opt;
}

/* A rope at its rest lengths without gravity, above a plane. */
static msim_scene *lying(double damping) {
  const msim_rope rope = {
      sizeof rope, 5, {0.1, 0.2, 0.3}, {0.7, 0.4, 0.9}, 1, 100, damping, 0, NULL, 0, 0};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  assert_ok(msim_scene_set_drag(scene, damping, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0.1);
  return scene;
}

/* After a step that changes nothing no further one is made, until a state or a spring is set. */
static void rest_is_not_stepped(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (refuses_planes(method_at(m))) continue;
    msim_scene *scene = lying(takes_positions_only(method_at(m)) ? 0 : 0.1);
    msim_options opt = pcg(method_at(m), 1e-2);
    msim_sim *lean = make_sim(scene, &opt);
    assert_ok(msim_options_set(&opt, "skip.at_rest", "off", err));
    msim_sim *full = make_sim(scene, &opt);
    const msim_state start = state_of(lean);
    double x[15], v[15] = {0}, k[4] = {50, 60, 70, 80}, rest[4] = {0.3, 0.2, 0.2, 0.2};
    memcpy(x, start.x, sizeof x);
    v[0] = 0.1;
    const msim_state pushed = {.size = sizeof pushed, .n = 5, .x = x, .v = v};
    for (int round = 0; round < 3; round++) {
      assert_ok(msim_sim_step(lean, 20, err));
      assert_ok(msim_sim_step(full, 20, err));
      const msim_state a = state_of(lean), b = state_of(full);
      assert_int_equal(a.step, b.step);
      assert_true(a.t == b.t);
      assert_memory_equal(a.x, b.x, sizeof x);
      assert_memory_equal(a.v, b.v, sizeof v);
      if (round == 0) assert_ok(msim_sim_set_springs(lean, k, NULL, NULL, err));
      if (round == 0) assert_ok(msim_sim_set_springs(full, k, NULL, NULL, err));
      if (round == 1) assert_ok(msim_sim_set_state(lean, &pushed, err));
      if (round == 1) assert_ok(msim_sim_set_state(full, &pushed, err));
    }
    assert_int_equal(stats_of(lean).steps, 60);
    assert_int_equal(stats_of(lean).steps_at_rest, 2 * 19);
    assert_int_equal(stats_of(full).steps_at_rest, 0);
    assert_true(stats_of(lean).force_evaluations < stats_of(full).force_evaluations);
    assert_true(state_of(lean).x[0] != x[0]);
    assert_ok(msim_sim_set_springs(lean, NULL, rest, NULL, err));
    msim_sim_destroy(lean), msim_sim_destroy(full);
    msim_scene_destroy(scene);
  }
}

/* The top of a throw is no rest, and neither is zero velocity with a force. */
static void standing_still_is_not_rest(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0}, v[3] = {0, 0, 0.5};
  for (int32_t m = 0; method_at(m); m++)
    for (int thrown = 0; thrown < 2; thrown++) {
      const double still[3] = {0, 0, 0};
      msim_scene *scene = make_single_particle(x, thrown ? v : still, 1);
      msim_options opt = pcg(method_at(m), 0.125);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 16, err));
      assert_int_equal(stats_of(sim).steps_at_rest, 0);
      assert_true(state_of(sim).x[2] < -0.5);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(rest_is_not_stepped),
                                     cmocka_unit_test(standing_still_is_not_rest)};
  return cmocka_run_group_tests_name("steps_at_rest", tests, NULL, NULL);
}
