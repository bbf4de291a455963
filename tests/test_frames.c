/* Tests of frames under error control: they are at their times, and observing a run changes no
 * bit. */
#include <math.h>
#include <string.h>

#include "checkpoints.h"
#include "counting_allocator.h"
#include "error_control.h"
#include "sim/frames.h"
#include "sim/sim.h"

enum { FRAMES = 64 };
typedef struct frame_log {
  int count, stop_at, looks;
  int64_t step[FRAMES];
  double t[FRAMES], x[FRAMES][3 * N], v[FRAMES][3 * N];
} frame_log;

static int log_frame(msim_sim *sim, void *user) {
  frame_log *f = user;
  assert_true(f->count < FRAMES);
  if (f->looks) {
    const msim_state s = state_of(sim);
    double force[3 * N];
    f->t[f->count] = s.t, f->step[f->count] = s.step;
    memcpy(f->x[f->count], s.x, sizeof f->x[0]);
    memcpy(f->v[f->count], s.v, sizeof f->v[0]);
    msim_sim_force(sim, s.x, s.v, force); /* a computation in the callback */
  }
  return ++f->count == f->stop_at;
}

static void frames_are_on_time(void **state) {
  (void)state;
  static frame_log f, g;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  for (int32_t m = 0; method_at(m); m++) {
    const char *method = method_at(m);
    const int order = msim_integrator_info(m)->order;
    if (!takes_tol(method) || takes_positions_only(method) || order == 1) continue;
    msim_options opt = control_options(method, order > 2 ? 1e-5 : 1e-3, 0.25);
    opt.fps = 100;
    msim_sim *sim = make_sim(scene, &opt), *alone = make_sim(scene, &opt);
    msim_sim *blind = make_sim(scene, &opt), *pieces = make_sim(scene, &opt);
    f = (frame_log){.looks = 1}, g = (frame_log){.looks = 1, .stop_at = 7};
    assert_ok(msim_sim_run(sim, log_frame, &f, err));
    assert_int_equal(f.count, 26);
    for (int i = 0; i < 26; i++) assert_close(f.t[i], i == 25 ? 0.25 : i / 100., 1e-15);
    assert_true(f.t[25] == 0.25 && f.t[0] == 0);
    /* the same bits without a callback, with one that reads no state, and in interrupted runs,
     * which miss no frame */
    assert_ok(msim_sim_run(alone, NULL, NULL, err));
    same_state(sim, alone);
    frame_log *unseen = &(frame_log){0};
    assert_ok(msim_sim_run(blind, log_frame, unseen, err));
    assert_int_equal(stats_of(blind).force_evaluations, stats_of(alone).force_evaluations);
    assert_true(stats_of(sim).force_evaluations > stats_of(alone).force_evaluations);
    assert_int_equal(msim_sim_run(pieces, log_frame, &g, NULL), MSIM_STOPPED);
    msim_sim_stop(pieces);
    assert_int_equal(msim_sim_run(pieces, log_frame, &g, NULL), MSIM_STOPPED);
    assert_ok(msim_sim_run(pieces, log_frame, &g, err));
    same_state(sim, pieces);
    assert_int_equal(g.count, 26);
    assert_memory_equal(f.t, g.t, sizeof f.t);
    assert_memory_equal(f.x, g.x, sizeof f.x);
    assert_memory_equal(f.v, g.v, sizeof f.v);
    msim_sim_destroy(sim), msim_sim_destroy(alone), msim_sim_destroy(blind);
    msim_sim_destroy(pieces);
  }
  msim_scene_destroy(scene);
}

/* States shown between two steps are as accurate as the steps. */
static void frames_are_accurate(void **state) {
  (void)state;
  static frame_log f;
  static const char *const methods[] = {"dop853", "rk4", "velocity-verlet"};
  static const double tols[] = {1e-8, 1e-5, 1e-3}, bounds[] = {1e-8, 1e-5, 1e-3};
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  const msim_options fixed = options("rk4", 5e-4);
  for (int m = 0; m < 3; m++) {
    msim_options opt = control_options(methods[m], tols[m], 0.25);
    opt.fps = 200;
    msim_sim *sim = make_sim(scene, &opt), *exact = make_sim(scene, &fixed);
    f = (frame_log){.looks = 1};
    assert_ok(msim_sim_run(sim, log_frame, &f, err));
    assert_int_equal(f.count, 51);
    for (int i = 1; i < f.count; i++) {
      assert_ok(msim_sim_step(exact, 10, err));
      const msim_state s = state_of(exact);
      assert_close(rms_distance(f.x[i], s.x), 0, bounds[m]);
      assert_close(rms_distance(f.v[i], s.v), 0, 30 * bounds[m]);
    }
    msim_sim_destroy(sim), msim_sim_destroy(exact);
  }
  msim_scene_destroy(scene);
}

/* `every` counts accepted steps. */
static void frames_by_steps(void **state) {
  (void)state;
  static frame_log f;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  msim_options opt = control_options("dop853", 1e-6, 0.25);
  opt.every = 4;
  msim_sim *sim = make_sim(scene, &opt);
  f = (frame_log){.looks = 1};
  assert_ok(msim_sim_run(sim, log_frame, &f, err));
  const int64_t steps = state_of(sim).step;
  assert_int_equal(f.count, 1 + (steps + 3) / 4);
  for (int i = 0; i < f.count; i++) assert_int_equal(f.step[i], i + 1 < f.count ? 4 * i : steps);
  assert_true(f.t[f.count - 1] == 0.25);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Runs that are stopped after each step miss no frame, not even those of the steps where they
 * stop. */
static void stops_miss_no_frame(void **state) {
  (void)state;
  static frame_log f, g;
  static const char *const methods[] = {"velocity-verlet", "dop853"};
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  for (int i = 0; i < 6; i++) {
    msim_options opt = options(methods[i / 3], 1e-2);
    opt.steps = -1, opt.t_end = 0.25, opt.every = 1 + 2 * (i % 3);
    if (i >= 3) opt = control_options(methods[1], 1e-6, 0.25), opt.every = 1 + 2 * (i % 3);
    msim_sim *whole = make_sim(scene, &opt), *pieces = make_sim(scene, &opt);
    f = (frame_log){.looks = 1}, g = (frame_log){.looks = 1};
    assert_ok(msim_sim_run(whole, log_frame, &f, err));
    int stops = 0;
    do msim_sim_stop(pieces), stops++;
    while (msim_sim_run(pieces, log_frame, &g, NULL) == MSIM_STOPPED);
    assert_int_equal(stops, 1 + state_of(whole).step);
    assert_int_equal(f.count, g.count);
    assert_memory_equal(f.step, g.step, sizeof f.step);
    assert_memory_equal(f.x, g.x, sizeof f.x);
    msim_sim_destroy(whole), msim_sim_destroy(pieces);
  }
  msim_scene_destroy(scene);
}

/* msim_sim_run shows no frame that msim_sim_step has passed, nor the first one twice. */
static void steps_pass_frames(void **state) {
  (void)state;
  static frame_log f;
  static const double ends[] = {0, 0.05, 0.3};
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  for (int i = 0; i < 3; i++) {
    msim_options opt = control_options("dop853", 1e-6, 0.25);
    opt.fps = 100;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 0, err));
    while (state_of(sim).t < ends[i]) assert_ok(msim_sim_step(sim, 1, err));
    const double now = state_of(sim).t;
    f = (frame_log){.looks = 1};
    assert_ok(msim_sim_run(sim, log_frame, &f, err));
    assert_int_equal(f.count, i == 0 ? 26 : i == 1 ? 25 - (int)floor(100 * now) : 0);
    for (int k = 1; k < f.count; k++) assert_close(f.t[k] - f.t[k - 1], 0.01, 1e-15);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* Steps are counted from the state that was set, and so is the end. */
static void the_number_of_the_first_step_is_any(void **state) {
  (void)state;
  static frame_log f;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.steps = 10, opt.every = 4;
  msim_sim *sim = make_sim(scene, &opt);
  msim_state s = state_of(sim);
  s.step = 160;
  assert_ok(msim_sim_set_state(sim, &s, err));
  f = (frame_log){.looks = 1};
  assert_ok(msim_sim_run(sim, log_frame, &f, err));
  assert_int_equal(f.count, 4);
  assert_memory_equal(f.step, ((int64_t[]){160, 164, 168, 170}), 4 * sizeof *f.step);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A run whose end is its start has one frame, however many it would have otherwise. */
static void a_run_without_length_has_one_frame(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  const msim_options opt = control_options("dop853", 1e-6, 0);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(ms_frames_count(&sim->config.plan, &sim->config.opt, 1000), 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Where the time between frames is longer than the run, by any factor, the frames are its start and
 * its end. */
static void frames_may_be_rarer_than_runs(void **state) {
  (void)state;
  static const double rates[] = {3, 1e-3, 1e-9, 1e-15, 1e-300, 4.9e-324};
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  for (size_t i = 0; i < 2 * sizeof rates / sizeof *rates; i++) {
    msim_options opt = i % 2 ? control_options("dop853", 1e-4, 0.25) : options("rk4", 1e-3);
    opt.t_end = 0.25;
    opt.fps = rates[i / 2];
    msim_sim *sim = make_sim(scene, &opt);
    assert_int_equal(ms_frames_count(&sim->config.plan, &sim->config.opt, 1000), 2);
    frame_log f = {.looks = 1};
    assert_ok(msim_sim_run(sim, log_frame, &f, err));
    assert_int_equal(f.count, 2);
    assert_true(f.t[0] == 0);
    assert_close(f.t[1], 0.25, 1e-15);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* For other frames in the sim that continues, the next one is the first after that shown last. */
static void a_resumed_run_may_have_other_frames(void **state) {
  (void)state;
  static frame_log f;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  for (int i = 0; i < 3; i++) { /* another fps, another end with frames by default, no `every` */
    msim_options opt = control_options("dop853", 1e-4, 0.25);
    if (i == 0) opt.fps = 2000;
    if (i == 2) opt.every = 2;
    msim_sim *first = make_sim(scene, &opt);
    f = (frame_log){.stop_at = 4, .looks = 1};
    assert_int_equal(msim_sim_run(first, log_frame, &f, NULL), MSIM_STOPPED);
    const double shown = f.t[3];
    const checkpoint c = save(first);
    if (i == 0) assert_true(shown < first->run.t - 2e-3); /* several frames inside the step */
    double interval = i == 0 ? 1. / 1500 : 0.5 / 200;
    if (i == 0) opt.fps = 1500;
    if (i > 0) opt.every = 0, opt.t_end = 0.5;
    msim_sim *second = make_sim(scene, &opt);
    assert_ok(msim_sim_load(second, c.bytes, c.length, err));
    f = (frame_log){.stop_at = 1, .looks = 1};
    assert_int_equal(msim_sim_run(second, log_frame, &f, NULL), MSIM_STOPPED);
    assert_close(f.t[0], interval * (floor(shown / interval) + 1), 1e-14);
    free(c.bytes);
    msim_sim_destroy(first), msim_sim_destroy(second);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- setters, threads -----------------------------------------*/

static frame_log plain;

/* The first state is read after the change, at a frame inside the step before it. */
static int change_springs_at_frame(msim_sim *sim, void *user) {
  frame_log *f = user;
  if (++f->count != 10) return 0;
  static double k[200];
  for (int i = 0; i < 200; i++) k[i] = 60;
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  const msim_state s = state_of(sim);
  assert_true(s.t == plain.t[9] && s.t < sim->run.t);
  assert_memory_equal(s.x, plain.x[9], sizeof plain.x[9]);
  assert_memory_equal(s.v, plain.v[9], sizeof plain.v[9]);
  return 0;
}

/* Frames inside the last step are computed with the springs of that step. */
static void springs_change_between_steps(void **state) {
  (void)state;
  static frame_log f;
  static const char *const methods[] = {"dop853", "rk4", "velocity-verlet", "implicit-midpoint"};
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  for (int m = 0; m < 4; m++) {
    msim_options opt = control_options(methods[m], 1e-3, 0.25);
    opt.fps = 200;
    msim_sim *soft = make_sim(scene, &opt), *sim = make_sim(scene, &opt);
    plain = (frame_log){.looks = 1}, f = (frame_log){0};
    assert_ok(msim_sim_run(soft, log_frame, &plain, err));
    assert_ok(msim_sim_run(sim, change_springs_at_frame, &f, err));
    assert_int_equal(f.count, 51);
    assert_true(rms_distance(state_of(sim).x, state_of(soft).x) > 1e-4);
    msim_sim_destroy(sim), msim_sim_destroy(soft);
  }
  msim_scene_destroy(scene);
}

static void a_state_that_is_set_starts_a_run(void **state) {
  (void)state;
  static frame_log f;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  msim_options opt = control_options("dop853", 1e-6, 0.25);
  opt.fps = 100;
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  const msim_state there = state_of(sim);
  assert_true(there.h == sim->run.control.h); /* the next step to try */
  sim->run.t_rounding = 0x1p-60;              /* as other steps may leave it */
  assert_ok(msim_sim_set_state(other, &there, err));
  assert_ok(msim_sim_set_state(sim,
                               &(msim_state){.size = sizeof there,
                                             .step = there.step,
                                             .t = there.t,
                                             .n = N,
                                             .x = other->state_x,
                                             .v = other->state_v},
                               err));
  f = (frame_log){.looks = 1};
  assert_ok(msim_sim_run(sim, log_frame, &f, err));
  assert_ok(msim_sim_run(other, NULL, NULL, err));
  same_state(sim, other);
  assert_true(state_of(sim).t == 0.25 && f.t[f.count - 1] == 0.25);
  assert_close(f.t[1] - f.t[0], 0.01, 1e-15);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

/* Several islands, one of which comes to rest, with one thread and with two: the same bits. */
static void threads_change_no_bit(void **state) {
  (void)state;
  static const char *const methods[] = {"rk4", "velocity-verlet", "dop853"};
  const int nmethods = HAS_ADDRESS_SANITIZER ? 1 : 3;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 5; i++) {
    const msim_cloth c = {.size = sizeof c,
                          .rows = 23,
                          .columns = 23,
                          .origin = {2 * i, 0, 0},
                          .row = {0, 1, 0},
                          .column = {1, 0, 0},
                          .mass = 0.3,
                          .k_structural = 30 + i,
                          .k_shear = 10,
                          .damping = 0.01};
    assert_ok(msim_scene_add_cloth(scene, &c, err));
  }
  plane(scene, 0, 0, 1, -1e-3, 0.5, 0.1);
  const int32_t n = 5 * 23 * 23;
  static double v[3 * 5 * 23 * 23];
  for (int p = 0; p < n; p++) v[3 * p + 2] = p / (23 * 23) == 1 ? 0 : 0.3 * sin(0.37 * p);
  for (int m = 0; m < nmethods; m++) {
    msim_sim *sims[2];
    for (int t = 0; t < 2; t++) {
      msim_options opt = control_options(methods[m], 1e-3, 0.05);
      opt.threads = t + 1, opt.fps = 200;
      sims[t] = make_sim(scene, &opt);
      msim_state s = state_of(sims[t]);
      s.v = v;
      assert_ok(msim_sim_set_state(sims[t], &s, err));
      assert_int_equal(sims[t]->any_single_thread, t);
      assert_ok(msim_sim_run(sims[t], NULL, NULL, err));
    }
    same_state(sims[0], sims[1]);
    const msim_stats a = stats_of(sims[0]), b = stats_of(sims[1]);
    assert_int_equal(a.force_evaluations, b.force_evaluations);
    assert_int_equal(a.contacts, b.contacts);
    assert_int_equal(a.rejected_steps, b.rejected_steps);
    assert_true(a.contacts > 0 && a.islands_at_rest > 0);
    msim_sim_destroy(sims[0]), msim_sim_destroy(sims[1]);
  }
  msim_scene_destroy(scene);
}

static msim_status run_all_calls(const msim_allocator *alloc, const char *method, msim_error *err) {
  static frame_log f;
  const double x[9] = {0, 0, 0, 1, 0, 0, 2, 0.1, 0}, mass[3] = {1, 1, 1}, k[2] = {10, 10};
  const double out[9] = {0, 0, 0, 1, 0, 0.1, 2, 0.1, 0}, rest[9] = {0};
  const msim_state risen = {.size = sizeof risen, .n = 3, .x = out, .v = rest};
  const int32_t ij[4] = {0, 1, 1, 2};
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  const char *text;
  msim_options opt = control_options(method, 1e-3, 0.1);
  opt.fps = 200;
  f = (frame_log){0};
  msim_status status = msim_scene_create(alloc, &scene, err);
  if (!status) status = msim_scene_add_particles(scene, 3, x, NULL, mass, err);
  if (!status) status = msim_scene_add_springs(scene, 2, ij, k, NULL, NULL, err);
  if (!status) status = msim_sim_create(scene, &opt, &sim, err);
  if (!status) status = msim_sim_set_state(sim, &risen, err); /* no longer planar */
  counting_allocator *b = alloc->user;
  const int64_t calls = b->calls;
  if (!status) status = msim_sim_run(sim, log_frame, &f, err);
  assert_int_equal(b->calls, calls); /* no step allocates */
  if (!status) status = msim_sim_explain(sim, &text, err);
  if (!status) assert_non_null(strstr(text, "by error control"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return status;
}

static void memory_may_end(void **state) {
  (void)state;
  static const char *const methods[] = {"dop853", "velocity-verlet", "implicit-midpoint"};
  for (int m = 0; m < 3; m++) {
    counting_allocator b = {.fail_at = -1};
    const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                  &b};
    for (int status = MSIM_ERR_MEMORY; status; b.fail_at++) {
      msim_error why;
      b.calls = 0;
      if (b.fail_at < 0) b.fail_at = 0;
      status = run_all_calls(&alloc, methods[m], &why);
      assert_true(status == MSIM_OK || status == MSIM_ERR_MEMORY);
      assert_int_equal(b.live, 0);
    }
    assert_true(b.fail_at > 30);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(frames_are_on_time),
                                     cmocka_unit_test(frames_are_accurate),
                                     cmocka_unit_test(frames_by_steps),
                                     cmocka_unit_test(stops_miss_no_frame),
                                     cmocka_unit_test(steps_pass_frames),
                                     cmocka_unit_test(the_number_of_the_first_step_is_any),
                                     cmocka_unit_test(a_run_without_length_has_one_frame),
                                     cmocka_unit_test(frames_may_be_rarer_than_runs),
                                     cmocka_unit_test(a_resumed_run_may_have_other_frames),
                                     cmocka_unit_test(springs_change_between_steps),
                                     cmocka_unit_test(a_state_that_is_set_starts_a_run),
                                     cmocka_unit_test(threads_change_no_bit),
                                     cmocka_unit_test(memory_may_end)};
  return cmocka_run_group_tests_name("frames", tests, NULL, NULL);
}
