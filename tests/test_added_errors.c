/* Tests of integrator = auto where errors of steps add up to more than the choice has foreseen. */
#include <math.h>

#include "checkpoints.h"
#include "scenes.h"
#include "sim/sim.h"

static msim_options options_of(const char *method, double tol, double t_end) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.tol = tol, opt.t_end = t_end;
  opt.precision = MSIM_PRECISION_DOUBLE;
  return opt;
}

/* A run of it by velocity Verlet takes 722 steps. */
static msim_scene *damped_cloth(void) { return hanging_cloth(9, 7500, 1); }

static msim_sim *make_fall(const msim_scene *scene) {
  const msim_options opt = options_of("auto", 3e-4, 0.2);
  msim_sim *sim = make_sim(scene, &opt);
  assert_string_equal(sim->config.integrator->entry.name, "velocity-verlet");
  return sim;
}

static msim_sim *resume_fall(const msim_scene *scene, msim_sim *sim) {
  const msim_options opt = options_of("auto", 3e-4, 0.2);
  const checkpoint c = save(sim);
  msim_sim *same = resume(scene, &opt, &c);
  free(c.bytes);
  return same;
}

/* The difference of the next step, or of the first of its parts, from two half steps */
static double measure_next(const msim_scene *scene, msim_sim *sim, int parts) {
  msim_sim *same = resume_fall(scene, sim);
  ms_sim_switch_method(same, same->config.integrator, same->run.h / parts);
  ms_step_measurement next;
  assert_ok(
      ms_step_verification_measure(same, &same->config.choice.verification.scales, &next, err));
  msim_sim_destroy(same);
  return next.error;
}

/* Only scheduled steps are verified. */
static void steps_unverified(msim_sim *sim, int n) {
  ms_island_verification *check = &sim->islands->verification;
  check->indicator[0] = check->indicator[1] = 1e9;
  assert_ok(msim_sim_step(sim, n, err));
}

/* The sum grows by the difference of a verified step, times the steps since the one before, or by
 * that of a part, times their parts. */
static void errors_of_steps_add_up(void **state) {
  (void)state;
  msim_scene *scene = damped_cloth();
  msim_sim *sim = make_fall(scene);
  const double *sum = &sim->islands->verification.error_sum,
               tolerated = sim->config.choice.verification.error_sum;
  assert_close(tolerated / sim->config.choice.verification.allowed, 0.2 / sim->config.opt.h / 50,
               1e-9);
  for (int parts = 1, i = 0; i < 4; i++) {
    if (i == 2) sim->islands->verification.error_sum = 1.2 * tolerated, parts = 2;
    steps_unverified(sim, MS_VERIFICATION_INTERVAL - 1);
    const double before = *sum, error = measure_next(scene, sim, parts);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_close((*sum - before) / (MS_VERIFICATION_INTERVAL * parts * error), 1, 1e-9);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Evaluations of a step of an island whose errors have come to `sum` times what leads to tol */
static int64_t evaluations_after(msim_sim *sim, double sum) {
  const int64_t before = stats_of(sim).force_evaluations;
  sim->islands->verification.error_sum = sum * sim->config.choice.verification.error_sum;
  steps_unverified(sim, 1);
  return stats_of(sim).force_evaluations - before;
}

/* Steps whose errors add up to tol are made in two parts, beyond 2 tol in four; a run that is
 * resumed then has the same bits. */
static void errors_that_add_up_shorten_steps(void **state) {
  (void)state;
  msim_scene *scene = damped_cloth();
  msim_sim *sim = make_fall(scene);
  steps_unverified(sim, MS_VERIFICATION_INTERVAL);
  const double sums[] = {0.99, 1.01, 1.99, 2.01, 1e9, 1.5};
  const int64_t one = evaluations_after(sim, 0), parts[] = {1, 2, 2, 4, 4, 2};
  for (int i = 0; i < 6; i++) assert_int_equal(evaluations_after(sim, sums[i]), parts[i] * one);
  msim_sim *same = resume_fall(scene, sim);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_ok(msim_sim_run(same, NULL, NULL, err));
  const msim_state s = state_of(sim), t = state_of(same);
  assert_memory_equal(s.x, t.x, 3 * (size_t)s.n * sizeof *s.x);
  assert_memory_equal(s.v, t.v, 3 * (size_t)s.n * sizeof *s.v);
  assert_close(sim->islands->verification.error_sum, same->islands->verification.error_sum, 0);
  msim_sim_destroy(sim), msim_sim_destroy(same);
  msim_scene_destroy(scene);
}

/* A new choice, after a state is set, begins a new sum. */
static void a_new_choice_begins_a_new_sum(void **state) {
  (void)state;
  msim_scene *scene = damped_cloth();
  msim_sim *sim = make_fall(scene);
  steps_unverified(sim, MS_VERIFICATION_INTERVAL);
  assert_true(sim->islands->verification.error_sum > 0);
  const msim_state now = state_of(sim);
  assert_ok(msim_sim_set_state(sim, &now, err));
  assert_ok(msim_sim_step(sim, 1, err));
  assert_true(sim->islands->verification.error_sum == 0);
  assert_int_equal(sim->islands->verification.verified, MS_VERIFICATION_INTERVAL);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Of few particles or with another order, errors cancel or are events: any sum is allowed. */
static void other_sums_do_not_count(void **state) {
  (void)state;
  const double tol[] = {1e-2, 1e-5};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene = hanging_cloth(i ? 9 : 6, 93, 0.002);
    const msim_options opt = options_of("auto", tol[i], 0.2);
    msim_sim *sim = make_sim(scene, &opt);
    print_message("  %s\n", sim->config.integrator->entry.name);
    assert_int_equal(sim->config.integrator->entry.order, i ? 4 : 2);
    assert_true(sim->config.choice.verification.error_sum == 0);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* E, the norm of errors that tol limits (pilot_run.c) */
static double distance_between(msim_sim *sim, msim_sim *other) {
  const ms_scales *scales = &sim->config.choice.verification.scales;
  const msim_state s = state_of(sim), t = state_of(other);
  double sum = 0, mass = 0;
  for (int32_t i = 0; i < 3 * s.n; i++) {
    const double dx = (s.x[i] - t.x[i]) / scales->extent, dv = (s.v[i] - t.v[i]) / scales->speed;
    sum += sim->scene->mass[i / 3] * (dx * dx + dv * dv);
    if (!sim->scene->pinned[i / 3]) mass += sim->scene->mass[i / 3] / 3;
  }
  return sqrt(sum / (2 * mass));
}

/* A cloth that falls from rest moves, and errs, far more at the end of the run than in the pilot
 * run. */
static void growing_errors_keep_tol(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(9, 93, 0.002);
  const msim_options exact = options_of("dop853", 1e-11, 0.2);
  msim_sim *other = make_sim(scene, &exact);
  assert_ok(msim_sim_run(other, NULL, NULL, err));
  for (int i = 0; i < 9; i++) {
    const double tol = 1e-2 / pow(3, i);
    const msim_options opt = options_of("auto", tol, 0.2);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    const double error = distance_between(sim, other);
    print_message("  tol %.1e  %-15s error/tol %.2g\n", tol, sim->config.integrator->entry.name,
                  error / tol);
    assert_true(error <= tol);
    msim_sim_destroy(sim);
  }
  msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(errors_of_steps_add_up), cmocka_unit_test(errors_that_add_up_shorten_steps),
      cmocka_unit_test(a_new_choice_begins_a_new_sum), cmocka_unit_test(other_sums_do_not_count),
      cmocka_unit_test(growing_errors_keep_tol)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
