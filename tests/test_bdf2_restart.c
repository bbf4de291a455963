/* Tests of bdf2 where the previous step cannot be used: at the start and after reflections. Under
 * error control such steps have order 2; fixed ones are those of implicit Euler. And of its error
 * estimate. */
#include "error_control.h"
#include "sim/island_step.h"

/* A mass of 1 kg on a spring of rest length 0, 1 m from its pin: x = cos(10 t) + sin(10 t) */
static msim_scene *oscillator(void) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, v[6] = {0, 0, 0, 10, 0, 0};
  return make_oscillator(x, v, 100);
}

/* The error of a first step of h; *estimate: its error estimate. tol = 0: a fixed step */
static double first_step(double h, double tol, double *estimate) {
  msim_scene *scene = oscillator();
  msim_options opt = tol > 0 ? control_options("bdf2", tol, 10) : options("bdf2", h);
  opt.solver = "pcg";
  msim_sim *sim = make_sim(scene, &opt);
  if (tol > 0) assert_ok(msim_sim_set_step(sim, h, err));
  assert_ok(msim_sim_step(sim, 1, err));
  assert_close(state_of(sim).t, h, 1e-15);
  const ms_island_sim *m = sim->islands;
  if (tol > 0) *estimate = m->error * tol * h / 10 * sqrt(2) * m->norm.body[0].extent;
  const double x = state_of(sim).x[3];
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return fabs(x - cos(10 * h) - sin(10 * h));
}

static void a_first_step_is_of_order_2_under_control(void **state) {
  (void)state;
  double long_estimate, short_estimate;
  const double fixed = first_step(4e-3, 0, NULL), half = first_step(2e-3, 0, NULL);
  assert_close(fixed / half, 4, 0.2); /* an error of O(h^2): implicit Euler */
  const double long_error = first_step(4e-3, 1e3, &long_estimate);
  const double short_error = first_step(2e-3, 1e3, &short_estimate);
  print_message("  %.3g, %.3g, estimated %.3g, %.3g\n", long_error, short_error, long_estimate,
                short_estimate);
  assert_close(long_error / short_error, 8, 0.5);
  assert_close(long_estimate / short_estimate, 8, 0.5);
  assert_true(long_estimate > long_error && long_estimate < 2 * long_error);
}

static double x_at(double t) { return cos(10 * t) + sin(10 * t); }
static double v_at(double t) { return 10 * (cos(10 * t) - sin(10 * t)); }

/* In a step of r h from the exact states at 0 and h the error estimate equals the error, up to
 * terms of higher order, for any ratio r of the steps. */
static void the_estimate_of_a_step_is_its_error(void **state) {
  (void)state;
  const double ratio[] = {0.5, 1, 2}, h = 1e-3;
  for (int i = 0; i < 3; i++) {
    msim_scene *scene = oscillator();
    const msim_options opt = control_options("bdf2", 1, 10);
    msim_sim *sim = make_sim(scene, &opt);
    ms_stepper *s = &sim->islands->stepper;
    assert_ok(msim_sim_set_step(sim, h, err));
    assert_ok(msim_sim_step(sim, 1, err));
    double **before = s->work + sim->config.integrator->carried_at + 3 * (s->cached_stage == 2);
    before[0][0] = x_at(0), before[1][0] = v_at(0), before[2][0] = -100 * x_at(h);
    s->x[0] = x_at(h), s->v[0] = v_at(h);
    s->h = ratio[i] * h, s->h_before = h;
    assert_ok(ms_island_step_make_substeps(sim, sim->config.integrator, s, 1, err));
    double *dx = s->x_spare[1], *dv = s->v_spare[1];
    sim->config.integrator->estimate(s, 0, dx, dv);
    assert_close(dx[0] / (s->x_next[0] - x_at(h + s->h)), 1, 0.03);
    assert_close(dv[0] / (s->v_next[0] - v_at(h + s->h)), 1, 0.03);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A cloth, two corners pinned or free, falls on a sloping floor. tr-bdf2 makes each step of two
 * halves, and its error is that of bdf2 with steps shorter by sqrt(0.333/0.0101) = 5.7: impacts
 * alone must not make bdf2 more expensive. */
static int64_t steps_of(const char *method, double tol, int32_t side, double k, int is_held) {
  const int32_t corners[2] = {0, side - 1};
  const double gravity[3] = {0, 0, -9.81};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = side,
                            .columns = side,
                            .origin = {0, 0, is_held ? 0.35 : 0.05},
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = k,
                            .k_shear = k / 4,
                            .k_bend = k / 100,
                            .damping = 0.01,
                            .npinned = is_held ? 2 : 0,
                            .pinned = corners};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  plane(scene, 0.1, 0, 1, 0, 0.4, 0.3);
  const msim_options opt = control_options(method, tol, 0.3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_true(stats_of(sim).contacts > 0);
  const int64_t steps = stats_of(sim).steps;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return steps;
}

static void impacts_leave_steps_long(void **state) {
  (void)state;
  const struct {
    double tol, k;
    int32_t side;
    int is_held;
  } runs[] = {{1e-3, 2000, 14, 1}, {1e-2, 500, 6, 1}, {1e-4, 300, 8, 0}, {1e-3, 800, 4, 1}};
  for (size_t i = 0; i < sizeof runs / sizeof *runs; i++) {
    const double bdf2 = (double)steps_of("bdf2", runs[i].tol, runs[i].side, runs[i].k,
                                         runs[i].is_held),
                 tr_bdf2 = (double)steps_of("tr-bdf2", runs[i].tol, runs[i].side, runs[i].k,
                                            runs[i].is_held);
    print_message("  bdf2 %.0f steps, tr-bdf2 %.0f\n", bdf2, tr_bdf2);
    assert_true(bdf2 < 5 * tr_bdf2);
  }
}

/* A ball falls from 1 m and bounces three times: steps end at the impacts. */
static void impacts_are_met(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0, 0, 0}, g = 9.81, e = 0.5, t_end = 1.2;
  const double tols[] = {1e-3, 1e-5, 1e-7};
  double up = sqrt(2 * g), left = t_end - sqrt(2 / g); /* speed before the impact, time after it */
  for (up *= e; 2 * up / g < left; up *= e) left -= 2 * up / g;
  for (int32_t m = 0; method_at(m); m++) {
    if (!takes_tol(method_at(m)) || msim_integrator_info(m)->order == 1) continue;
    /* after each impact bdf2 starts with a step of order 1, and doubles the step from there */
    const int most = strcmp(method_at(m), "bdf2") == 0 ? 150 : 100;
    for (int i = 0; i < 3; i++) {
      msim_scene *scene = make_single_particle(x, v, g);
      plane(scene, 0, 0, 1, 0, e, 0);
      const msim_options opt = control_options(method_at(m), tols[i], t_end);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_run(sim, NULL, NULL, err));
      assert_close(state_of(sim).x[2], up * left - g * left * left / 2, 30 * tols[i]);
      assert_true(stats_of(sim).contacts <= 5 && stats_of(sim).steps < most);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_first_step_is_of_order_2_under_control),
                                     cmocka_unit_test(the_estimate_of_a_step_is_its_error),
                                     cmocka_unit_test(impacts_leave_steps_long),
                                     cmocka_unit_test(impacts_are_met)};
  return cmocka_run_group_tests_name("bdf2_restart", tests, NULL, NULL);
}
