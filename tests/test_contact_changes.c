/* Tests of steps under error control in which contacts change: particles on a plane are lifted, or
 * stop. The steps end shortly before the change, go across in a short one, and then are as long as
 * before; the motion is the exact one. */
#include <math.h>

#include "checkpoints.h"
#include "integrate/control.h"
#include "sim/sim.h"

#define G     9.81
#define OMEGA 10.

/*------------------------------------- the controller -------------------------------------------*/

static ms_control make_controller(void) {
  return (ms_control){.tol = 1e-4, .span = 1, .order = 7, .h = 1, .growth = 5, .safety = 0.85};
}

static void steps_end_around_a_change(void **state) {
  (void)state;
  const double r = 1e5, across = 0.75 * 0.85 * pow(r, -1. / 7);
  ms_control c = make_controller();
  assert_false(ms_control_update(&c, 1, r, 0.6));
  assert_close(c.h, 0.6 - across / 2, 1e-15);
  assert_true(ms_control_update(&c, c.h, 0, MS_NOWHERE));
  assert_close(c.h, across, 1e-15);
  assert_true(ms_control_update(&c, across, 0.5, 0.5));
  assert_close(c.h, 1, 0);
  assert_true(ms_control_update(&c, 1, pow(0.85, 7), MS_NOWHERE));
  assert_close(c.h, 1, 1e-15);
  assert_true(ms_control_update(&c, 1, 0.9, MS_NOWHERE));
  const double shorter = c.h;
  assert_true(shorter < 1 && ms_control_update(&c, shorter, 0.9, MS_NOWHERE));
  assert_true(c.h < shorter);
}

/* A change too near to the start for a step before it, and one that was expected too late */
static void steps_go_across_at_once(void **state) {
  (void)state;
  const double r = 1e5, across = 0.75 * 0.85 * pow(r, -1. / 7);
  ms_control c = make_controller();
  assert_false(ms_control_update(&c, 1, r, 0.9 * across));
  assert_close(c.h, across, 1e-15);
  assert_true(ms_control_update(&c, across, 0.5, 0.9));
  assert_close(c.h, 1, 0);
  assert_false(ms_control_update(&c, 1, r, 0.6));
  assert_false(ms_control_update(&c, c.h, r, 0.5 * across));
  assert_true(c.h < across && c.crossing == 0);
  assert_true(ms_control_update(&c, c.h, 0.5, 0.5));
  assert_close(c.h, 1, 0);
}

/* Whatever says that the length of before is too long now, or that the motion is another one */
static void lengths_are_forgotten(void **state) {
  (void)state;
  for (int i = 0; i < 3; i++) {
    ms_control c = make_controller();
    assert_false(ms_control_update(&c, 1, 1e5, 0.6));
    assert_true(ms_control_update(&c, c.h, 0, MS_NOWHERE));
    if (i == 0) assert_false(ms_control_update(&c, c.h, 2, MS_NOWHERE));
    if (i == 1) ms_control_reject_failed(&c, c.h);
    if (i == 2) ms_control_reset(&c);
    assert_true(c.crossing == 0 && c.usual == 0 && c.h < 0.5);
  }
}

/*------------------------------------- motions --------------------------------------------------*/

/* Two masses of 1 kg on a spring of 1 m, one above the other; the lower one rests on a plane. From
 * a compression c the upper one swings about the compression g/omega^2 until the spring pulls with
 * the weight of the lower one; then the center of mass falls freely while they vibrate. */
static void find_jump(double c, double t, double *lower, double *upper) {
  const double sag = G / (OMEGA * OMEGA), a = c - sag, lift = acos(-2 * sag / a) / OMEGA;
  if (t < lift) {
    *lower = 0, *upper = 1 - sag - a * cos(OMEGA * t);
    return;
  }
  const double dt = t - lift, v = a * OMEGA * sin(OMEGA * lift), w = sqrt(2) * OMEGA,
               r = 1 + sag * cos(w * dt) + v / w * sin(w * dt),
               center = (1 + sag) / 2 + v / 2 * dt - G / 2 * dt * dt;
  *lower = center - r / 2, *upper = center + r / 2;
}

enum { PAIRS = 16 };

static double find_compression(int i) { return 0.4 + 0.01 * i; }

/* far: particles that fall from far above the plane, an island of their own if there are many */
static msim_scene *make_pairs(int far) {
  const double g[3] = {0, 0, -G}, mass[2] = {1, 1}, k = OMEGA * OMEGA, rest = 1;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < PAIRS; i++) {
    const double x[6] = {i, 0, 0, i, 0, 1 - find_compression(i)}, v[6] = {0};
    const int32_t ij[2] = {2 * i, 2 * i + 1};
    assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  }
  for (int i = 0; i < far; i++) {
    const double x[3] = {0.1 * i, 5, 5}, v[3] = {0};
    assert_ok(msim_scene_add_particles(scene, 1, x, v, mass, err));
  }
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  return scene;
}

static msim_options control_options(const char *method, double tol, double t_end) {
  msim_options opt = options(method, MSIM_H_AUTO);
  opt.collision = MSIM_COLLISION_EVENT;
  opt.tol = tol, opt.t_end = t_end, opt.steps = -1;
  return opt;
}

/* Without steps across changes dop853 makes 83, 170 and 318 attempts, rk4 65, 176 and 468. */
static void expect_exact_jumps(const char *method, double tol, int far) {
  msim_scene *scene = make_pairs(far);
  const msim_options opt = control_options(method, tol, 0.4);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_int_equal(sim->nislands, far ? 2 : 1);
  double off = 0;
  for (int i = 0; i < PAIRS; i++) {
    double lower, upper;
    find_jump(find_compression(i), opt.t_end, &lower, &upper);
    assert_true(lower > 0);
    off = fmax(off, fabs(state_of(sim).x[6 * i + 2] - lower));
    off = fmax(off, fabs(state_of(sim).x[6 * i + 5] - upper));
  }
  const msim_stats s = stats_of(sim);
  print_message("  %s, tol %.0e: off by %.2g tol; %lld steps, %lld rejected\n", method, tol,
                off / tol, (long long)s.steps, (long long)s.rejected_steps);
  assert_true(off <= tol && s.steps + s.rejected_steps <= 10 * PAIRS);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void jumps_are_exact(void **state) {
  (void)state;
  for (double tol = 1e-4; tol > 1e-9; tol /= 100) {
    expect_exact_jumps("dop853", tol, 0);
    expect_exact_jumps("rk4", tol, 0);
  }
  expect_exact_jumps("rk4", 1e-8, 600);
}

static void runs_resume_around_changes(void **state) {
  (void)state;
  msim_scene *scene = make_pairs(0);
  const msim_options opt = control_options("dop853", 1e-6, 0.4);
  msim_sim *whole = make_sim(scene, &opt), *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(whole, NULL, NULL, err));
  int planned = 0;
  while (state_of(sim).t < opt.t_end) {
    assert_ok(msim_sim_step(sim, 1, err));
    planned += sim->run.control.usual > 0;
    assert_true(sim->run.control.crossing == 0);
    checkpoint c = save(sim);
    msim_sim *other = resume(scene, &opt, &c);
    assert_ok(msim_sim_run(other, NULL, NULL, err));
    expect_same(whole, other, "resumed");
    free(c.bytes);
    msim_sim_destroy(other);
  }
  assert_true(planned >= PAIRS);
  msim_sim_destroy(whole), msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A mass on a spring without rest length slides to and fro on a plane: friction shifts the center
 * of each swing by mu g/omega^2 against the motion. */
static void swings_are_exact(void **state) {
  (void)state;
  enum { SWINGS = 12 };
  const double g[3] = {0, 0, -G}, mu = 0.2, shift = mu * G / (OMEGA * OMEGA), start = 1,
               x[6] = {0, 0, 0, start, 0, 0}, v[6] = {0}, part = 0.4;
  msim_scene *scene = make_oscillator(x, v, OMEGA * OMEGA);
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 0, mu);
  for (double tol = 1e-4; tol > 1e-9; tol /= 100) {
    const msim_options opt = control_options("dop853", tol, (SWINGS + part) * acos(-1) / OMEGA);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    const double to_center = start - (2 * SWINGS + 1) * shift,
                 exact = shift + to_center * cos(part * acos(-1)),
                 off = fabs(state_of(sim).x[3] - exact);
    const msim_stats s = stats_of(sim);
    print_message("  tol %.0e: off by %.2g tol; %lld steps, %lld rejected\n", tol, off / tol,
                  (long long)s.steps, (long long)s.rejected_steps);
    assert_true(off <= 10 * tol && s.steps + s.rejected_steps <= 19 * SWINGS);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(steps_end_around_a_change),  cmocka_unit_test(steps_go_across_at_once),
      cmocka_unit_test(lengths_are_forgotten),      cmocka_unit_test(jumps_are_exact),
      cmocka_unit_test(runs_resume_around_changes), cmocka_unit_test(swings_are_exact)};
  return cmocka_run_group_tests_name("contact_changes", tests, NULL, NULL);
}
