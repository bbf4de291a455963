/* Error control: what tol means, where runs end and frames lie; that looking changes nothing. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "integrate/control.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 5, N = SIDE * SIDE };

static msim_options controlled(const char *method, double tol, double t_end) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.tol = tol, opt.t_end = t_end, opt.solver = "pcg";
  return opt;
}

static int has_control(const char *method) {
  return strcmp(method, "verlet") != 0 && strcmp(method, "bdf2") != 0;
}

static double off(const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < 3 * N; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sqrt(sum / N);
}

static void same_state(msim_sim *a, msim_sim *b) {
  const msim_state s = state_of(a), t = state_of(b);
  assert_int_equal(s.step, t.step);
  assert_true(s.t == t.t);
  assert_memory_equal(s.x, t.x, 3 * (size_t)s.n * sizeof *s.x);
  assert_memory_equal(s.v, t.v, 3 * (size_t)s.n * sizeof *s.v);
}

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
  const msim_options opt = controlled(method, tol, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_true(state_of(sim).t == t_end);
  const double error = off(state_of(sim).x, x);
  msim_sim_destroy(sim);
  return error;
}

/* tol/100 makes about a hundredth of the error. First order would take too long for small ones. */
static void error_goes_like_tol(void **state) {
  (void)state;
  const double t_end = 0.6;
  double x[3 * N];
  for (int32_t m = 0; method_at(m); m++) {
    const char *method = method_at(m);
    if (!has_control(method)) continue;
    msim_scene *scene = hanging_cloth(SIDE, 30, wants_positions_alone(method) ? 0 : 0.01);
    reference(scene, t_end, x);
    const int order = msim_integrator_info(m)->order;
    const double tol = order == 1 ? 0.03 : order == 2 ? 1e-3 : 1e-5, less = order == 1 ? 10 : 100;
    const double coarse = error_of(scene, method, tol, t_end, x);
    const double fine = error_of(scene, method, tol / less, t_end, x);
    print_message("  %-24s tol %-6g error %.2g, with tol/%g its %.3gth\n", method, tol, coarse,
                  less, coarse / fine);
    assert_true(coarse < tol && coarse > 1e-4 * tol);
    assert_in_range(coarse / fine, less / 2.5, less * 5);
    msim_scene_destroy(scene);
  }
}

/* dop853 takes control by itself, unless steps are counted. */
static void dop853_chooses_its_steps(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  msim_options opt = controlled("dop853", 0, 0.25), same = controlled("dop853", 1e-6, 0.25);
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

/*------------------------------------- rejected steps -------------------------------------------*/

/* A step that follows a rejected one is the step that would have been made at once. */
static void rejected_steps_leave_no_trace(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (!has_control(method_at(m))) continue;
    msim_scene *scene = hanging_cloth(SIDE, 30, 0);
    plane(scene, 0, 0, 1, -1e-6, 0.5, 0.1);
    msim_options opt = controlled(method_at(m), 1e-3, 10);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    for (int i = 0; i < 60; i++) {
      const int64_t before = stats_of(sim).rejected_steps;
      const double t = state_of(sim).t;
      if (i % 20 == 10) assert_ok(msim_sim_set_step(sim, 3, err));
      assert_ok(msim_sim_step(sim, 1, err));
      if (i % 20 == 10) assert_true(stats_of(sim).rejected_steps > before);
      /* the other one is told the step that was found */
      assert_ok(msim_sim_set_step(other, sim->motion->stepper.h, err));
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

/* A method that fails where steps are too long, or is off by an amount that no step lessens. */
static struct {
  const ms_integrator *real;
  double longest, noise;
  int calls;
} spied;

static msim_status spy_step(ms_stepper *s, msim_error *err) {
  if (s->h > spied.longest) return ms_fail(err, MSIM_NOT_CONVERGED, "too long for the test");
  msim_status status = spied.real->step(s, err);
  s->v_next[7] += spied.noise * (spied.calls++ % 3);
  return status;
}

static ms_integrator spy_on(msim_sim *sim, double longest, double noise) {
  ms_integrator spy = *sim->integrator;
  spied.real = sim->integrator, spied.longest = longest, spied.noise = noise, spied.calls = 0;
  spy.step = spy_step;
  return spy;
}

static void no_step_is_short_enough(void **state) {
  (void)state;
  static const double longest[] = {INFINITY, 0};
  static const char *const words[] = {"larger error than tol = 0.001 allows",
                                      "can be made: too long for the test"};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene = hanging_cloth(SIDE, 30, 0);
    const msim_options opt = controlled("velocity-verlet", 1e-3, 1);
    msim_sim *sim = make_sim(scene, &opt), *start = make_sim(scene, &opt);
    const ms_integrator spy = spy_on(sim, longest[i], 0.1);
    msim_error why;
    char particle[32];
    sim->integrator = &spy;
    assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_CONVERGED);
    assert_non_null(strstr(why.text, words[i]));
    assert_non_null(strstr(why.text, "step 1, t = "));
    snprintf(particle, sizeof particle, "particle %d:", sim->motion->model.rows.particle[7]);
    if (i == 0) assert_non_null(strstr(why.text, particle));
    same_state(sim, start);
    spied.noise = 0, spied.longest = INFINITY; /* it goes on from there */
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(start, 5, err));
    same_state(sim, start);
    msim_sim_destroy(sim), msim_sim_destroy(start);
    msim_scene_destroy(scene);
  }
}

/* Under error control a step that cannot be made is made shorter. */
static void steps_that_fail_are_shortened(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0);
  const msim_options opt = controlled("dop853", 1e-3, 1);
  msim_sim *sim = make_sim(scene, &opt);
  const ms_integrator spy = spy_on(sim, 1e-3, 0);
  sim->integrator = &spy;
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_true(state_of(sim).t == 1);
  assert_true(stats_of(sim).steps >= 1000 && stats_of(sim).rejected_steps > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A fixed step is made in parts of the same h, which together end where it would. */
static void fixed_steps_are_made_in_parts(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (strcmp(method_at(m), "verlet") == 0) continue;
    msim_scene *scene = hanging_cloth(SIDE, 30, 0);
    msim_options opt = options(method_at(m), 4e-3);
    opt.solver = "pcg", opt.newton_retries = 2;
    msim_sim *sim = make_sim(scene, &opt);
    opt.h = 1e-3, opt.newton_retries = 0;
    msim_sim *fine = make_sim(scene, &opt);
    const ms_integrator spy = spy_on(sim, 1.5e-3, 0);
    sim->integrator = &spy;
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(fine, 20, err));
    assert_int_equal(state_of(sim).step, 5);
    assert_int_equal(stats_of(sim).rejected_steps, 10);
    assert_memory_equal(state_of(sim).x, state_of(fine).x, 3 * N * sizeof(double));
    assert_memory_equal(state_of(sim).v, state_of(fine).v, 3 * N * sizeof(double));
    spied.longest = 0.9e-3; /* not even four parts do */
    msim_error why;
    assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_CONVERGED);
    assert_non_null(strstr(why.text, "step 6, t = 0.024 s"));
    assert_memory_equal(state_of(sim).x, state_of(fine).x, 3 * N * sizeof(double));
    msim_sim_destroy(sim), msim_sim_destroy(fine);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- frames ---------------------------------------------------*/

enum { FRAMES = 64 };
typedef struct film {
  int count, stop_at, looks;
  int64_t step[FRAMES];
  double t[FRAMES], x[FRAMES][3 * N], v[FRAMES][3 * N];
} film;

static int take(msim_sim *sim, void *user) {
  film *f = user;
  assert_true(f->count < FRAMES);
  if (f->looks) {
    const msim_state s = state_of(sim);
    double force[3 * N];
    f->t[f->count] = s.t, f->step[f->count] = s.step;
    memcpy(f->x[f->count], s.x, sizeof f->x[0]);
    memcpy(f->v[f->count], s.v, sizeof f->v[0]);
    msim_sim_force(sim, s.x, s.v, force); /* a look that computes */
  }
  return ++f->count == f->stop_at;
}

static void frames_are_on_time(void **state) {
  (void)state;
  static film f, g;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  for (int32_t m = 0; method_at(m); m++) {
    const char *method = method_at(m);
    const int order = msim_integrator_info(m)->order;
    if (!has_control(method) || wants_positions_alone(method) || order == 1) continue;
    msim_options opt = controlled(method, order > 2 ? 1e-5 : 1e-3, 0.25);
    opt.fps = 100;
    msim_sim *sim = make_sim(scene, &opt), *alone = make_sim(scene, &opt);
    msim_sim *blind = make_sim(scene, &opt), *pieces = make_sim(scene, &opt);
    f = (film){.looks = 1}, g = (film){.looks = 1, .stop_at = 7};
    assert_ok(msim_sim_run(sim, take, &f, err));
    assert_int_equal(f.count, 26);
    for (int i = 0; i < 26; i++) assert_close(f.t[i], i == 25 ? 0.25 : i / 100., 1e-15);
    assert_true(f.t[25] == 0.25 && f.t[0] == 0);
    /* the same bits unwatched, by those who do not look, and in pieces, which miss no frame */
    assert_ok(msim_sim_run(alone, NULL, NULL, err));
    same_state(sim, alone);
    film *unseen = &(film){0};
    assert_ok(msim_sim_run(blind, take, unseen, err));
    assert_int_equal(stats_of(blind).force_evaluations, stats_of(alone).force_evaluations);
    assert_true(stats_of(sim).force_evaluations > stats_of(alone).force_evaluations);
    assert_int_equal(msim_sim_run(pieces, take, &g, NULL), MSIM_STOPPED);
    msim_sim_stop(pieces);
    assert_int_equal(msim_sim_run(pieces, take, &g, NULL), MSIM_STOPPED);
    assert_ok(msim_sim_run(pieces, take, &g, err));
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

/* What is shown between two steps is as good as the steps. */
static void frames_are_accurate(void **state) {
  (void)state;
  static film f;
  static const char *const methods[] = {"dop853", "rk4", "velocity-verlet"};
  static const double tols[] = {1e-8, 1e-5, 1e-3}, bounds[] = {1e-8, 1e-5, 1e-3};
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  const msim_options fixed = options("rk4", 1e-4);
  for (int m = 0; m < 3; m++) {
    msim_options opt = controlled(methods[m], tols[m], 0.25);
    opt.fps = 200;
    msim_sim *sim = make_sim(scene, &opt), *exact = make_sim(scene, &fixed);
    f = (film){.looks = 1};
    assert_ok(msim_sim_run(sim, take, &f, err));
    assert_int_equal(f.count, 51);
    for (int i = 1; i < f.count; i++) {
      assert_ok(msim_sim_step(exact, 50, err));
      const msim_state s = state_of(exact);
      assert_close(off(f.x[i], s.x), 0, bounds[m]);
      assert_close(off(f.v[i], s.v), 0, 30 * bounds[m]);
    }
    msim_sim_destroy(sim), msim_sim_destroy(exact);
  }
  msim_scene_destroy(scene);
}

/* every counts the steps that were accepted. */
static void frames_by_steps(void **state) {
  (void)state;
  static film f;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  msim_options opt = controlled("dop853", 1e-6, 0.25);
  opt.every = 4;
  msim_sim *sim = make_sim(scene, &opt);
  f = (film){.looks = 1};
  assert_ok(msim_sim_run(sim, take, &f, err));
  const int64_t steps = state_of(sim).step;
  assert_int_equal(f.count, 1 + (steps + 3) / 4);
  for (int i = 0; i < f.count; i++) assert_int_equal(f.step[i], i + 1 < f.count ? 4 * i : steps);
  assert_true(f.t[f.count - 1] == 0.25);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- setters, threads -----------------------------------------*/

/* Frames within the step before are those of the springs it was made with. */
static int stiffen(msim_sim *sim, void *user) {
  film *f = user;
  const int done = take(sim, user);
  if (f->count == 10) {
    static double k[200];
    for (int i = 0; i < 200; i++) k[i] = 60;
    assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
    const msim_state s = state_of(sim);
    assert_true(s.t == f->t[9]);
    assert_memory_equal(s.x, f->x[9], sizeof f->x[9]);
    assert_memory_equal(s.v, f->v[9], sizeof f->v[9]);
  }
  return done;
}

static void springs_change_between_steps(void **state) {
  (void)state;
  static film f;
  static const char *const methods[] = {"dop853", "velocity-verlet", "implicit-midpoint"};
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  for (int m = 0; m < 3; m++) {
    msim_options opt = controlled(methods[m], 1e-3, 0.25);
    opt.fps = 200;
    msim_sim *sim = make_sim(scene, &opt), *plain = make_sim(scene, &opt);
    f = (film){.looks = 1};
    assert_ok(msim_sim_run(sim, stiffen, &f, err));
    assert_int_equal(f.count, 51);
    f = (film){.looks = 1};
    assert_ok(msim_sim_run(plain, take, &f, err));
    assert_true(off(state_of(sim).x, state_of(plain).x) > 1e-4);
    msim_sim_destroy(sim), msim_sim_destroy(plain);
  }
  msim_scene_destroy(scene);
}

static void a_state_that_is_set_starts_a_run(void **state) {
  (void)state;
  static film f;
  msim_scene *scene = hanging_cloth(SIDE, 30, 0.01);
  msim_options opt = controlled("dop853", 1e-6, 0.25);
  opt.fps = 100;
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  const msim_state there = state_of(sim);
  assert_ok(msim_sim_set_state(other, &there, err));
  assert_ok(msim_sim_set_state(
      sim,
      &(msim_state){sizeof there, there.step, there.t, N, other->flat_x, other->flat_v, NULL, 0},
      err));
  f = (film){.looks = 1};
  assert_ok(msim_sim_run(sim, take, &f, err));
  assert_ok(msim_sim_run(other, NULL, NULL, err));
  same_state(sim, other);
  assert_true(state_of(sim).t == 0.25 && f.t[f.count - 1] == 0.25);
  assert_close(f.t[1] - f.t[0], 0.01, 1e-15);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

/* Islands, one of which comes to rest, by one thread and by two: the same bits. */
static void threads_change_no_bit(void **state) {
  (void)state;
  static const char *const methods[] = {"dop853", "velocity-verlet", "rk4"};
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
  for (int m = 0; m < 3; m++) {
    msim_sim *sims[2];
    for (int t = 0; t < 2; t++) {
      msim_options opt = controlled(methods[m], 1e-3, 0.05);
      opt.threads = t + 1, opt.fps = 200;
      sims[t] = make_sim(scene, &opt);
      msim_state s = state_of(sims[t]);
      s.v = v;
      assert_ok(msim_sim_set_state(sims[t], &s, err));
      assert_int_equal(sims[t]->any_by_one, t);
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

/*------------------------------------- refusals -------------------------------------------------*/

static void refused(msim_options opt, const char *sentence) {
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_sim *sim;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  if (!strstr(why.text, sentence)) fail_msg("\"%s\" lacks \"%s\"", why.text, sentence);
  msim_scene_destroy(scene);
}

static void what_cannot_be_is_refused(void **state) {
  (void)state;
  msim_options opt = controlled("rk4", 1e-6, 1);
  opt.steps = 5;
  refused(opt, "tol and steps exclude each other");
  refused(controlled("verlet", 1e-3, 1), "'verlet' has no error control, so it takes no tol");
  refused(controlled("bdf2", 1e-3, 1), "velocity-verlet, rk4, rkn6, dop853, implicit-euler");
  refused(controlled("rk4", -1, 1), "tol is '-1'");
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_error why;
  opt = controlled("dop853", 0, -1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_run(sim, NULL, NULL, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "no end"));
  assert_ok(msim_sim_step(sim, 3, err)); /* steps may be made */
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(error_goes_like_tol),
                                     cmocka_unit_test(dop853_chooses_its_steps),
                                     cmocka_unit_test(rejected_steps_leave_no_trace),
                                     cmocka_unit_test(no_step_is_short_enough),
                                     cmocka_unit_test(steps_that_fail_are_shortened),
                                     cmocka_unit_test(fixed_steps_are_made_in_parts),
                                     cmocka_unit_test(frames_are_on_time),
                                     cmocka_unit_test(frames_are_accurate),
                                     cmocka_unit_test(frames_by_steps),
                                     cmocka_unit_test(springs_change_between_steps),
                                     cmocka_unit_test(a_state_that_is_set_starts_a_run),
                                     cmocka_unit_test(threads_change_no_bit),
                                     cmocka_unit_test(what_cannot_be_is_refused)};
  return cmocka_run_group_tests_name("control", tests, NULL, NULL);
}
