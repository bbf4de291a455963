/* Error control where stability limits the steps, as in damped scenes: few steps are rejected, and
 * methods for damping take few evaluations */
#include <math.h>

#include "error_control.h"
#include "integrate/control.h"

static msim_stats run_stats(const msim_scene *scene, const char *method, double tol, double t_end) {
  const msim_options opt = control_options(method, tol, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const msim_stats stats = stats_of(sim);
  msim_sim_destroy(sim);
  return stats;
}

/* A particle on a spring, overdamped: x'' = -g x' - x */
static msim_scene *overdamped_particle(double g) {
  const double x[6] = {0, 0, 0, 1.1, 0, 0}, mass[2] = {1, 1}, k = 1, rest = 1;
  const int32_t ij[2] = {0, 1}, pinned = 0;
  msim_scene *scene = NULL;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &g, err));
  assert_ok(msim_scene_pin(scene, 1, &pinned, err));
  return scene;
}

/* The recurrence of step_factor() in control.c contracts for these methods on the real axis: steps
 * settle at the limit, h g = 6.39 for dop853, 5.57 for two half steps of rk4 and 4 for those of
 * velocity Verlet. With gains for which it does not, a quarter of the steps is rejected. */
static void steps_settle_at_the_limit(void **state) {
  (void)state;
  static const struct {
    const char *method;
    double limit;
  } of[] = {{"dop853", 6.39}, {"rk4", 5.57}, {"velocity-verlet", 4}};
  const double g = 20, t_end = 200, tol[] = {0.1, 1e-3};
  msim_scene *scene = overdamped_particle(g);
  for (int i = 0; i < 6; i++) {
    const msim_stats s = run_stats(scene, of[i / 2].method, tol[i % 2], t_end);
    print_message("  %s, tol = %g: %lld steps, %lld rejected\n", of[i / 2].method, tol[i % 2],
                  (long long)s.steps, (long long)s.rejected_steps);
    assert_true(s.rejected_steps <= 3);
    assert_true((double)s.steps > 0.98 * t_end * g / of[i / 2].limit);
    assert_true((double)s.steps < 1.3 * t_end * g / of[i / 2].limit);
  }
  msim_scene_destroy(scene);
}

/* A step may have a larger error if 5 shares of those before it are left afterwards. */
static void steps_use_what_others_have_left(void **state) {
  (void)state;
  ms_control c = {.tol = 1e-4, .span = 1, .order = 7, .h = 1, .growth = 5, .safety = 0.85};
  for (int i = 0; i < 8; i++) assert_true(ms_control_update(&c, 0.5, 0.1, MS_NOWHERE));
  ms_control next = c;
  assert_true(ms_control_update(&next, 0.5, 3, MS_NOWHERE));     /* leaves 3.6 - 1 = 2.6 s */
  assert_false(ms_control_update(&next, 0.55, 1.2, MS_NOWHERE)); /* would leave less than 5 0.55 */
  assert_true(ms_control_update(&next, 0.45, 1.2, MS_NOWHERE));
  assert_false(ms_control_update(&c, 0.5, 3.01, MS_NOWHERE));
  ms_control_reset(&c);
  assert_false(ms_control_update(&c, 0.5, 1.01, MS_NOWHERE));
  /* at any time the sum of all errors is within tol */
  double used = 0, made = 0;
  int used_more = 0;
  unsigned seed = 1;
  for (int i = 0; i < 10000; i++) {
    const double r = pow(10, 3 * uniform(&seed) - 2), h = pow(10, -uniform(&seed));
    if (!ms_control_update(&c, h, r, MS_NOWHERE)) continue;
    used += r * h, made += h, used_more += r > 1;
    assert_true(used <= made);
  }
  assert_true(used_more > 100);
}

static int64_t evaluations_of(const msim_scene *scene, const char *method, const double *x) {
  const msim_options opt = control_options(method, 1e-3, 0.4);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_true(rms_distance(state_of(sim).x, x) < 1e-3);
  const int64_t n = stats_of(sim).force_evaluations;
  msim_sim_destroy(sim);
  return n;
}

/* If only damping limits the step: ssprk104 has 10 evaluations to h g = 13.9, dop853 12 to 6.39. */
static void methods_for_damping_take_few_evaluations(void **state) {
  (void)state;
  double x[3 * N];
  msim_scene *scene = hanging_cloth(SIDE, 100, 40);
  const msim_options opt = options("tr-bdf2", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 400, err));
  memcpy(x, state_of(sim).x, sizeof x);
  const int64_t rkc = evaluations_of(scene, "rkc", x),
                ssprk104 = evaluations_of(scene, "ssprk104", x),
                dop853 = evaluations_of(scene, "dop853", x),
                verlet = evaluations_of(scene, "velocity-verlet", x);
  assert_true(5 * rkc < verlet && 3 * ssprk104 < 2 * dop853);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(steps_settle_at_the_limit),
      cmocka_unit_test(steps_use_what_others_have_left),
      cmocka_unit_test(methods_for_damping_take_few_evaluations),
  };
  return cmocka_run_group_tests_name("limited_steps", tests, NULL, NULL);
}
