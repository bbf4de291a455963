/* Tests of integrator = auto at impacts: which methods are tried, at what cost, and tol. */
#include <math.h>
#include <string.h>

#include "auto_scenes.h"
#include "checkpoints.h"
#include "choose/pilot_run.h"
#include "choose/rejection_reasons.h"

static void count_warning(const char *text, void *user) {
  (void)text;
  ++*(int *)user;
}

/*------------------------------------- many small bodies ----------------------------------------*/

enum { BODIES = 16 };

/* Bodies of one particle, or of two on a spring, that fall for a second, and reach the plane in the
 * last quarter of a run of 1.2 s */
static msim_scene *make_falling_bodies(int32_t size, double damping) {
  const double g[3] = {0, 0, -9.81}, mass[2] = {1, 2}, k = 500, rest = 0.25;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t i = 0; i < BODIES; i++) {
    const int32_t ij[2] = {2 * i, 2 * i + 1};
    const double lean = 0.1 * i, z = 9.81 / 2 + 0.02 * i;
    const double x[6] = {0.5 * i, 0, z, 0.5 * i + rest * cos(lean), 0, z + rest * sin(lean)};
    const double v[6] = {0.5, 0.1, 0, 0.5, -0.1, 0};
    assert_ok(msim_scene_add_particles(scene, size, x, v, mass, err));
    if (size == 2) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, err));
  }
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

static const ms_candidate *chosen_by(const msim_sim *sim) {
  return ms_choice_best(&sim->config.choice);
}

/* Frames are bound to fixed steps once the run has begun: error control, which bodies of few
 * particles have near planes, makes substeps of these. */
static void small_bodies_that_fall_from_afar_bounce(void **state) {
  (void)state;
  const double t_end = 1.2, tol = 1e-4;
  for (int32_t size = 1; size <= 2; size++)
    for (int damped = 0; damped < size; damped++) {
      msim_scene *scene = make_falling_bodies(size, 0.2 * damped);
      const msim_options reference = options_of("dop853", 1e-11, t_end);
      msim_options opt = options_of("auto", tol, t_end);
      int warnings = 0;
      opt.warn = count_warning, opt.warn_user = &warnings;
      msim_sim *sim = make_sim(scene, &opt), *exact = make_sim(scene, &reference);
      assert_true(sim->config.choice.verification.planes_far);
      assert_ok(msim_sim_run(exact, NULL, NULL, err));
      assert_ok(msim_sim_run(sim, NULL, NULL, err));
      const msim_state s = state_of(sim), to = state_of(exact);
      double sum = 0;
      for (int32_t i = 0; i < 3 * s.n; i++) sum += (s.x[i] - to.x[i]) * (s.x[i] - to.x[i]);
      const double error = sqrt(sum / s.n) / sim->config.choice.verification.scales.extent;
      print_message("  %d particles: %s, error %.2g tol\n", size,
                    sim->config.integrator->entry.name, error / tol);
      assert_true(stats_of(sim).contacts >= BODIES);
      assert_true(chosen_by(sim)->control_tol > 0 && !ms_sim_has_control(sim));
      assert_int_equal(s.step, sim->config.plan.steps);
      assert_true(error < tol);
      assert_int_equal(warnings, 0);
      msim_sim_destroy(sim), msim_sim_destroy(exact);
      msim_scene_destroy(scene);
    }
}

/*------------------------------------- a block -------------------------------------------------*/

/* A block of 36 particles, pinned at a corner, that swings down to a plane with friction, which it
 * meets in the middle of a run of 0.4 s */
static msim_scene *make_swinging_block(void) {
  const double g[3] = {0, 0, -9.81};
  const int32_t corner = 0;
  const msim_lattice block = {.size = sizeof block,
                              .n = {3, 3, 4},
                              .extent = {0.2, 0.2, 0.3},
                              .mass = 0.38,
                              .k = 5460,
                              .damping = 0.0066,
                              .npinned = 1,
                              .pinned = &corner};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  plane(scene, 0, 0, 1, -0.15, 0.22, 0.19);
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* Work of a run, the choice included, in evaluations */
static double work_of(const msim_sim *sim) {
  return sim->config.choice.total_cost + ms_pilot_run_count_work(sim);
}

/* Where error control costs least it makes the steps after an impact, too: the choice at the impact
 * and the run cost little more than under error control from the start, and tol is kept. */
static void error_control_continues_a_run(void **state) {
  (void)state;
  const double t_end = 0.4;
  msim_scene *scene = make_swinging_block();
  for (double tol = 1e-7; tol > 3e-9; tol /= 10) {
    const msim_options opt = options_of("auto", tol, t_end),
                       controlled = options_of("dop853", tol, t_end),
                       reference = options_of("dop853", 1e-11, t_end);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &controlled),
             *exact = make_sim(scene, &reference);
    assert_true(sim->config.choice.verification.planes_far);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_ok(msim_sim_run(other, NULL, NULL, err));
    assert_ok(msim_sim_run(exact, NULL, NULL, err));
    const msim_state s = state_of(sim), to = state_of(exact);
    const double most = largest_difference(s.x, to.x, 3 * s.n);
    print_message("  tol %.0e: %s%s, work %.3g of that under error control, error %.2g tol\n", tol,
                  sim->config.integrator->entry.name,
                  chosen_by(sim)->control_tol > 0 ? ", tol" : "", work_of(sim) / work_of(other),
                  most / tol);
    assert_true(chosen_by(sim)->control_tol > 0 && !ms_sim_has_control(sim));
    assert_true(stats_of(sim).contacts > 0);
    assert_int_equal(s.step, sim->config.plan.steps);
    assert_true(work_of(sim) < 2 * work_of(other));
    assert_true(most < tol);
    msim_sim_destroy(sim), msim_sim_destroy(other), msim_sim_destroy(exact);
  }
  msim_scene_destroy(scene);
}

/* A run resumed among such steps has the same bits. */
static void its_checkpoints_continue_it(void **state) {
  (void)state;
  msim_scene *scene = make_swinging_block();
  const msim_options opt = options_of("auto", 1e-7, 0.4);
  msim_sim *whole = make_sim(scene, &opt), *sim = make_sim(scene, &opt);
  const int64_t steps = sim->config.plan.steps, before = 3 * steps / 4;
  assert_ok(msim_sim_step(sim, before, err));
  assert_true(chosen_by(sim)->control_tol > 0);
  const checkpoint c = save(sim);
  msim_sim *resumed = resume(scene, &opt, &c);
  assert_ok(msim_sim_step(whole, steps, err));
  expect_same_end(whole, resumed, steps - before, "error control in substeps");
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(whole), msim_sim_destroy(resumed);
  msim_scene_destroy(scene);
}

/*------------------------------------- trials that end early ------------------------------------*/

/* A damped block of 1 kg that falls 2 cm onto a plane, and bounces; with error control costing less
 * than all fixed steps */
static msim_sim *make_bouncing_block(double t_end) {
  const double g[3] = {0, 0, -9.81};
  const msim_lattice block = {.size = sizeof block,
                              .n = {4, 4, 4},
                              .origin = {0, 0, 0.02},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 400,
                              .damping = 0.5};
  const msim_options opt = options_of("auto", 1e-5, t_end);
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  assert_ok(msim_scene_set_gravity(scene, g, err));
  msim_sim *sim = make_sim(scene, &opt);
  msim_scene_destroy(scene);
  return sim;
}

/* At the first impact error control takes many short steps, and costs more than what fixed steps
 * are expected to cost before they are tried. They turn out far more expensive: it is tried again,
 * and the choice costs less than half of the run. */
static void error_control_is_tried_again(void **state) {
  (void)state;
  const double t_end = 0.4;
  msim_sim *sim = make_bouncing_block(t_end);
  const ms_candidate *c = chosen_by(sim);
  print_message("  %s: %.3g evaluations, the choice %.3g\n", c->method->entry.name,
                c->cost_rate * t_end, sim->config.choice.total_cost);
  assert_true(c->control_tol > 0 && c->rejection == MS_REASON_NONE);
  assert_true(sim->config.choice.total_cost < c->cost_rate * t_end / 2);
  msim_sim_destroy(sim);
}

/* Trials of fixed steps end once they cost more than error control does. They are no candidates
 * then, whatever they were expected to cost. */
static void expensive_trials_are_rejected(void **state) {
  (void)state;
  msim_sim *sim = make_bouncing_block(0.4);
  const ms_method_choice *s = &sim->config.choice;
  int count = 0;
  for (const ms_candidate *c = s->candidates; c < s->candidates + MS_CANDIDATES; c++) {
    if (c->rejection != MS_REASON_COSTS_MORE) continue;
    assert_true(c->tried && c->cost_rate == INFINITY && c->error == 0);
    count++;
  }
  print_message("  %d trials ended early\n", count);
  assert_true(count > 0);
  msim_sim_destroy(sim);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(small_bodies_that_fall_from_afar_bounce),
                                     cmocka_unit_test(error_control_continues_a_run),
                                     cmocka_unit_test(its_checkpoints_continue_it),
                                     cmocka_unit_test(error_control_is_tried_again),
                                     cmocka_unit_test(expensive_trials_are_rejected)};
  return cmocka_run_group_tests_name("auto_impacts", tests, NULL, NULL);
}
