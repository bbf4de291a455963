/* Tests of integrator = auto where forces depend on velocities, but damping is weak: the leapfrog
 * method takes the velocities of half a step before, for half the evaluations of velocity Verlet.
 */
#include <math.h>
#include <string.h>

#include "auto_scenes.h"
#include "checkpoints.h"
#include "choose/rejection_reasons.h"

enum { VERLET, WITH_VELOCITIES, FOURTH = 4 }; /* candidates */

/* Damping of about 1/900 (9 x 9) of sqrt(2 k m), the critical one of two particles on a spring */
static msim_scene *cloth_of(int side) { return hanging_cloth(side, 3e3, 0.005); }

static msim_sim *planned(const msim_scene *scene, double tol) {
  msim_options opt = options_of("auto", tol, 0.2);
  opt.precision = MSIM_PRECISION_DOUBLE;
  return make_sim(scene, &opt);
}

static const char *name_of(const msim_sim *sim) { return sim->config.integrator->entry.name; }

/* The largest difference of positions from a run by dop853, over the extent of the cloth */
static double error_of(const msim_scene *scene, msim_sim *sim) {
  const msim_options opt = options_of("dop853", 1e-11, 0.2);
  msim_sim *exact = make_sim(scene, &opt);
  assert_ok(msim_sim_run(exact, NULL, NULL, err));
  const msim_state s = state_of(sim), t = state_of(exact);
  const double error = largest_difference(s.x, t.x, 3 * s.n);
  msim_sim_destroy(exact);
  return error / sim->config.choice.verification.scales.extent;
}

static void one_evaluation_a_step_keeps_tol(void **state) {
  (void)state;
  msim_scene *scene = cloth_of(9);
  const double tol[] = {1e-2, 3e-3, 1e-3};
  for (int i = 0; i < 3; i++) {
    msim_sim *sim = planned(scene, tol[i]);
    assert_string_equal(name_of(sim), "verlet");
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    const double error = error_of(scene, sim);
    print_message("  tol %g: error %.2g, foreseen %.2g\n", tol[i], error,
                  sim->config.choice.candidates[VERLET].error);
    assert_true(error < tol[i]);
    assert_true(stats_of(sim).force_evaluations <= state_of(sim).step + 2);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* rk4, whose steps stability limits, would cost half as much again. */
static void takahashi_imada_keeps_a_small_tol(void **state) {
  (void)state;
  const double tol = 1e-5;
  msim_scene *scene = cloth_of(9);
  msim_sim *sim = planned(scene, tol);
  const ms_candidate *rk4 = &sim->config.choice.candidates[FOURTH];
  assert_string_equal(name_of(sim), "takahashi-imada");
  assert_string_equal(rk4->method->entry.name, "rk4");
  print_message("  rk4 costs %.2g times as much\n", rk4->cost_rate * sim->config.opt.h / 2);
  assert_true(rk4->cost_rate > 1.5 * 2 / sim->config.opt.h);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_true(error_of(scene, sim) < tol);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The error of old velocities is of order 1: with strong damping it needs shorter steps than other
 * methods, and the error that is foreseen is proportional to h. */
static void strong_damping_needs_velocities(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(9, 3e3, 0.5);
  msim_sim *sim = planned(scene, 1e-4);
  const ms_candidate *c = sim->config.choice.candidates;
  assert_string_not_equal(name_of(sim), "verlet");
  assert_true(c[VERLET].error > 0 && c[VERLET].h < c[WITH_VELOCITIES].h / 2);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Steps of few particles are verified in half steps, which verlet cannot make; without damping, or
 * where reflection at a plane determines errors, velocity Verlet adds nothing to it. */
static void one_of_both_is_sufficient(void **state) {
  (void)state;
  const struct {
    int side;
    double damping;
    int meets_plane, rejection[2];
  } row[] = {{9, 0.005, 0, {0, 0}},
             {9, 0, 0, {0, MS_REASON_VERLET}},
             {9, 0.005, 1, {0, MS_REASON_VERLET}},
             {5, 0.005, 0, {MS_REASON_INDIVISIBLE, 0}},
             {5, 0.005, 1, {MS_REASON_INDIVISIBLE, 0}},
             {5, 0, 0, {MS_REASON_INDIVISIBLE, 0}}};
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    msim_scene *scene = hanging_cloth(row[i].side, 3e3, row[i].damping);
    if (row[i].meets_plane) plane(scene, 0, 0, 1, -0.005, 0, 0);
    msim_sim *sim = planned(scene, 1e-2);
    for (int k = 0; k < 2; k++) {
      const ms_candidate *c = &sim->config.choice.candidates[k];
      if (row[i].rejection[k]) assert_int_equal(c->rejection, row[i].rejection[k]);
      assert_true(row[i].rejection[k] ? c->cost_rate == INFINITY : c->cost_rate < INFINITY);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* The choice makes an eighth of the run with one evaluation a step, too, and some trials. */
static void the_choice_is_as_cheap(void **state) {
  (void)state;
  msim_scene *scene = cloth_of(12);
  msim_options opt = options_of("auto", 1e-2, 0.5);
  msim_sim *sim = make_sim(scene, &opt);
  const ms_method_choice *s = &sim->config.choice;
  const double pilot = 0.5 / 8 / s->candidates[VERLET].h;
  print_message("  the choice: %.0f evaluations, the pilot run: %.0f\n", s->total_cost, pilot);
  assert_string_equal(name_of(sim), "verlet");
  assert_true(s->total_cost > pilot && s->total_cost < 1.3 * pilot);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void a_run_resumes_to_the_bit(void **state) {
  (void)state;
  msim_scene *scene = cloth_of(9);
  msim_sim *sim = planned(scene, 1e-2);
  msim_options opt = options_of("auto", 1e-2, 0.2);
  opt.precision = MSIM_PRECISION_DOUBLE, opt.threads = 2;
  assert_ok(msim_sim_step(sim, 77, err));
  const checkpoint c = save(sim);
  msim_sim *same = resume(scene, &opt, &c);
  assert_string_equal(name_of(same), "verlet");
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_ok(msim_sim_run(same, NULL, NULL, err));
  const msim_state s = state_of(sim), t = state_of(same);
  assert_int_equal(s.step, t.step);
  assert_memory_equal(s.x, t.x, 3 * (size_t)s.n * sizeof *s.x);
  assert_memory_equal(s.v, t.v, 3 * (size_t)s.n * sizeof *s.v);
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(same);
  msim_scene_destroy(scene);
}

/* A plane that comes close makes a new choice, from velocities of the same time as positions. */
static void a_late_plane_makes_a_new_choice(void **state) {
  (void)state;
  const double tol = 1e-2;
  msim_scene *scene = cloth_of(9), *free_scene = cloth_of(9);
  msim_sim *far = planned(free_scene, tol);
  assert_ok(msim_sim_run(far, NULL, NULL, err));
  const msim_state end = state_of(far);
  double lowest = 0;
  for (int i = 0; i < end.n; i++) lowest = fmin(lowest, end.x[3 * i + 2]);
  plane(scene, 0, 0, 1, 0.9 * lowest, 0, 0);
  msim_sim *sim = planned(scene, tol);
  assert_string_equal(name_of(sim), "verlet");
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  print_message("  %s at the end\n", name_of(sim));
  assert_string_not_equal(name_of(sim), "verlet");
  assert_true(stats_of(sim).contacts > 0);
  assert_true(error_of(scene, sim) < tol);
  msim_sim_destroy(sim), msim_sim_destroy(far);
  msim_scene_destroy(scene), msim_scene_destroy(free_scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(one_evaluation_a_step_keeps_tol),
                                     cmocka_unit_test(takahashi_imada_keeps_a_small_tol),
                                     cmocka_unit_test(strong_damping_needs_velocities),
                                     cmocka_unit_test(one_of_both_is_sufficient),
                                     cmocka_unit_test(the_choice_is_as_cheap),
                                     cmocka_unit_test(a_run_resumes_to_the_bit),
                                     cmocka_unit_test(a_late_plane_makes_a_new_choice)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
