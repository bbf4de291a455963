/* Tests of pinned particles with a prescribed motion: against closed solutions, with the order of
 * each method, the balance of energy and work, checkpoints, error control at the times of a motion,
 * scene files and refusals. */
#include <math.h>
#include <stdio.h>

#include "checkpoints.h"
#include "state_hash.h"

/* A particle of mass 1 at 1 m, tied by a spring of k = 9 N/m and rest length 0 to a pinned particle
 * at 0, which moves by 0.5 m along x and by 0.25 m along z in T = 2 s. */
enum { NT = 2 };
static const double T = 2, K = 9, ends[2][3] = {{0, 0, 0}, {0.5, 0, 0.25}};

static int supports(const char *method) {
  return strcmp(method, "respa") != 0 && strcmp(method, "takahashi-imada") != 0;
}

static msim_scene *driven_particle(int32_t interpolation, double rest, double damping) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, t[NT] = {0, T};
  const int32_t ij[2] = {0, 1}, first = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &K, &rest, &damping, err));
  assert_ok(msim_scene_pin(scene, 1, &first, err));
  const msim_motion m = {.size = sizeof m,
                         .n = 1,
                         .particles = &first,
                         .nt = NT,
                         .t = t,
                         .x = &ends[0][0],
                         .interpolation = interpolation};
  assert_ok(msim_scene_add_motion(scene, &m, err));
  return scene;
}

/* x'' = -w^2 (x - p(t)), w = 3: for p = b (3 s^2 - 2 s^3), s = t/T, the particular solution is
 * q = p - p''/w^2, and x = q + A cos w t + B sin w t, with x = x0 and x' = 0 at t = 0; p linear:
 * q = p. */
static void closed_solution(int32_t interpolation, double t, double x[3], double v[3]) {
  const double w = sqrt(K), x0[3] = {1, 0, 0};
  for (int c = 0; c < 3; c++) {
    const double b = ends[1][c], s = t / T, T2 = T * T;
    const int cubic = interpolation == MSIM_MOTION_CUBIC;
    const double q = cubic ? b * (3 * s * s - 2 * s * s * s - (6 - 12 * s) / (T2 * w * w)) : b * s;
    const double q1 = cubic ? b / T * (6 * s - 6 * s * s + 12 / (T2 * w * w)) : b / T;
    const double A = x0[c] - (cubic ? -6 * b / (T2 * w * w) : 0),
                 B = -(cubic ? b / T * 12 / (T2 * w * w) : b / T) / w;
    x[c] = q + A * cos(w * t) + B * sin(w * t);
    v[c] = q1 - A * w * sin(w * t) + B * w * cos(w * t);
  }
}

static double error_of(const char *method, int32_t interpolation, int64_t steps) {
  msim_scene *scene = driven_particle(interpolation, 0, 0);
  msim_options opt = options(method, 1.5 / (double)steps);
  opt.newton_rtol = 1e-13, opt.solver_rtol = 1e-13;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  const msim_state s = state_of(sim);
  double x[3], v[3], most = 0;
  closed_solution(interpolation, 1.5, x, v);
  for (int c = 0; c < 3; c++)
    most = fmax(most, fmax(fabs(s.x[3 + c] - x[c]), fabs(s.v[3 + c] - v[c])));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return most;
}

static void methods_keep_their_order(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++)
    for (int32_t kind = 0; kind < 2; kind++) {
      if (!supports(method)) continue;
      const int order = msim_integrator_info(i)->order;
      const int64_t steps = order >= 8 ? 6 : order >= 6 ? 8 : order >= 4 ? 24 : 400;
      const double coarse = error_of(method, kind, steps), fine = error_of(method, kind, 2 * steps);
      const double found = log2(coarse / fine);
      print_message("  %s, %d: %.3g %.3g, order %.2f\n", method, kind, coarse, fine, found);
      if (!(found > order - 0.25) && fine > 1e-12)
        fail_msg("%s: order %.2f, not %d", method, found, order);
    }
}

/* x of the driven particle at t = 3 s, with damping; its pin stops at T */
static double position_after_stop(msim_options opt) {
  msim_scene *scene = driven_particle(MSIM_MOTION_LINEAR, 0, 0.5);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const double x = state_of(sim).x[3];
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return x;
}

/* Where the velocity of a pin jumps at the end of a step, the acceleration jumps: it must not be
 * kept for the next step. */
static void jumps_keep_the_order(void **state) {
  (void)state;
  const char *const methods[] = {"newmark", "trapezoidal", "velocity-verlet", "bdf2"};
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-12, opt.steps = -1, opt.t_end = 3;
  const double exact = position_after_stop(opt);
  double newmark = 0;
  for (int i = 0; i < 4; i++) {
    double off[2];
    for (int k = 0; k < 2; k++) {
      opt = options(methods[i], 1. / 256 / (1 + k));
      opt.newton_rtol = 1e-13, opt.t_end = 3;
      off[k] = fabs(position_after_stop(opt) - exact);
    }
    print_message("  %s: %.3g %.3g\n", methods[i], off[0], off[1]);
    assert_true(off[0] < 3e-4 && off[1] < off[0] / 3.2);
    if (i == 0) newmark = off[1];
    if (i == 1) assert_close(off[1], newmark, 1e-9); /* the same formula, without a kept value */
  }
}

static void pins_are_where_they_should_be(void **state) {
  (void)state;
  msim_scene *scene = driven_particle(MSIM_MOTION_CUBIC, 0, 0);
  const msim_options opt = options("velocity-verlet", 0.125);
  msim_sim *sim = make_sim(scene, &opt);
  for (int k = 0; k <= 20; k++) {
    const double s = fmin(0.125 * k / T, 1);
    for (int c = 0; c < 3; c++) {
      assert_close(state_of(sim).x[c], ends[1][c] * s * s * (3 - 2 * s), 1e-15);
      assert_close(state_of(sim).v[c], ends[1][c] * 6 * s * (1 - s) / T, 1e-15);
    }
    assert_ok(msim_sim_step(sim, 1, err));
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A cloth, with one corner moved along a cubic and the other one along lines */
static msim_scene *moved_cloth(double damping) {
  enum { SIDE = 5, TIMES = 4 };
  const int32_t corners[2] = {0, SIDE - 1};
  const double t[TIMES] = {0.1, 0.3, 0.55, 0.7};
  double x[2][TIMES][3] = {{{0, 0, 0}, {0.1, -0.2, 0.1}, {0.2, -0.1, 0.2}, {0.1, 0, 0.3}},
                           {{1, 0, 0}, {1.1, 0.1, 0}, {1.1, -0.1, 0.2}, {1, 0, 0}}};
  msim_scene *scene = hanging_cloth(SIDE, 50, damping);
  for (int i = 0; i < 2; i++) {
    const msim_motion m = {.size = sizeof m,
                           .n = 1,
                           .particles = &corners[i],
                           .nt = TIMES,
                           .t = t,
                           .x = &x[i][0][0],
                           .interpolation = i ? MSIM_MOTION_LINEAR : MSIM_MOTION_CUBIC};
    assert_ok(msim_scene_add_motion(scene, &m, err));
  }
  return scene;
}

static void energy_is_balanced(void **state) {
  (void)state;
  msim_scene *scene = moved_cloth(0);
  expect_work_is_balanced(scene);
  msim_scene_destroy(scene);
}

/* With fixed steps the balance converges with the order of the method. */
static void work_has_the_order_of_the_method(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet",   "rk4",           "ssprk102",
                                 "ssprk104",          "rk6",           "rkn6",
                                 "implicit-midpoint", "force-gradient"};
  for (int i = 0; i < 8; i++) {
    double off[2];
    for (int k = 0; k < 2; k++) {
      msim_scene *scene = driven_particle(MSIM_MOTION_CUBIC, 0.5, 0);
      msim_options opt = options(methods[i], 0.02 / (1 + k));
      opt.newton_rtol = 1e-13, opt.solver_rtol = 1e-13;
      msim_sim *sim = make_sim(scene, &opt);
      const double start = energy_less_work(sim);
      assert_ok(msim_sim_step(sim, 75 * (1 + k), err));
      off[k] = fabs(energy_less_work(sim) - start);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
    print_message("  %s: %.3g %.3g\n", methods[i], off[0], off[1]);
    assert_true(off[0] < 1e-3 && (off[1] < off[0] / 2.5 || off[1] < 1e-11));
  }
}

static void motions_are_resumable(void **state) {
  (void)state;
  const char *method;
  const int64_t at[] = {3, 101, 260};
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!supports(method)) continue;
    msim_scene *scene = moved_cloth(takes_positions_only(method) ? 0 : 0.02);
    msim_options opt = options(method, 1e-3);
    if (strcmp(method, "explicit-euler") == 0) opt.h = 1e-4;
    opt.threads = 1 + i % 2;
    expect_resumable(scene, &opt, 400, 3, at, method);
    if (strcmp(method, "verlet") != 0) {
      opt.tol = 1e-4, opt.steps = -1, opt.t_end = 1;
      const int64_t early[] = {2, 9};
      expect_resumable(scene, &opt, 14, 2, early, method);
    }
    msim_scene_destroy(scene);
  }
}

/* Under error control steps end at the times of a motion, and the result has the accuracy. */
static void steps_end_at_times(void **state) {
  (void)state;
  msim_scene *scene = moved_cloth(0);
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-6, opt.steps = -1, opt.t_end = 1;
  const double t[] = {0.1, 0.3, 0.55, 0.7};
  msim_sim *sim = make_sim(scene, &opt);
  int k = 0;
  while (state_of(sim).t < 1) {
    assert_ok(msim_sim_step(sim, 1, err));
    if (k < 4 && state_of(sim).t >= t[k]) assert_true(state_of(sim).t == t[k++]);
  }
  assert_int_equal(k, 4);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* An island that rests until its pin moves is not skipped. */
static void resting_islands_wake(void **state) {
  (void)state;
  const char *const methods[] = {"symplectic-euler", "velocity-verlet", "implicit-euler"};
  for (int i = 0; i < 3; i++) {
    const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, t[2] = {1, 2};
    const double points[6] = {0, 0, 0, 0.5, 0, 0};
    const int32_t ij[2] = {0, 1}, first = 0;
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &K, NULL, NULL, err));
    assert_ok(msim_scene_pin(scene, 1, &first, err));
    const msim_motion m = {
        .size = sizeof m, .n = 1, .particles = &first, .nt = 2, .t = t, .x = points};
    assert_ok(msim_scene_add_motion(scene, &m, err));
    const msim_options opt = options(methods[i], 0.015625);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 64, err));
    assert_close(state_of(sim).x[3], 1, 1e-12);
    assert_ok(msim_sim_step(sim, 64, err));
    assert_true(state_of(sim).x[3] > 1.1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void assert_same_motion(const msim_motion *a, const msim_motion *b) {
  const size_t n = (size_t)a->n, nt = (size_t)a->nt;
  assert_true(a->n == b->n && a->nt == b->nt && a->interpolation == b->interpolation);
  assert_memory_equal(a->particles, b->particles, n * sizeof *a->particles);
  assert_memory_equal(a->t, b->t, nt * sizeof *a->t);
  assert_memory_equal(a->x, b->x, 3 * n * nt * sizeof *a->x);
}

/* Two particles at three times, so that no two of the dimensions can be exchanged, and one */
static msim_scene *scene_with_motions(void) {
  const double x[12] = {0, 0, 2, 1, 0, 2, 2, 0, 2, 3, 0, 2}, mass[4] = {1, 1, 1, 1};
  const double t[3] = {0, 0.1, 0.7};
  const double points[18] = {1, 2, 3, 4, 5, 6, 7, 8, 9.1, 10, 11, 12, 13, 14, 15, 16, 17, 18};
  const int32_t pinned[3] = {3, 0, 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 4, x, NULL, mass, err));
  assert_ok(msim_scene_pin(scene, 3, pinned, err));
  for (int32_t i = 0; i < 2; i++) {
    const msim_motion m = {.size = sizeof m,
                           .n = 2 - i,
                           .particles = pinned + 2 * i,
                           .nt = 3 - i,
                           .t = t,
                           .x = points,
                           .interpolation = i ? MSIM_MOTION_LINEAR : MSIM_MOTION_CUBIC};
    assert_ok(msim_scene_add_motion(scene, &m, err));
  }
  return scene;
}

static void assert_file_keeps_motions(const char *path) {
  msim_scene *scene = scene_with_motions(), *again;
  msim_motion a = {.size = sizeof a}, b = a;
  msim_error why;
  const msim_status status = msim_scene_save(scene, path, &why);
  require(status != MSIM_ERR_NAME, "the importer hdf5");
  assert_int_equal(status, MSIM_OK);
  assert_ok(msim_scene_load(NULL, path, &again, err));
  remove(path);
  for (int32_t i = 0; i < 2; i++) {
    assert_int_equal(msim_scene_get_motion(scene, i, &a), MSIM_OK);
    assert_int_equal(msim_scene_get_motion(again, i, &b), MSIM_OK);
    assert_same_motion(&a, &b);
  }
  assert_int_equal(msim_scene_get_motion(again, 2, &b), MSIM_ERR_ARG);
  msim_scene_destroy(scene), msim_scene_destroy(again);
}

static void json_files_keep_motions(void **state) {
  (void)state;
  assert_file_keeps_motions("test_motions.json");
}

static void hdf5_files_keep_motions(void **state) {
  (void)state;
  assert_file_keeps_motions("test_motions.h5");
}

static void expect_refused_motion(msim_scene *scene, msim_motion m, const char *sentence) {
  msim_error why;
  assert_int_equal(msim_scene_add_motion(scene, &m, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, sentence);
}

static void bad_motions_are_refused(void **state) {
  (void)state;
  msim_scene *scene = driven_particle(0, 0, 0);
  const int32_t free_one = 1, moved = 0, outside = 7;
  const double t[2] = {0, 1}, back[2] = {1, 1}, x[6] = {0}, bad[6] = {0, 0, 0, 0, NAN, 0};
  msim_motion m = {.size = sizeof m, .n = 1, .particles = &free_one, .nt = 2, .t = t, .x = x};
  expect_refused_motion(scene, m,
                        "particles[0] is particle 1, which is not pinned; pin it to move it");
  m.particles = &outside;
  expect_refused_motion(scene, m, "particles[0] is 7; there are 2 particles, counted from 0");
  m.particles = &moved;
  expect_refused_motion(scene, m, "particles[0] is particle 0, which has a motion already");
  m.t = back;
  expect_refused_motion(scene, m, "t[1] is 1; it must exceed t[0] = 1");
  m.t = t, m.x = bad;
  expect_refused_motion(scene, m, "x[1] is nan; it must be finite");
  m.nt = 0;
  expect_refused_motion(scene, m, "t has 0 times; it must have at least 1");
  const char *const methods[] = {"respa", "takahashi-imada", "auto"};
  for (int i = 0; i < 3; i++) {
    msim_options opt = options(methods[i], 1e-3);
    msim_error why;
    msim_sim *sim;
    if (i == 2) opt.t_end = 1;
    assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
    assert_non_null(strstr(why.text, "does not support motions of pinned particles"));
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(methods_keep_their_order),
                                     cmocka_unit_test(jumps_keep_the_order),
                                     cmocka_unit_test(pins_are_where_they_should_be),
                                     cmocka_unit_test(energy_is_balanced),
                                     cmocka_unit_test(work_has_the_order_of_the_method),
                                     cmocka_unit_test(motions_are_resumable),
                                     cmocka_unit_test(steps_end_at_times),
                                     cmocka_unit_test(resting_islands_wake),
                                     cmocka_unit_test(json_files_keep_motions),
                                     cmocka_unit_test(hdf5_files_keep_motions),
                                     cmocka_unit_test(bad_motions_are_refused)};
  return cmocka_run_group_tests_name("motions", tests, NULL, NULL);
}
