/* Tests of the energy monitor and of rest with precision = single. */
#include <math.h>

#include "checkpoints.h"

static msim_options single_options(double h) {
  msim_options opt = options("velocity-verlet", h);
  opt.precision = MSIM_PRECISION_SINGLE;
  return opt;
}

/* 200 steps, and from there with steps beyond the stability limit */
static msim_sim *make_unstable_sim(const msim_scene *scene, int32_t precision) {
  msim_options opt = single_options(1e-3);
  opt.precision = precision;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 200, err));
  assert_ok(msim_sim_set_step(sim, 0.02, err));
  return sim;
}

/* They return to the last good state. */
static void unstable_runs_end_as_in_double_precision(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(9, 200, 0);
  msim_sim *sim = make_unstable_sim(scene, MSIM_PRECISION_SINGLE),
           *good = make_unstable_sim(scene, MSIM_PRECISION_SINGLE),
           *exact = make_unstable_sim(scene, MSIM_PRECISION_DOUBLE);
  msim_error why;
  const msim_status status = msim_sim_step(sim, 1000, &why);
  assert_int_equal(status, msim_sim_step(exact, 1000, NULL));
  assert_true(status == MSIM_UNSTABLE || status == MSIM_NOT_FINITE);
  assert_non_null(strstr(why.text, "particle"));
  const msim_state now = state_of(sim), last = state_of(good);
  assert_int_equal(now.step, state_of(exact).step);
  assert_int_equal(now.step, last.step);
  assert_memory_equal(now.x, last.x, 3 * (size_t)now.n * sizeof *now.x);
  assert_memory_equal(now.v, last.v, 3 * (size_t)now.n * sizeof *now.v);
  msim_sim_destroy(sim), msim_sim_destroy(exact), msim_sim_destroy(good);
  msim_scene_destroy(scene);
}

/* A particle that a constant force F has moved by d has the kinetic energy F d, which the monitor
 * counts as supplied, however far it exceeds the energy at the start. */
static void constant_forces_supply_energy(void **state) {
  (void)state;
  const double x[3] = {0}, v[3] = {1e-3, 0, 0}, force[3] = {10, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 0);
  assert_ok(msim_scene_set_forces(scene, force, err));
  const msim_options opt = single_options(0.01);
  msim_sim *sim = make_sim(scene, &opt);
  msim_energy energy = {.size = sizeof energy};
  assert_ok(msim_sim_step(sim, 10000, err));
  msim_sim_energy(sim, &energy);
  assert_close(energy.kinetic, force[0] * state_of(sim).x[0], 1e-5 * energy.kinetic);
  assert_true(energy.kinetic > 1e5);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* A particle that moves is not taken for one at rest, whatever the direction. */
static void motion_is_no_rest(void **state) {
  (void)state;
  for (int c = 0; c < 3; c++) {
    const double x[3] = {0};
    double v[3] = {0};
    v[c] = 1;
    msim_scene *scene = make_single_particle(x, v, 0);
    msim_options opt = single_options(0.125);
    opt.skip_off = MSIM_SKIP_TWO_D;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 8, err));
    assert_true(state_of(sim).x[c] == 1);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(unstable_runs_end_as_in_double_precision),
                                     cmocka_unit_test(constant_forces_supply_energy),
                                     cmocka_unit_test(motion_is_no_rest)};
  return cmocka_run_group_tests_name("precision_energy", tests, NULL, NULL);
}
