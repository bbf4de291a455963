/* Tests of takahashi-imada where forces depend on velocities: its limit of stability, its error
 * beside those of other methods, and the first steps. Its order is one of test_orders.c. */
#include <math.h>
#include <string.h>

#include "checkpoints.h"
#include "methods/methods.h"
#include "scenes.h"
#include "sim/sim.h"
#include "sim/step_driver.h"

/* 1: 4000 steps of 1 s leave a mass with w^2 = k and this damping as it was, or damp it. */
static int is_stable(double w, double g) {
  msim_scene *scene = mass_on_spring(w * w, g, 0);
  msim_options opt = options("takahashi-imada", 1);
  opt.watch = MSIM_WATCH_OFF;
  msim_sim *sim = make_sim(scene, &opt);
  msim_error why;
  const msim_status status = msim_sim_step(sim, 4000, &why);
  const double off = fabs(state_of(sim).x[3] - 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return status == MSIM_OK && off < 0.02;
}

/* w^2 + 5 g < 12 decides for steps of 1 s of a mode with the frequency w. */
static void the_sum_decides(void **state) {
  (void)state;
  for (double w = 0.2; w < 3.4; w += 0.2) {
    const double g = (12 - w * w) / 5;
    assert_true(is_stable(w, 0.98 * g));
    assert_false(is_stable(w, 1.02 * g));
  }
}

/* 1: no root of r^3 + a r^2 + b r + c exceeds 1, by Jury's criterion. */
static int is_bounded(double a, double b, double c) {
  const double rounding = 1e-12;
  return 1 + a + b + c > -rounding && 1 - a + b - c > -rounding && fabs(c) < 1 + rounding &&
         1 - c * c - fabs(b - a * c) > -rounding;
}

/* 1: a mode with h^2 omega^2 = w and h g = z stays bounded with velocities u + s (u - u'). */
static int mode_is_bounded(double w, double z, double s) {
  const double q = (w + 5 * z) / 12, b = 13. / 12 - (1 + s) * q, c = 1. / 12 - s * q;
  return is_bounded(w * (1 - q) + z * b - 2, 1 - z * (b + c), z * c);
}

/* The limit holds for each pair of frequency and damping within the bounds, and the fastest one
 * with the most damping is unstable beyond it. Where s is below 1/2 a larger one is unstable. */
static void the_limit_holds_for_all_pairs(void **state) {
  (void)state;
  const double ratio[] = {0, 0.01, 0.03, 0.1, 0.3, 1, 5, 1000};
  for (size_t i = 0; i < sizeof ratio / sizeof *ratio; i++) {
    const ms_bounds b = {.omega = 1, .rate = ratio[i]};
    const double limit = ms_takahashi_imada.limit(&b);
    for (double h = 0.01 * limit; h < 1.015 * limit; h += 0.01 * limit) {
      const double w = h * h, z = h * ratio[i], s = (1 + 12 / (w + z)) / (w + 5 * z);
      const int stable = h < 1.005 * limit;
      assert_int_equal(mode_is_bounded(w, z, fmin(0.5, s)), stable);
      assert_false(s < 0.5 && z > 1e-3 && h < 0.995 * limit && mode_is_bounded(w, z, 1.02 * s));
      for (int k = 0; k < 100 * 100 && stable; k++)
        assert_true(mode_is_bounded(w * (k / 100) / 100, z * (k % 100) / 100, fmin(0.5, s)));
    }
  }
}

/* The change of u in a step of 1 s at x, where u' precedes u, for a mode with w and z */
static double expected_change(double w, double z, double x, double u, double u_before) {
  const double s = fmin(0.5, 0.8 * (1 + 12 / (w + z)) / (w + 5 * z)),
               a = -w * x - z * (u + s * (u - u_before)), v = u + (u - u_before) / 12 + 5. / 12 * a;
  return -w * (x + a / 12) - z * v;
}

static void steps_follow_the_formula(void **state) {
  (void)state;
  for (double w = 0.2; w < 11; w += 0.7) {
    for (double z = 0.01; w + 5 * z < 11.5; z *= 3) {
      msim_scene *scene = mass_on_spring(w, z, 0.02);
      const msim_options opt = options("takahashi-imada", 1);
      msim_sim *sim = make_sim(scene, &opt);
      const ms_stepper *s = &sim->islands->stepper;
      assert_ok(msim_sim_step(sim, 2, err));
      const double before = s->v[0];
      assert_ok(msim_sim_step(sim, 1, err));
      const double u = s->v[0], change = expected_change(w, z, s->x[0] - 1, u, before);
      assert_ok(msim_sim_step(sim, 1, err));
      assert_close(s->v[0], u + change, 1e-13);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
  }
}

static msim_scene *swinging_cloth(double damping, double drag) {
  msim_scene *scene = hanging_cloth(9, 500, damping);
  assert_ok(msim_scene_set_drag(scene, drag, err));
  return scene;
}

static double error_of(const msim_scene *scene, const char *method, int steps, const double *x) {
  msim_options opt = options(method, 0.3 / steps);
  opt.steps = steps;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const double error = largest_difference(state_of(sim).x, x, 3 * state_of(sim).n);
  msim_sim_destroy(sim);
  return error;
}

/* Steps of two evaluations, as those of velocity Verlet. With dampers rk4 is less accurate, with as
 * many evaluations. */
static void weak_damping_keeps_it_accurate(void **state) {
  (void)state;
  for (int drags = 0; drags < 2; drags++) {
    msim_scene *scene = swinging_cloth(drags ? 0 : 0.003, drags ? 0.05 : 0);
    double exact[3 * 81];
    msim_options opt = options("dop853", 0.3 / 4000);
    opt.steps = 4000;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    memcpy(exact, state_of(sim).x, sizeof exact);
    msim_sim_destroy(sim);
    const double own = error_of(scene, "takahashi-imada", 400, exact),
                 verlet = error_of(scene, "velocity-verlet", 400, exact),
                 rk4 = error_of(scene, "rk4", 200, exact);
    print_message("  errors %.2g; velocity-verlet %.2g; rk4 %.2g\n", own, verlet, rk4);
    assert_true(own < (drags ? verlet / 40 : fmin(verlet / 600, rk4 / 20)));
    msim_scene_destroy(scene);
  }
}

static void floats_are_as_accurate_as_their_rounding(void **state) {
  (void)state;
  msim_scene *scene = swinging_cloth(0.003, 0.02);
  double x[3 * 81];
  for (int single = 0; single < 2; single++) {
    msim_options opt = options("takahashi-imada", 1e-3);
    opt.precision = single ? MSIM_PRECISION_SINGLE : MSIM_PRECISION_DOUBLE;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 300, err));
    const double off = single ? largest_difference(state_of(sim).x, x, 3 * 81) : 1e-7;
    assert_true(off > 1e-9 && off < 2e-5);
    memcpy(x, state_of(sim).x, sizeof x);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* The state at the start is returned as it was given, and a run that is resumed in its first steps,
 * when velocities of earlier ones are missing, has the same bits. */
static void the_first_steps_resume_to_the_bit(void **state) {
  (void)state;
  msim_scene *scene = swinging_cloth(0.003, 0.02);
  const msim_options opt = options("takahashi-imada", 1e-3);
  for (int steps = 0; steps < 5; steps++) {
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, steps, err));
    if (steps == 0) assert_memory_equal(state_of(sim).x, scene->data->x, 3 * 81 * sizeof(double));
    const checkpoint c = save(sim);
    msim_sim *same = resume(scene, &opt, &c);
    for (int more = 0; more < 3; more++) {
      const msim_state s = state_of(sim), t = state_of(same);
      assert_memory_equal(s.x, t.x, 3 * (size_t)s.n * sizeof *s.x);
      assert_memory_equal(s.v, t.v, 3 * (size_t)s.n * sizeof *s.v);
      assert_ok(msim_sim_step(sim, 2, err));
      assert_ok(msim_sim_step(same, 2, err));
    }
    free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(same);
  }
  msim_scene_destroy(scene);
}

/* As where an unstable run has returned to an earlier state: other velocities are not read, and
 * those of half a step before serve for a step. */
static void a_lost_history_is_not_read(void **state) {
  (void)state;
  msim_scene *scene = swinging_cloth(0.003, 0.02);
  const msim_options opt = options("takahashi-imada", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  ms_stepper *s = &sim->islands->stepper;
  double v[3 * 81], fastest = 0;
  assert_ok(msim_sim_step(sim, 100, err));
  memcpy(v, state_of(sim).v, sizeof v);
  for (int i = 0; i < 3 * 81; i++) fastest = fmax(fastest, fabs(v[i]));
  double *before = s->work[ms_takahashi_imada.carried_at + ms_takahashi_imada.carried];
  for (size_t row = 0; row < 3 * (size_t)sim->islands->model.unknowns.stride; row++)
    before[row] = 1e9;
  s->cached_stage = 0, sim->state_is_current = 0;
  const double off = largest_difference(state_of(sim).v, v, 3 * 81);
  assert_true(off > 0 && off < 1e-4 * fastest);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The change of variables at the start is undone by that for output, to within 0.8 % of x and 1.1 %
 * of v in the fastest stable modes, and to order 8 and 6 in h w in slow ones: y = (h w)^2/12. */
static void the_start_inverts_the_change_of_variables(void **state) {
  (void)state;
  for (double w = 0.1; w < 3.3; w += 0.1) {
    msim_scene *scene = mass_on_spring(w * w, 0, 0.02);
    const msim_options opt = options("takahashi-imada", 1);
    msim_sim *sim = make_sim(scene, &opt);
    ms_stepper *s = &sim->islands->stepper;
    const double *const *start = (const double *const *)s->work + ms_takahashi_imada.carried_at;
    const double y = w * w / 12, stretched = start[0][0] - 1, speed = start[1][0];
    s->cached_stage = 0;
    ms_takahashi_imada.convert_state(s, s->x_next, s->v_next);
    const double x_off = fabs((s->x_next[0] - 1) / stretched - 1),
                 v_off = fabs(s->v_next[0] / speed - 1);
    assert_true(fabs(stretched - 0.01) < 1e-12 && fabs(speed - 0.02) < 1e-12);
    assert_true(x_off < fmin(0.008, 8 * pow(y, 4) + 1e-12));
    assert_true(v_off < fmin(0.011, 0.2 * pow(y, 3) + 1e-12));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Trials of integrator = auto take their turns in one sim: velocities of pinned particles are 0,
 * whatever another method has left in work vectors. */
static void other_methods_leave_nothing(void **state) {
  (void)state;
  msim_scene *scene = swinging_cloth(0.003, 0.02);
  const msim_state start = {
      .size = sizeof start, .n = 81, .x = scene->data->x, .v = scene->data->v};
  double v[3 * 81];
  for (int round = 0; round < 2; round++) {
    msim_options opt = options("dop853", 1e-3);
    opt.steps = 10;
    msim_sim *sim = make_sim(scene, &opt);
    for (int i = 0; i < sim->config.integrator->nwork; i++)
      for (size_t row = 0; row < 3 * (size_t)sim->islands->model.unknowns.stride && round; row++)
        sim->islands->stepper.work[i][row] = 1e3;
    ms_sim_switch_method(sim, &ms_dop853, 1e-3);
    assert_ok(msim_sim_set_state(sim, &start, err));
    ms_sim_switch_method(sim, &ms_takahashi_imada, 1e-3);
    assert_ok(ms_sim_make_steps(sim, 5, err));
    if (round) assert_memory_equal(state_of(sim).v, v, sizeof v);
    memcpy(v, state_of(sim).v, sizeof v);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(the_sum_decides),
                                     cmocka_unit_test(the_limit_holds_for_all_pairs),
                                     cmocka_unit_test(steps_follow_the_formula),
                                     cmocka_unit_test(weak_damping_keeps_it_accurate),
                                     cmocka_unit_test(floats_are_as_accurate_as_their_rounding),
                                     cmocka_unit_test(the_first_steps_resume_to_the_bit),
                                     cmocka_unit_test(a_lost_history_is_not_read),
                                     cmocka_unit_test(the_start_inverts_the_change_of_variables),
                                     cmocka_unit_test(other_methods_leave_nothing)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
