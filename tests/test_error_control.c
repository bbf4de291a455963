/* Tests of error control: the meaning of tol, and steps that are too long. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "methods/methods.h"
#include "error_control.h"
#include "sim/sim.h"

/*------------------------------------- what tol means -------------------------------------------*/

/* The end of a run by a method of another family, with steps far shorter than needed. */
static void reference(const msim_scene *scene, double t_end, double *x) {
  const int steps = 4000;
  const msim_options opt = options("rk4", t_end / steps);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  memcpy(x, state_of(sim).x, 3 * N * sizeof *x);
  msim_sim_destroy(sim);
}

static double error_of(const msim_scene *scene, const char *method, double tol, double t_end,
                       const double *x) {
  const msim_options opt = control_options(method, tol, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_true(state_of(sim).t == t_end);
  const double error = rms_distance(state_of(sim).x, x);
  msim_sim_destroy(sim);
  return error;
}

static void check_errors(const char *method, int order, const msim_scene *scene, double t_end,
                         const double *x) {
  const double tol = order == 1 ? 0.03 : order == 2 ? 3e-4 : 1e-5, less = order > 2 ? 100 : 10;
  const double coarse = error_of(scene, method, tol, t_end, x);
  const double fine = error_of(scene, method, tol / less, t_end, x);
  print_message("  %-24s tol %-6g error %.2g, by tol/%g %.3g times less\n", method, tol, coarse,
                less, coarse / fine);
  assert_true(coarse < tol && coarse > 1e-4 * tol);
  assert_true(coarse / fine > less / 2.5);
  /* force-gradient: its error is nearly of order 6, its estimate assumes 4 */
  /* the estimate of ssprk104 has order 3, that of rk6 order 5 */
  const double power = strcmp(method, "ssprk104") == 0 ? 4. / 3
                       : strcmp(method, "rk6") == 0    ? 6. / 5
                                                       : 1;
  if (strcmp(method, "force-gradient") != 0) assert_true(coarse / fine < pow(less, power) * 2.5);
}

/* A tenth of tol gives about a tenth of the error. */
static void error_goes_like_tol(void **state) {
  (void)state;
  const double t_end = 0.6;
  double x[3 * N];
  for (int damped = 0; damped < 2; damped++) {
    msim_scene *scene = hanging_cloth(SIDE, 30, damped * 0.01);
    reference(scene, t_end, x);
    for (int32_t m = 0; method_at(m); m++)
      if (takes_tol(method_at(m)) && damped != takes_positions_only(method_at(m)))
        check_errors(method_at(m), msim_integrator_info(m)->order, scene, t_end, x);
    msim_scene_destroy(scene);
  }
}

/* dop853 uses error control by default, unless the number of steps is given. */
static void dop853_chooses_its_steps(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  msim_options opt = control_options("dop853", 0, 0.25),
               same = control_options("dop853", 1e-6, 0.25);
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &same);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_ok(msim_sim_run(other, NULL, NULL, err));
  same_state(sim, other);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  opt.steps = 10, opt.h = 1e-3;
  sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_int_equal(state_of(sim).step, 10);
  assert_true(state_of(sim).t == 10 * 1e-3);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The time, a sum of many steps, is as accurate as one product. */
static void time_adds_up(void **state) {
  (void)state;
  const double x[3] = {0}, v[3] = {1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 0);
  const msim_options opt = control_options("dop853", 1e-3, -1);
  msim_sim *sim = make_sim(scene, &opt);
  for (int i = 0; i < 20000; i++) {
    assert_ok(msim_sim_set_step(sim, 0.1, err));
    assert_ok(msim_sim_step(sim, 1, err));
  }
  assert_close(state_of(sim).t, 2000, 3e-13);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- rejected steps -------------------------------------------*/

/* Growth and shrinkage are limited, and a step that was shortened does not grow at once. */
static void steps_grow_with_care(void **state) {
  (void)state;
  const double none = 0, huge = 1e9, twice = 2, nan = NAN;
  ms_control c = {.tol = 1e-4, .span = 1, .order = 2, .h = 1, .growth = 5, .safety = 0.85};
  assert_true(ms_control_update(&c, 1, none, MS_NOWHERE));
  assert_close(c.h, 5, 0);
  assert_false(ms_control_update(&c, 1, huge, MS_NOWHERE));
  assert_close(c.h, 0.2, 0);
  assert_false(ms_control_update(&c, 1, nan, MS_NOWHERE));
  assert_close(c.h, 0.2, 0);
  assert_false(ms_control_update(&c, 1, twice, MS_NOWHERE));
  assert_close(c.h, 0.85 * sqrt(0.5), 1e-15);
  assert_true(ms_control_update(&c, c.h, none, MS_NOWHERE));
  assert_close(c.h, 0.85 * sqrt(0.5), 1e-15);
  assert_true(ms_control_update(&c, c.h, none, MS_NOWHERE));
  assert_true(c.h > 2);
  ms_control_reject_failed(&c, 1);
  assert_close(c.h, 0.25, 0);
  /* the last steps before the end are not extremely short */
  assert_close(ms_control_next_step(&c, 0.2), 0.2, 0);
  assert_close(ms_control_next_step(&c, 0.26), 0.13, 0);
  assert_close(ms_control_next_step(&c, 0.6), 0.25, 0);
}

/* After a rejected step the sim makes the step that it would have made if it had been tried
 * first. */
static void rejected_steps_leave_no_trace(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (!takes_tol(method_at(m))) continue;
    msim_scene *scene = hanging_cloth(SIDE, 30, 0);
    plane(scene, 0.1, 0, 1, -1e-6, 0.5, 0.1);
    msim_options opt = control_options(method_at(m), 1e-3, 10);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    for (int i = 0; i < 60; i++) {
      const int64_t before = stats_of(sim).rejected_steps;
      const double t = state_of(sim).t;
      if (i % 20 == 10) assert_ok(msim_sim_set_step(sim, 0.3, err));
      const double unused = sim->run.control.unused;
      assert_ok(msim_sim_step(sim, 1, err));
      if (i % 20 == 10) assert_true(stats_of(sim).rejected_steps > before);
      /* the other sim is given the step that was found, before it was shortened to an impact, and
       * what the steps before have left */
      const ms_stepper *s = &sim->islands->stepper;
      assert_ok(msim_sim_set_step(other, s->h_made > 0 ? s->h_made : s->h, err));
      other->run.control.unused = unused;
      assert_ok(msim_sim_step(other, 1, err));
      assert_true(state_of(sim).t > t);
      same_state(sim, other);
    }
    assert_int_equal(stats_of(other).rejected_steps, 0);
    assert_int_equal(stats_of(sim).steps, 60);
    assert_true(stats_of(sim).contacts > 0);
    assert_int_equal(stats_of(sim).contacts, stats_of(other).contacts);
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(scene);
  }
}

/* A method that fails if a step is too long, or has an error that does not depend on the step. */
static struct {
  const ms_integrator *real;
  double longest, noise;
  int calls;
} limited_method;

static msim_status limited_step(ms_stepper *s, msim_error *err) {
  if (s->h > limited_method.longest)
    return ms_error_set(err, MSIM_NOT_CONVERGED, "too long for the test");
  msim_status status = limited_method.real->step(s, err);
  s->v_next[7] += limited_method.noise * (limited_method.calls++ % 3);
  return status;
}

static ms_integrator install_limited_method(msim_sim *sim, double longest, double noise) {
  ms_integrator spy = *sim->config.integrator;
  limited_method.real = sim->config.integrator, limited_method.longest = longest,
  limited_method.noise = noise, limited_method.calls = 0;
  spy.step = limited_step;
  return spy;
}

static void no_step_is_short_enough(void **state) {
  (void)state;
  static const double longest[] = {INFINITY, 0};
  static const char *const words[] = {"the error exceeds tol = 0.001 even with h = ",
                                      "s: too long for the test"};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene = hanging_cloth(SIDE, 30, 0);
    const msim_options opt = control_options("velocity-verlet", 1e-3, 1);
    msim_sim *sim = make_sim(scene, &opt), *start = make_sim(scene, &opt);
    const ms_integrator spy = install_limited_method(sim, longest[i], 0.1);
    msim_error why;
    char particle[32];
    sim->config.integrator = &spy;
    assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_CONVERGED);
    assert_non_null(strstr(why.text, words[i]));
    assert_non_null(strstr(why.text, "step 1, t = "));
    snprintf(particle, sizeof particle, "particle %d:", sim->islands->model.unknowns.particle[7]);
    if (i == 0) assert_non_null(strstr(why.text, particle));
    same_state(sim, start);
    limited_method.noise = 0,
    limited_method.longest = INFINITY; /* the sim goes on from the same state */
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(start, 5, err));
    same_state(sim, start);
    msim_sim_destroy(sim), msim_sim_destroy(start);
    msim_scene_destroy(scene);
  }
}

/* Under error control a step that fails is shortened. */
static void steps_that_fail_are_shortened(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0);
  const msim_options opt = control_options("dop853", 1e-3, 1);
  msim_sim *sim = make_sim(scene, &opt);
  const ms_integrator spy = install_limited_method(sim, 1e-3, 0);
  sim->config.integrator = &spy;
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_true(state_of(sim).t == 1);
  assert_true(stats_of(sim).steps >= 1000 && stats_of(sim).rejected_steps > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A fixed step is divided into parts of equal length, which end where the whole step would. */
static void fixed_steps_are_made_in_parts(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (strcmp(method_at(m), "verlet") == 0 || strcmp(method_at(m), "respa") == 0) continue;
    if (strcmp(method_at(m), "takahashi-imada") == 0) continue; /* its variables depend on h */
    msim_scene *scene = hanging_cloth(SIDE, 30, 0);
    msim_options opt = options(method_at(m), 4e-3);
    opt.solver = "pcg", opt.newton_retries = 2;
    msim_sim *sim = make_sim(scene, &opt);
    opt.h = 1e-3, opt.newton_retries = 0;
    msim_sim *fine = make_sim(scene, &opt);
    const ms_integrator spy = install_limited_method(sim, 1.5e-3, 0);
    sim->config.integrator = &spy;
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(fine, 20, err));
    assert_int_equal(state_of(sim).step, 5);
    assert_int_equal(stats_of(sim).rejected_steps, 10);
    assert_memory_equal(state_of(sim).x, state_of(fine).x, 3 * N * sizeof(double));
    assert_memory_equal(state_of(sim).v, state_of(fine).v, 3 * N * sizeof(double));
    limited_method.longest = 0.9e-3; /* not even four parts are short enough */
    msim_error why;
    assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_CONVERGED);
    assert_non_null(strstr(why.text, "step 6, t = 0.024 s"));
    assert_memory_equal(state_of(sim).x, state_of(fine).x, 3 * N * sizeof(double));
    msim_sim_destroy(sim), msim_sim_destroy(fine);
    msim_scene_destroy(scene);
  }
}

/* Six halvings by default, and only where a step solves a nonlinear equation. */
static void nonlinear_steps_are_retried_by_default(void **state) {
  (void)state;
  const double h = 4e-3;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0);
  for (int32_t m = 0; method_at(m); m++) {
    const msim_options opt = options(method_at(m), h);
    msim_sim *sim = make_sim(scene, &opt);
    const int nonlinear = sim->config.integrator->nonlinear;
    const ms_integrator spy = install_limited_method(sim, 1.01 * h / 64, 0);
    sim->config.integrator = &spy;
    assert_int_equal(msim_sim_step(sim, 1, NULL), nonlinear ? MSIM_OK : MSIM_NOT_CONVERGED);
    assert_int_equal(stats_of(sim).rejected_steps, nonlinear ? 6 : 0);
    limited_method.longest = 0.99 * h / 64;
    assert_int_equal(msim_sim_step(sim, 1, NULL), MSIM_NOT_CONVERGED);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* Whole and divided steps alternate: the coefficients follow the ratio of steps. */
static double bdf2_by_turns(const msim_scene *scene, int steps, const double *x) {
  msim_options opt = options("bdf2", 0.2 / steps);
  opt.solver = "pcg", opt.newton_retries = 1;
  msim_sim *sim = make_sim(scene, &opt);
  const ms_integrator spy = install_limited_method(sim, INFINITY, 0);
  sim->config.integrator = &spy;
  for (int i = 0; i < steps; i++) {
    limited_method.longest = i % 2 ? 0.6 * opt.h : INFINITY;
    assert_ok(msim_sim_step(sim, 1, err));
  }
  assert_int_equal(stats_of(sim).rejected_steps, steps / 2);
  const double error = rms_distance(state_of(sim).x, x);
  msim_sim_destroy(sim);
  return error;
}

static void bdf2_keeps_its_order(void **state) {
  (void)state;
  double x[3 * N];
  msim_scene *scene = hanging_cloth(SIDE, 30, 0);
  reference(scene, 0.2, x);
  const double order = log2(bdf2_by_turns(scene, 80, x) / bdf2_by_turns(scene, 160, x));
  print_message("  bdf2, with steps of two lengths: order %.3f\n", order);
  assert_close(order, 2, 0.15);
  msim_scene_destroy(scene);
}

/* Even with an error of 0 a step is at most twice as long as the one before: beyond a ratio of 1 +
 * sqrt 2 earlier errors would grow. */
static void bdf2_grows_with_care(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 0); /* no error at all */
  const msim_options opt = control_options("bdf2", 1e-6, 10);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_set_step(sim, 1e-3, err));
  for (double h = 1e-3; h < 1; h *= 2) {
    assert_ok(msim_sim_step(sim, 1, err));
    assert_close(sim->islands->stepper.h, h, 1e-12);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- the plan -------------------------------------------------*/

static void expect_explained(msim_options opt, const char *sentence) {
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_sim *sim = make_sim(scene, &opt);
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  if (!strstr(text, sentence)) fail_msg("\"%s\" lacks \"%s\"", text, sentence);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void explain_tells_what_tol_is_of(void **state) {
  (void)state;
  msim_options opt = control_options("rk4", 1e-6, -1);
  expect_explained(opt, "tol refers to one second, as the run has no t_end");
  opt.t_end = 0.5, opt.fps = 50;
  expect_explained(opt, "to t = 0.5 s; 26 frames if the run is recorded");
  expect_explained(opt, "relative to the extent, 1 m, and the speed, 3.132 m/s");
  opt.every = 7;
  expect_explained(opt, "to t = 0.5 s; one frame per 7 steps if the run is recorded");
  opt.h = 1e-5;
  expect_explained(opt, "the first h to try is 1e-05 s");
}

/* The first step that msim chooses is not rejected, and is too short by no more than three steps
 * correct. */
static void the_first_step_is_found(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0);
  msim_options opt = control_options("rk4", 1e-6, 1);
  opt.h = MSIM_H_AUTO;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  const double first = state_of(sim).t;
  assert_int_equal(stats_of(sim).rejected_steps, 0);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const double mean = 1 / (double)stats_of(sim).steps;
  assert_true(first > 0.01 * mean && first < mean);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- refusals -------------------------------------------------*/

static void refused(msim_options opt, const char *sentence) {
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_sim *sim;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  if (!strstr(why.text, sentence)) fail_msg("\"%s\" lacks \"%s\"", why.text, sentence);
  msim_scene_destroy(scene);
}

/* A light pendulum on a spring; others: also a heavy particle in free fall and a distant pinned
 * one, not connected with it. */
static msim_scene *light_pendulum(int others) {
  const double x[12] = {0, 0, 0, 1, 0, 0, 3, 0, 0, 1e4, 0, 0.5}, mass[4] = {1, 1e-3, 1e6, 1};
  const double k = 10, rest = 0.9, gravity[3] = {0, 0, -9.81};
  const int32_t ij[2] = {0, 1}, pinned[2] = {0, 3};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, others ? 4 : 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, others ? 2 : 1, pinned, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  return scene;
}

/* Reference: SciPy's DOP853 at rtol 1e-13 */
static void unconnected_particles_do_not_affect_the_error(void **state) {
  (void)state;
  const double x[3] = {0.4055658451379508, 0, -0.8138252767103161};
  msim_scene *alone = light_pendulum(0), *beside = light_pendulum(1);
  for (int32_t m = 0; method_at(m); m++) {
    const ms_integrator *method = ms_methods_at(m);
    const double tol = method->entry.order > 2 ? 1e-6 : 1e-3;
    if (!takes_tol(method_at(m)) || method->entry.order == 1) continue;
    msim_options opt = control_options(method_at(m), tol, 4);
    opt.h = 1e-4; /* the default of the first step depends on the scale of the whole scene */
    msim_sim *sim = make_sim(alone, &opt), *other = make_sim(beside, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_ok(msim_sim_run(other, NULL, NULL, err));
    assert_int_equal(stats_of(sim).steps, stats_of(other).steps);
    for (int c = 0; c < 3; c++) assert_close(state_of(other).x[3 + c], x[c], 10 * tol);
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(alone), msim_scene_destroy(beside);
}

/* A light particle oscillates on a soft spring around a heavy one, and both fall: its error counts
 * although its mass is a millionth of that of its part. */
static void light_particles_count(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 1, 0, 0}, v[6] = {0, 0, 0, 0, 1, 0}, mass[2] = {1e3, 1e-3};
  const double k = 0.1, rest = 0.8, gravity[3] = {0, 0, -9.81};
  const int32_t ij[2] = {0, 1};
  double at[2][6];
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  for (int i = 0; i < 2; i++) {
    const msim_options opt = control_options("dop853", i ? 1e-12 : 1e-5, 10);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    memcpy(at[i], state_of(sim).x, sizeof *at);
    msim_sim_destroy(sim);
  }
  for (int c = 0; c < 2; c++) assert_close(at[0][3 + c], at[1][3 + c], 1e-5);
  msim_scene_destroy(scene);
}

static void what_cannot_be_is_refused(void **state) {
  (void)state;
  msim_options opt = control_options("rk4", 1e-6, 1);
  opt.steps = 5;
  refused(opt, "tol and steps exclude each other");
  refused(control_options("verlet", 1e-3, 1), "'verlet' has no error control; remove tol");
  refused(control_options("respa", 1e-3, 1),
          "(not verlet, respa, takahashi-imada), for example dop853");
  refused(control_options("rk4", -1, 1), "tol is '-1'");
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_error why;
  opt = control_options("dop853", 0, -1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_run(sim, NULL, NULL, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "no end"));
  assert_ok(msim_sim_step(sim, 3, err)); /* steps may be made */
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(error_goes_like_tol),
      cmocka_unit_test(dop853_chooses_its_steps),
      cmocka_unit_test(time_adds_up),
      cmocka_unit_test(steps_grow_with_care),
      cmocka_unit_test(rejected_steps_leave_no_trace),
      cmocka_unit_test(no_step_is_short_enough),
      cmocka_unit_test(steps_that_fail_are_shortened),
      cmocka_unit_test(fixed_steps_are_made_in_parts),
      cmocka_unit_test(nonlinear_steps_are_retried_by_default),
      cmocka_unit_test(bdf2_keeps_its_order),
      cmocka_unit_test(bdf2_grows_with_care),
      cmocka_unit_test(explain_tells_what_tol_is_of),
      cmocka_unit_test(the_first_step_is_found),
      cmocka_unit_test(unconnected_particles_do_not_affect_the_error),
      cmocka_unit_test(light_particles_count),
      cmocka_unit_test(what_cannot_be_is_refused)};
  return cmocka_run_group_tests_name("error_control", tests, NULL, NULL);
}
