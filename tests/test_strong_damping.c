/* Tests of scenes in which damping takes vibrations within a fraction of a millisecond: rkc with
 * many stages, under error control. */
#include <math.h>

#include "auto_scenes.h"
#include "methods/methods.h"
#include "methods/rkc.h"

static msim_scene *falling_block(void) {
  const double g[3] = {0, 0, -9.81};
  const msim_lattice block = {.size = sizeof block,
                              .n = {5, 5, 5},
                              .extent = {0.3, 0.3, 0.3},
                              .mass = 0.3,
                              .k = 6000,
                              .damping = 280};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* Nothing but rounding errors limits the steps in free fall; 1000 stages are the most. Steps that
 * would need more amplified them until the run failed. */
static void long_steps_have_enough_stages(void **state) {
  (void)state;
  msim_scene *scene = falling_block();
  const double tol = 0.03, T = 0.5;
  const msim_options opt = options_of("rkc", tol, T);
  ms_bounds b;
  msim_sim *sim = make_sim(scene, &opt);
  const msim_state start = state_of(sim);
  double z[125];
  for (int i = 0; i < 125; i++) z[i] = start.x[3 * i + 2];
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const msim_state end = state_of(sim);
  for (int i = 0; i < 125; i++) assert_close(end.x[3 * i + 2], z[i] - 9.81 * T * T / 2, tol * 0.3);
  assert_ok(ms_bounds_compute(scene->data, 1, &b, err));
  b.rate *= 10;
  const double h = ms_rkc.limit(&b);
  print_message("  %lld steps, the longest has %d stages\n", (long long)stats_of(sim).steps,
                ms_rkc_count_stages(h, b));
  assert_int_equal(ms_rkc_count_stages(h, b), 1000);
  assert_int_equal(ms_rkc_count_stages(0.998 * h, b), 999);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(long_steps_have_enough_stages)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
