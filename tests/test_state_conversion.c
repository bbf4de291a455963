/* Tests that a run whose state is not read converts no vectors and synchronizes no velocities, and
 * that reads cost one conversion per step. */
#include <string.h>

#include "methods/methods.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 5, N = SIDE * SIDE };

static int syncs;
static const ms_integrator *watched;

static void counting_sync(const ms_stepper *s, double *v, double *scratch) {
  syncs++;
  watched->sync(s, v, scratch);
}

/* Values that stay in the arrays of the API until the next conversion. */
static void mark(msim_sim *sim) { sim->state_x[3 * N - 1] = sim->state_v[3 * N - 1] = 12345; }

static int is_marked(const msim_sim *sim) {
  return sim->state_x[3 * N - 1] == 12345 && sim->state_v[3 * N - 1] == 12345;
}

static int stop_at_30(msim_sim *sim, void *user) {
  msim_plan plan = {.size = sizeof plan};
  (void)user;
  msim_sim_plan(sim, &plan); /* does not read the state */
  return sim->run.step == 30;
}

static void unread_states_are_not_converted(void **state) {
  (void)state;
  for (int32_t i = 0; ms_methods_at(i); i++) {
    msim_scene *scene = hanging_cloth(SIDE, 100, 0);
    ms_integrator spy = *ms_methods_at(i);
    msim_options opt = options(spy.entry.name, 1e-3);
    opt.solver = "pcg", opt.steps = 40, opt.every = 10;
    msim_sim *sim = make_sim(scene, &opt);
    watched = ms_methods_at(i), syncs = 0;
    if (spy.sync) spy.sync = counting_sync;
    sim->config.integrator = &spy;
    mark(sim);
    assert_ok(msim_sim_step(sim, 20, err));
    assert_int_equal(msim_sim_run(sim, stop_at_30, NULL, NULL), MSIM_STOPPED);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_int_equal(stats_of(sim).steps, 40);
    assert_true(is_marked(sim));
    assert_int_equal(syncs, 0);
    msim_energy energy = {.size = sizeof energy};
    const int64_t forces = stats_of(sim).force_evaluations;
    for (int look = 0; look < 3; look++) msim_sim_energy(sim, &energy), state_of(sim);
    assert_false(is_marked(sim));
    assert_int_equal(syncs, spy.sync != NULL);
    assert_int_equal(stats_of(sim).force_evaluations, forces);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(unread_states_are_not_converted)};
  return cmocka_run_group_tests_name("state_conversion", tests, NULL, NULL);
}
