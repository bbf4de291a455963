/* Tests of error control with a larger tolerance, a candidate of integrator = auto where damping
 * limits the steps: when it is one, that it keeps tol, and what it saves. */
#include <math.h>
#include <string.h>

#include "auto_scenes.h"
#include "checkpoints.h"
#include "choose/candidates.h"
#include "choose/control_trial.h"
#include "choose/rejection_reasons.h"
#include "methods/methods.h"

static msim_scene *damped_sheet(void) { return hanging_cloth(12, 1000, 1); }

/* The candidates of a method with error control; *relaxed: that with a larger tolerance */
static const ms_candidate *find_controlled(const msim_sim *sim, const ms_integrator *method,
                                           const ms_candidate **relaxed) {
  const ms_candidate *found[2] = {NULL, NULL}, *all = sim->config.choice.candidates;
  int n = 0;
  for (const ms_candidate *c = all; c < all + MS_CANDIDATES; c++)
    if (c->method == method && c->control_tol > 0 && n < 2) found[n++] = c;
  assert_int_equal(n, 2);
  *relaxed = found[1];
  return found[0];
}

static const ms_integrator *const controlled_methods[] = {&ms_rk6, &ms_ssprk104};

/* It is where tol is small and the run long, damping limits the steps, and there are no planes;
 * else dop853 takes the place of rk6. In longer runs the method with tol itself is one only where
 * the larger tolerance has turned out too large. */
static void where_a_larger_tolerance_is_a_candidate(void **state) {
  (void)state;
  static const struct {
    double damping, tol, t_end;
    int planes, why, is_long;
  } row[] = {{1, 1e-3, 1, 0, MS_REASON_NONE, 1},
             {1, 1e-6, 1, 0, MS_REASON_NONE, 1},
             {1, 1e-3, 0.4, 0, MS_REASON_NONE, 0},
             {1, 3e-3, 1, 0, MS_REASON_NONE, 1},
             {1, 0.1 * 0.1, 1, 0, MS_REASON_NONE, 1},
             {1, 0.013, 1, 0, MS_REASON_NOT_RELAXED, 0},
             {1, 0.01, 0.1, 0, MS_REASON_NONE, 0},
             {1, 0.01, 0.02, 0, MS_REASON_NOT_RELAXED, 0},
             {1, 1e-3, 0.1, 0, MS_REASON_NOT_RELAXED, 0},
             {0.01, 1e-3, 5, 0, MS_REASON_WEAKLY_DAMPED, 1},
             {0, 1e-3, 5, 0, MS_REASON_UNDAMPED, 1},
             {1, 1e-3, 1, 1, MS_REASON_TRIAL_TOO_EXPENSIVE, 1}};
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    msim_scene *scene = hanging_cloth(12, 1000, row[i].damping);
    if (row[i].planes) plane(scene, 0, 0, 1, -0.05, 0.5, 0);
    const msim_options opt = options_of("auto", row[i].tol, row[i].t_end);
    msim_sim *sim = make_sim(scene, &opt);
    const int limited = row[i].damping == 1 && !row[i].planes;
    const ms_integrator *const methods[] = {limited ? &ms_rk6 : &ms_dop853, &ms_ssprk104};
    for (int k = 0; k < 2; k++) {
      const ms_candidate *relaxed, *with_tol = find_controlled(sim, methods[k], &relaxed);
      assert_close(with_tol->control_tol, row[i].tol, 0);
      assert_close(relaxed->control_tol, fmin(50, fmax(8, 0.1 / row[i].tol)) * row[i].tol, 0);
      if (row[i].why) assert_int_equal(relaxed->rejection, row[i].why);
      else assert_int_not_equal(relaxed->rejection, MS_REASON_NOT_RELAXED);
      const int replaced =
          row[i].why == 0 && row[i].is_long && relaxed->rejection != MS_REASON_ERROR_TOO_LARGE;
      assert_int_equal(with_tol->rejection == MS_REASON_RELAXED, replaced);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Where particles are so few that one event determines the error, dop853 remains. */
static void few_particles_keep_dop853(void **state) {
  (void)state;
  msim_scene *scene = swinging_rope(8, 1e4, 40);
  const msim_options opt = options_of("auto", 1e-5, 1);
  msim_sim *sim = make_sim(scene, &opt);
  const ms_candidate *relaxed;
  assert_int_equal(find_controlled(sim, &ms_dop853, &relaxed)->rejection, MS_REASON_NONE);
  assert_string_equal(sim->config.integrator->entry.name, "dop853");
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* Error control with tol costs 1.5 to 3 times as much, and its error is far smaller. */
static void it_keeps_tol_and_saves_evaluations(void **state) {
  (void)state;
  const double t_end = 1, extent = 1;
  msim_scene *scene = damped_sheet();
  const msim_options reference = options_of("dop853", 1e-11, t_end);
  msim_sim *exact = make_sim(scene, &reference);
  assert_ok(msim_sim_run(exact, NULL, NULL, err));
  int relaxed = 0;
  for (double tol = 1e-3; tol > 3e-7; tol /= 10) {
    const msim_options opt = options_of("auto", tol, t_end), own = options_of("dop853", tol, t_end);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &own);
    const double choice = sim->config.choice.total_cost, used = sim->config.opt.tol;
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_ok(msim_sim_run(other, NULL, NULL, err));
    const double ratio = ((double)stats_of(sim).force_evaluations + choice) /
                         (double)stats_of(other).force_evaluations;
    const msim_state a = state_of(sim), b = state_of(exact);
    const double error = largest_difference(a.x, b.x, 3 * a.n);
    print_message("  tol %.0e: %-10s with %.0e, error %.1e, %.2f of the evaluations of dop853\n",
                  tol, sim->config.integrator->entry.name, used, error, ratio);
    assert_true(error < tol * extent);
    assert_true(ratio < 0.8);
    relaxed += used > tol;
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  assert_true(relaxed >= 3);
  msim_sim_destroy(exact);
  msim_scene_destroy(scene);
}

/* Longer steps with a larger tolerance, and steps of another method of order 2, cost no less than
 * trials let expect: so neither is tried. E/h ~ h^3 in the estimate of ssprk104. */
static void trials_show_what_others_cost(void **state) {
  (void)state;
  msim_scene *scene = swinging_rope(32, 2e4, 8);
  const msim_options opt = options_of("auto", 1e-6, 0.5);
  msim_sim *sim = make_sim(scene, &opt);
  const ms_candidate *c = sim->config.choice.candidates, *with_tol = &c[MS_DAMPING_CONTROLLED],
                     *relaxed = &c[MS_DAMPING_RELAXED], *verlet = &c[MS_WITH_VELOCITIES];
  const double least = sim->config.choice.candidates[sim->config.choice.best].cost_rate;
  assert_true(with_tol->tried && !relaxed->tried && relaxed->error == 0);
  assert_close(relaxed->cost_rate, 10 / (with_tol->h * cbrt(50)), 1e-9);
  assert_true(relaxed->cost_rate > least);
  assert_true(c[MS_STABILISED].error > 0 && verlet->error == 0);
  assert_close(verlet->cost_rate, 2 / (3 * c[MS_STABILISED].h), 1e-9);
  assert_true(verlet->cost_rate > least && 2 / verlet->h < least);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* In a short run a candidate by the bound on its steps may turn out to take longer ones. */
static void steps_that_turn_out_too_long_are_rejected(void **state) {
  (void)state;
  msim_scene *scene = damped_sheet();
  const msim_options opt = options_of("auto", 1e-3, 0.5);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_state start = state_of(sim);
  ms_pilot_run run;
  assert_ok(ms_pilot_run_begin(sim, opt.tol, 0, &start, &run, err));
  assert_ok(ms_pilot_run_make(&run, err));
  assert_true(ms_control_trial_may_relax(&run, &ms_ssprk104));
  assert_false(ms_control_trial_relaxes_first(&run));
  assert_close(ms_control_trial_stable_step(&run, &ms_rk6),
               ms_pilot_run_stable_step(&run, &ms_ssprk104), 0);
  ms_candidate c = {.method = &ms_ssprk104,
                    .control_tol = ms_control_trial_relaxed_tol(opt.tol),
                    .h = MS_LOOSE * ms_pilot_run_stable_step(&run, &ms_ssprk104)};
  assert_ok(ms_control_trial_make(&run, INFINITY, &c, err));
  assert_true(c.control_tol * c.h > opt.tol * opt.t_end / 4);
  assert_int_equal(c.rejection, MS_REASON_ERROR_TOO_LARGE);
  ms_pilot_run_end(&run);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* The same trial serves a large tol, but not a small one. */
static void an_error_that_is_too_large_is_seen(void **state) {
  (void)state;
  msim_scene *scene = damped_sheet();
  const double control_tol = 0.05;
  const msim_options opt = options_of("auto", 1e-3, 1);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_state start = state_of(sim);
  for (int k = 0; k < 2; k++) {
    double error = 0;
    for (double tol = 1e-2; tol > 1e-11; tol /= 1e8) {
      ms_pilot_run run;
      assert_ok(ms_pilot_run_begin(sim, opt.tol, 0, &start, &run, err));
      assert_ok(ms_pilot_run_make(&run, err));
      run.tol = tol;
      ms_candidate c = {.method = controlled_methods[k],
                        .control_tol = control_tol,
                        .h = MS_LOOSE * ms_control_trial_stable_step(&run, controlled_methods[k])};
      assert_ok(ms_control_trial_make(&run, INFINITY, &c, err));
      assert_true(c.tried);
      if (tol < 1e-9) assert_int_equal(c.rejection, MS_REASON_ERROR_TOO_LARGE);
      else assert_int_equal(c.rejection, MS_REASON_NONE);
      if (error > 0) assert_close(c.error, error, 0);
      assert_true(isfinite(c.cost_rate) == !c.rejection && c.error > 1e-10 && c.error < 1e-2);
      error = c.error;
      ms_pilot_run_end(&run);
    }
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A run resumed from its middle ends with the same bits. */
static void its_checkpoints_continue_it(void **state) {
  (void)state;
  msim_scene *scene = damped_sheet();
  const msim_options opt = options_of("auto", 1e-3, 1);
  msim_sim *whole = make_sim(scene, &opt), *sim = make_sim(scene, &opt);
  assert_true(sim->config.opt.tol > opt.tol);
  assert_ok(msim_sim_step(sim, 50, err));
  const checkpoint c = save(sim);
  msim_sim *resumed = resume(scene, &opt, &c);
  assert_ok(msim_sim_run(whole, NULL, NULL, err));
  assert_ok(msim_sim_run(resumed, NULL, NULL, err));
  expect_same(whole, resumed, "a larger tolerance");
  free(c.bytes);
  msim_sim_destroy(whole), msim_sim_destroy(sim), msim_sim_destroy(resumed);
  msim_scene_destroy(scene);
}

/* In scenes of each kind the candidates of a resumed run are those of the run. */
static void checkpoints_name_all_candidates(void **state) {
  (void)state;
  const double damping[3] = {0, 0.01, 1};
  for (int k = 0; k < 3; k++) {
    msim_scene *scene = hanging_cloth(12, 1000, damping[k]);
    const msim_options opt = options_of("auto", 1e-3, 1);
    msim_sim *sim = make_sim(scene, &opt);
    const checkpoint c = save(sim);
    msim_sim *resumed = resume(scene, &opt, &c);
    for (int i = 0; i < MS_CANDIDATES; i++)
      assert_ptr_equal(resumed->config.choice.candidates[i].method,
                       sim->config.choice.candidates[i].method);
    free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(resumed);
    msim_scene_destroy(scene);
  }
}

/* Impacts have errors that damping does not remove: once a plane is close, error control goes on
 * with tol, also in a run resumed after that. */
static void planes_end_it(void **state) {
  (void)state;
  const double tol = 1e-3;
  msim_scene *scene = damped_sheet();
  plane(scene, 0, 0, 1, -0.8, 0.5, 0);
  const msim_options opt = options_of("auto", tol, 1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_true(sim->config.choice.verification.planes_far && sim->run.control.tol > tol);
  while (sim->config.choice.verification.planes_far) assert_ok(msim_sim_step(sim, 1, err));
  assert_close(sim->config.opt.tol, tol, 0);
  assert_close(sim->run.control.tol, tol, 0);
  const checkpoint c = save(sim);
  msim_sim *resumed = resume(scene, &opt, &c);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_ok(msim_sim_run(resumed, NULL, NULL, err));
  expect_same(sim, resumed, "planes");
  assert_true(stats_of(sim).contacts > 0);
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(resumed);
  msim_scene_destroy(scene);
}

/* A method that takes the place of another one makes the same steps as in a sim of its own, also if
 * its work vectors hold what the other has left: here dampers at pinned particles, not at 0. */
static void methods_do_not_see_what_others_leave(void **state) {
  (void)state;
  const double h = 1e-3;
  static const ms_integrator *const pairs[][2] = {
      {&ms_force_gradient, &ms_rkc}, {&ms_rkc, &ms_ssprk104}, {&ms_ssprk104, &ms_rk6}};
  msim_scene *scene = damped_sheet();
  for (int k = 0; k < 3; k++) {
    msim_options opt = options("dop853", h), own = options(pairs[k][1]->entry.name, h);
    opt.steps = own.steps = 4;
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &own);
    for (int i = 0; i < 2; i++) ms_sim_switch_method(sim, pairs[k][i], h);
    assert_ok(msim_sim_step(sim, 4, err));
    assert_ok(msim_sim_step(other, 4, err));
    expect_same_motion(sim, other);
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(where_a_larger_tolerance_is_a_candidate),
                                     cmocka_unit_test(few_particles_keep_dop853),
                                     cmocka_unit_test(it_keeps_tol_and_saves_evaluations),
                                     cmocka_unit_test(an_error_that_is_too_large_is_seen),
                                     cmocka_unit_test(trials_show_what_others_cost),
                                     cmocka_unit_test(steps_that_turn_out_too_long_are_rejected),
                                     cmocka_unit_test(its_checkpoints_continue_it),
                                     cmocka_unit_test(checkpoints_name_all_candidates),
                                     cmocka_unit_test(planes_end_it),
                                     cmocka_unit_test(methods_do_not_see_what_others_leave)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
