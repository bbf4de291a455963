/* Tests of checkpoints in whole runs: at frames, also inside a step; under error control; with
 * integrator = auto; with another end or other threads; after a state, a step or springs were set;
 * and loaded into the sim that was saved. */
#include <math.h>
#include <stdio.h>

#include "base/archive.h"
#include "checkpoints.h"
#include "error_control.h"

static msim_scene *cloth(void) { return hanging_cloth(SIDE, 300, 0); }
static msim_scene *damped(void) { return hanging_cloth(SIDE, 300, 0.05); }

/* It hits a plane. */
static msim_scene *ball(void) {
  const double x[3] = {0, 0, 0.01}, v[3] = {0.1, 0, -1};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  plane(scene, 0, 0, 1, 0, 0.5, 0.2);
  return scene;
}

/*------------------------------------- frames ---------------------------------------------------*/

enum { MOST_FRAMES = 250 };

typedef struct frame {
  int64_t step;
  double t;
  uint64_t hash;
} frame;

typedef struct frame_log {
  int n, stop_after; /* number of frames; the frame to stop after, 0: none */
  int after_step;    /* 1: stop by msim_sim_stop() after the next step, before its frames */
  frame frames[MOST_FRAMES];
} frame_log;

static int log_frame(msim_sim *sim, void *user) {
  frame_log *f = user;
  const msim_state s = state_of(sim);
  const size_t size = 3 * (size_t)s.n * sizeof *s.x;
  assert_true(f->n < MOST_FRAMES);
  f->frames[f->n++] =
      (frame){s.step, s.t, ms_archive_hash(ms_archive_hash(0, s.x, size), s.v, size)};
  if (f->n == f->stop_after && f->after_step) msim_sim_stop(sim);
  return f->n == f->stop_after && !f->after_step;
}

/* The whole run, and the run interrupted after some of its frames, which a clone or another sim
 * continues: the same frames and end. */
static void expect_same_frames(const msim_scene *scene, const msim_options *opt,
                               const char *label) {
  static frame_log whole, parts;
  const int has_times = opt->tol > 0 && !opt->every && strcmp(opt->integrator, "auto") != 0;
  whole.n = whole.stop_after = 0;
  msim_sim *sim = make_sim(scene, opt);
  assert_ok(msim_sim_run(sim, log_frame, &whole, err));
  for (int stop = 1; stop < whole.n; stop += 1 + whole.n / 7) {
    parts.n = 0, parts.stop_after = stop, parts.after_step = has_times && !parts.after_step;
    msim_sim *first = make_sim(scene, opt);
    const msim_status status = msim_sim_run(first, log_frame, &parts, NULL);
    if (!parts.after_step) assert_int_equal(status, MSIM_STOPPED);
    checkpoint c = {NULL, 0};
    msim_sim *second;
    if (stop % 2) assert_ok(msim_sim_clone(first, &second, err));
    else c = save(first), second = resume(scene, opt, &c);
    expect_same(first, second, label);
    if (state_of(first).step == 0) parts.n = 0; /* the frame of the start is shown again */
    parts.stop_after = 0;
    assert_ok(msim_sim_run(second, log_frame, &parts, err));
    if (parts.n != whole.n) fail_msg("%s: %d frames of %d", label, parts.n, whole.n);
    for (int i = 0; i < parts.n; i++)
      if (memcmp(&parts.frames[i], &whole.frames[i], sizeof *parts.frames))
        fail_msg("%s, stopped after %d frames: frame %d differs", label, stop, i);
    expect_same(sim, second, label);
    expect_same_save(sim, second, label);
    free(c.bytes);
    msim_sim_destroy(first), msim_sim_destroy(second);
  }
  msim_sim_destroy(sim);
}

/* Frames by default (some 200, many inside a step), few of them, and frames at steps */
static void frames_under_error_control(void **state) {
  (void)state;
  msim_scene *(*const scenes[])(void) = {cloth, damped, ball};
  const char *method;
  for (int32_t m = 0; (method = method_at(m)) != NULL; m++)
    for (int i = 0; i < 9; i++) {
      char label[100];
      if (!takes_tol(method) || (i / 3 == 1 && takes_positions_only(method))) continue;
      const int first_order = strstr(method, "euler") != NULL;
      msim_options opt = control_options(method, first_order ? 1e-2 : 1e-4, 0.05);
      opt.newton_rtol = 1e-6;
      if (i % 3 == 1) opt.fps = 90;
      if (i % 3 == 2) opt.every = 2;
      if (i % 3 == 2 && first_order) opt.every = 50;
      snprintf(label, sizeof label, "%s, scene %d, frames %d", method, i / 3, i % 3);
      msim_scene *scene = scenes[i / 3]();
      expect_same_frames(scene, &opt, label);
      msim_scene_destroy(scene);
    }
}

static void frames_of_fixed_steps(void **state) {
  (void)state;
  static const char *const methods[] = {"verlet", "dop853", "bdf2"};
  for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
    msim_scene *scene = cloth();
    msim_options opt = options(methods[m], 7e-4); /* lowered, so that a step ends at t_end */
    opt.steps = -1, opt.t_end = 0.05, opt.fps = 333;
    if (strcmp(methods[m], "dop853") == 0) opt.steps = 70;
    expect_same_frames(scene, &opt, methods[m]);
    msim_scene_destroy(scene);
  }
}

static void methods_that_auto_has_chosen(void **state) {
  (void)state;
  msim_scene *(*const scenes[])(void) = {cloth, damped, ball};
  static const double tols[] = {1e-2, 1e-4, 1e-7};
  for (int i = 0; i < 9; i++) {
    char label[40];
    msim_scene *scene = scenes[i / 3]();
    const msim_options opt = control_options("auto", tols[i % 3], 0.05);
    snprintf(label, sizeof label, "auto, scene %d, tol %g", i / 3, tols[i % 3]);
    expect_same_frames(scene, &opt, label);
    msim_scene_destroy(scene);
  }
}

/* A bar that falls on its end and slides: the dense output of a step depends on the contacts at its
 * end. */
static void frames_inside_a_step_that_ends_in_contact(void **state) {
  (void)state;
  static const char *const methods[] = {"dop853", "rk4", "bdf2"};
  const double x[6] = {0, 0, 0.01, 0.6, 0, 0.3}, mass[2] = {1, 2}, k = 300;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
  assert_ok(msim_scene_set_gravity(scene, (double[3]){0, 0, -9.81}, err));
  plane(scene, 0, 0, 1, 0, 0, 0.2);
  for (int m = 0; m < 3; m++) {
    msim_options opt = control_options(methods[m], 1e-4, 0.2);
    opt.fps = 1000;
    expect_same_frames(scene, &opt, methods[m]);
  }
  msim_scene_destroy(scene);
}

/* Then there is no last good state to be checked. */
static void without_energy_monitor(void **state) {
  (void)state;
  static const char *const methods[] = {"dop853", "velocity-verlet", "bdf2", "auto"};
  msim_scene *scene = cloth();
  for (int m = 0; m < 4; m++) {
    msim_options opt = control_options(methods[m], 1e-3, 0.05);
    opt.watch = MSIM_WATCH_OFF;
    expect_same_frames(scene, &opt, methods[m]);
  }
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.watch = MSIM_WATCH_OFF;
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_set_step(sim, 5e-4, err)); /* a new run, from step 10 on */
  assert_ok(msim_sim_step(sim, 3, err));
  const checkpoint c = save(sim);
  assert_ok(msim_sim_set_step(other, 5e-4, err));
  assert_ok(msim_sim_load(other, c.bytes, c.length, err));
  expect_same(sim, other, "after another step");
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

/* For another end auto would choose another method; a loaded checkpoint keeps its choice. */
static void auto_keeps_its_choice(void **state) {
  (void)state;
  msim_scene *scene = cloth();
  msim_options opt = control_options("auto", 1e-4, 0.1);
  msim_plan then = {.size = sizeof then}, now = then;
  const char *text;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  const checkpoint c = save(sim);
  opt.t_end = 3.2; /* also a whole number of steps */
  msim_sim *other = make_sim(scene, &opt);
  msim_sim_plan(sim, &then), msim_sim_plan(other, &now);
  assert_string_not_equal(then.integrator, now.integrator); /* otherwise nothing is tested */
  assert_ok(msim_sim_load(other, c.bytes, c.length, err));
  msim_sim_plan(other, &now);
  assert_string_equal(then.integrator, now.integrator);
  assert_true(then.h == now.h && then.tol == now.tol);
  assert_true(fabs(now.t_end - opt.t_end) < 1e-12);
  assert_ok(msim_sim_explain(other, &text, err));
  assert_non_null(strstr(text, then.integrator));
  assert_ok(msim_sim_step(sim, 3, err));
  assert_ok(msim_sim_step(other, 3, err));
  expect_same(sim, other, "auto");
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

/*------------------------------------- another end ----------------------------------------------*/

static msim_status load(msim_sim *sim, const checkpoint *c, msim_error *why) {
  return msim_sim_load(sim, c->bytes, c->length, why);
}

static void runs_may_end_elsewhere(void **state) {
  (void)state;
  msim_scene *scene = cloth();
  msim_error why;
  msim_options opt = options("bdf2", 1e-3);
  opt.t_end = 0.02;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const checkpoint c = save(sim);
  assert_ok(msim_sim_step(sim, 1, err)); /* single steps may go past the end */
  const checkpoint past = save(sim);
  msim_sim_destroy(resume(scene, &opt, &past));
  free(past.bytes);
  opt.t_end = 0.03, opt.every = 5, opt.threads = 2;
  msim_sim *whole = make_sim(scene, &opt), *longer = resume(scene, &opt, &c);
  assert_ok(msim_sim_run(whole, NULL, NULL, err));
  assert_ok(msim_sim_run(longer, NULL, NULL, err));
  assert_int_equal(state_of(longer).step, 30);
  expect_same(whole, longer, "to another end");
  msim_sim_destroy(longer);
  opt.t_end = 0.0305;
  longer = make_sim(scene, &opt);
  assert_int_equal(load(longer, &c, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "t_end = 0.0305 s requires h = 0.00098387"));
  for (int steps = 0; steps <= 10; steps += 10) {
    char text[100];
    opt.t_end = steps * 1e-3;
    msim_sim *shorter = make_sim(scene, &opt);
    assert_int_equal(load(shorter, &c, &why), MSIM_ERR_ARG);
    snprintf(text, sizeof text,
             "the run has %d steps, but the checkpoint was saved after 20; use more steps or a "
             "later t_end",
             steps);
    assert_string_equal(why.text, text);
    msim_sim_destroy(shorter);
  }
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(whole), msim_sim_destroy(longer);
  msim_scene_destroy(scene);
}

/* With another end the error allowed per second is the same, and so are the steps, up to those that
 * are shortened to meet the end. */
static void controlled_runs_may_end_elsewhere(void **state) {
  (void)state;
  msim_scene *scene = cloth();
  msim_error why;
  msim_options opt = control_options("velocity-verlet", 1e-4, 0.2);
  msim_sim *sim = make_sim(scene, &opt);
  while (state_of(sim).t < 0.1) assert_ok(msim_sim_step(sim, 1, err));
  const checkpoint c = save(sim);
  opt.t_end = 0.4, opt.fps = 40;
  msim_sim *longer = resume(scene, &opt, &c);
  assert_ok(msim_sim_step(longer, 3, err));
  assert_ok(msim_sim_step(sim, 3, err));
  expect_same(sim, longer, "on the way");
  frame_log f = {0};
  assert_ok(msim_sim_run(longer, log_frame, &f, err));
  assert_true(state_of(longer).t == 0.4);
  assert_true(f.frames[0].t > 0.1 && f.frames[0].t < 0.2 && f.n < 16);
  opt.t_end = 0.05;
  msim_sim *shorter = make_sim(scene, &opt);
  assert_int_equal(load(shorter, &c, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "t_end = 0.05 s lies before the checkpoint at t = 0.1"));
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(longer), msim_sim_destroy(shorter);
  msim_scene_destroy(scene);
}

/* Before the first step the state is that of the scene, bit for bit. */
static void from_the_start(void **state) {
  (void)state;
  msim_scene *scene = cloth();
  for (int32_t m = 0; method_at(m); m++) {
    const msim_options opt = options(method_at(m), 1e-3);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    const checkpoint c = save(sim);
    assert_ok(msim_sim_step(other, 3, err));
    assert_ok(load(other, &c, err));
    expect_same(sim, other, method_at(m));
    assert_ok(msim_sim_step(sim, 3, err));
    assert_ok(msim_sim_step(other, 3, err));
    expect_same(sim, other, method_at(m));
    free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- after changes --------------------------------------------*/

/* options.steps then counts the remaining steps. */
static void after_another_step_was_set(void **state) {
  (void)state;
  static const char *const methods[] = {"verlet", "newmark", "respa"};
  for (size_t m = 0; m < 3; m++) {
    msim_scene *scene = cloth();
    msim_options opt = options(methods[m], 1e-3);
    opt.steps = 30;
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 10, err));
    assert_ok(msim_sim_set_step(sim, 7e-4, err));
    assert_ok(msim_sim_step(sim, 5, err));
    const checkpoint c = save(sim);
    msim_error why;
    assert_int_equal(load(other, &c, &why), MSIM_ERR_ARG);
    assert_string_equal(why.text, "h is 0.001 here and 0.0007 in the checkpoint");
    assert_ok(msim_sim_set_step(other, 7e-4, err));
    assert_ok(load(other, &c, err));
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_ok(msim_sim_run(other, NULL, NULL, err));
    assert_int_equal(state_of(other).step, 30);
    expect_same(sim, other, methods[m]);
    free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(scene);
  }
}

/* No steps are left then; the run still has an end. */
static void after_steps_beyond_the_end(void **state) {
  (void)state;
  msim_scene *scene = cloth();
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.steps = 10;
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 15, err));
  assert_ok(msim_sim_set_step(sim, 7e-4, err));
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_int_equal(state_of(sim).step, 15);
  const checkpoint c = save(sim);
  assert_ok(msim_sim_set_step(other, 7e-4, err));
  assert_ok(load(other, &c, err));
  expect_same(sim, other, "beyond the end");
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

/* A state out of the plane of a planar scene, at another time and step: islands get a third
 * component. */
static void after_a_state_was_set(void **state) {
  (void)state;
  const double sideways[3] = {9.81, 0, 0};
  static const char *const methods[] = {"velocity-verlet", "bdf2"};
  msim_scene *scene = cloth();
  assert_ok(msim_scene_set_gravity(scene, sideways, err));
  for (size_t m = 0; m < 2; m++) {
    msim_options opt = options(methods[m], 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    const msim_state before = state_of(sim);
    double x[3 * N], v[3 * N];
    memcpy(x, before.x, sizeof x), memcpy(v, before.v, sizeof v);
    x[3 * 12 + 2] = 0.01;
    const msim_state start = {.size = sizeof start, .step = 7, .t = 2.5, .n = N, .x = x, .v = v};
    assert_ok(msim_sim_set_state(sim, &start, err));
    assert_ok(msim_sim_step(sim, 5, err));
    const checkpoint c = save(sim);
    msim_sim *other = resume(scene, &opt, &c), *there = make_sim(scene, &opt);
    expect_same(sim, other, methods[m]);
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(other, 5, err));
    expect_same(sim, other, methods[m]);
    const checkpoint flat = save(there); /* back to a state in the plane */
    assert_ok(load(other, &flat, err));
    expect_same(there, other, methods[m]);
    free(c.bytes), free(flat.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other), msim_sim_destroy(there);
  }
  msim_scene_destroy(scene);
}

/* A checkpoint stores springs that were set, as part of the scene. */
static void after_springs_were_set(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "respa", "linearly-implicit-euler"};
  msim_scene *scene = cloth();
  msim_scene_view view = {.size = sizeof view};
  msim_error why;
  double rest[200], k[200];
  msim_scene_get(scene, &view);
  for (int32_t e = 0; e < view.nsprings; e++) rest[e] = 1.1 * view.rest[e], k[e] = 350;
  for (size_t m = 0; m < 3; m++) {
    msim_options opt = options(methods[m], 1e-3);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_set_springs(sim, m < 2 ? k : NULL, rest, NULL, err));
    assert_ok(msim_sim_step(sim, 5, err));
    const checkpoint c = save(sim);
    assert_int_equal(load(other, &c, &why), MSIM_ERR_ARG);
    assert_string_equal(why.text, m < 2 ? "springs.k differs from that in the checkpoint"
                                        : "springs.rest differs from that in the checkpoint");
    assert_ok(msim_sim_set_springs(other, m < 2 ? k : NULL, rest, NULL, err));
    assert_ok(load(other, &c, err));
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(other, 5, err));
    expect_same(sim, other, methods[m]);
    free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(scene);
}

static const char *solver_of(const msim_sim *sim) {
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(sim, &plan);
  return plan.solver;
}

/* For the new springs alone another solver or another coarse space would be chosen. */
static void solvers_stay_as_they_were_chosen(void **state) {
  (void)state;
  enum { MOST_SPRINGS = 9000 };
  static const char *const solvers[] = {"auto", "pcg", "cholmod"};
  static double k[2][MOST_SPRINGS];
  msim_scene *scene = pinned_block(9, 1, 3000, 0);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  assert_true(view.nsprings <= MOST_SPRINGS);
  for (int32_t e = 0; e < view.nsprings; e++) k[0][e] = 1e8, k[1][e] = 100 + e % 7;
  for (size_t i = 0; i < 3; i++) {
    if (i != 1 && !is_solver_available("cholmod")) continue;
    msim_options opt = options("linearly-implicit-euler", 1.0 / 60);
    opt.solver = solvers[i];
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    for (int change = 0; change < 2; change++) {
      assert_ok(msim_sim_step(sim, 3, err));
      assert_ok(msim_sim_set_springs(sim, k[change], NULL, NULL, err));
      assert_ok(msim_sim_set_springs(other, k[change], NULL, NULL, err));
      for (int more = 0; more < 2; more++) {
        const checkpoint c = save(sim);
        assert_ok(load(other, &c, err));
        free(c.bytes);
        expect_same(sim, other, solvers[i]);
        assert_ok(msim_sim_step(sim, 3, err));
        assert_ok(msim_sim_step(other, 3, err));
        expect_same(sim, other, solvers[i]);
        assert_string_equal(solver_of(sim), i == 2 ? "cholmod" : "pcg");
      }
    }
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(scene);
}

/* Load an earlier checkpoint into the same sim: the steps since then leave no trace. */
static void back_in_the_same_sim(void **state) {
  (void)state;
  const char *method;
  for (int32_t m = 0; (method = method_at(m)) != NULL; m++) {
    msim_scene *scene = cloth();
    msim_options opt = options(method, 2e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 5, err));
    const checkpoint before = save(sim);
    assert_ok(msim_sim_step(sim, 10, err));
    const checkpoint after = save(sim);
    assert_ok(load(sim, &before, err));
    assert_ok(msim_sim_step(sim, 10, err));
    msim_sim *other = resume(scene, &opt, &after);
    expect_same(other, sim, method);
    free(before.bytes), free(after.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(frames_under_error_control),
                                     cmocka_unit_test(frames_of_fixed_steps),
                                     cmocka_unit_test(methods_that_auto_has_chosen),
                                     cmocka_unit_test(auto_keeps_its_choice),
                                     cmocka_unit_test(frames_inside_a_step_that_ends_in_contact),
                                     cmocka_unit_test(without_energy_monitor),
                                     cmocka_unit_test(from_the_start),
                                     cmocka_unit_test(runs_may_end_elsewhere),
                                     cmocka_unit_test(controlled_runs_may_end_elsewhere),
                                     cmocka_unit_test(after_another_step_was_set),
                                     cmocka_unit_test(after_steps_beyond_the_end),
                                     cmocka_unit_test(after_a_state_was_set),
                                     cmocka_unit_test(after_springs_were_set),
                                     cmocka_unit_test(solvers_stay_as_they_were_chosen),
                                     cmocka_unit_test(back_in_the_same_sim)};
  return cmocka_run_group_tests_name("checkpoint_runs", tests, NULL, NULL);
}
