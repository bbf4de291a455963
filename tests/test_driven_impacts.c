/* Tests of impacts that are located while pinned particles move or forces depend on time: against
 * the closed solution between impacts, and the balance of energy and work. */
#include "event_options.h"
#include "force_functions.h"

/* A ball on a spring of rest length 0, whose other end moves at the speed U, above a floor at 0:
 *   x'' = W^2 (P + U t - x) - G + PUSH sin(OMEGA t) */
#define W     3.0
#define G     9.81
#define P     1.5
#define U     -0.1
#define OMEGA 5.0
#define PUSH  1.5
#define START 1.2
#define T     2.0

static double push_of(int pushed) { return pushed ? PUSH : 0; }

/* x and v at t on the solution through x0, v0 at t0 */
static void follow(int pushed, double t0, double x0, double v0, double t, double *x, double *v) {
  const double a = push_of(pushed) / (W * W - OMEGA * OMEGA), rest = P - G / (W * W);
  const double q0 = rest + U * t0 + a * sin(OMEGA * t0), u0 = U + a * OMEGA * cos(OMEGA * t0);
  const double c = cos(W * (t - t0)), s = sin(W * (t - t0));
  *x = rest + U * t + a * sin(OMEGA * t) + (x0 - q0) * c + (v0 - u0) / W * s;
  *v = U + a * OMEGA * cos(OMEGA * t) - (x0 - q0) * W * s + (v0 - u0) * c;
}

/* The state at T; returns the number of impacts. */
static int solve(int pushed, double restitution, double *x, double *v) {
  const double dt = 1e-4;
  double t0 = 0, x0 = START, v0 = 0;
  int impacts = 0;
  for (double t = dt; t < T; t += dt) {
    follow(pushed, t0, x0, v0, t, x, v);
    if (*x > 0) continue;
    double lo = fmax(t0, t - dt), hi = t;
    for (int i = 0; i < 60; i++) {
      const double middle = (lo + hi) / 2;
      follow(pushed, t0, x0, v0, middle, x, v);
      if (*x > 0) lo = middle;
      else hi = middle;
    }
    follow(pushed, t0, x0, v0, hi, x, v);
    t0 = hi, x0 = 0, v0 = -restitution * *v;
    impacts++;
  }
  follow(pushed, t0, x0, v0, T, x, v);
  return impacts;
}

static msim_scene *driven_ball(field *of, double restitution) {
  const double x[6] = {0, 0, P, 0, 0, START}, mass[2] = {1, 1}, k = W * W, rest = 0;
  const double gravity[3] = {0, 0, -G}, t[2] = {0, 2 * T}, path[6] = {0, 0, P, 0, 0, P + 2 * T * U};
  const int32_t ij[2] = {0, 1}, pin = 0;
  const msim_motion m = {.size = sizeof m, .n = 1, .particles = &pin, .nt = 2, .t = t, .x = path};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  assert_ok(msim_scene_add_motion(scene, &m, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  plane(scene, 0, 0, 1, 0, restitution, 0);
  if (!of) return scene;
  const msim_force_function function = field_function(of, MSIM_FORCE_TIME);
  assert_ok(msim_scene_set_force_function(scene, &function, err));
  return scene;
}

/* The error of x and v at T; *drift: the change of energy less work */
static double error_of(const msim_options *opt, int pushed, double restitution, int64_t steps,
                       double *drift) {
  field of = {.omega = OMEGA, .push = {0, 0, PUSH}};
  double x, v;
  assert_true(solve(pushed, restitution, &x, &v) >= 1);
  msim_scene *scene = driven_ball(pushed ? &of : NULL, restitution);
  msim_sim *sim = make_sim(scene, opt);
  const double before = energy_less_work(sim);
  if (steps) assert_ok(msim_sim_step(sim, steps, err));
  else assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const msim_state now = state_of(sim);
  const double error = fmax(fabs(now.x[5] - x), fabs(now.v[5] - v));
  assert_close(now.t, T, 1e-12);
  *drift = energy_less_work(sim) - before;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return error;
}

static double error_at(const char *method, int pushed, double restitution, int64_t steps,
                       double *drift) {
  msim_options opt = event_options(method, T / (double)steps);
  opt.newton_rtol = 1e-13, opt.solver_rtol = 1e-13;
  return error_of(&opt, pushed, restitution, steps, drift);
}

/* Impacts fall at other shares of a step at each h, so that the order is that over a factor 64 of
 * h, or 8 where the error soon comes near rounding. */
static void methods_keep_their_order(void **state) {
  (void)state;
  static const struct {
    const char *method;
    int64_t most;
    double order;
  } methods[] = {
      {"velocity-verlet", 6400, 1.7},  {"heun", 6400, 1.7},    {"implicit-midpoint", 6400, 1.7},
      {"trapezoidal", 6400, 1.7},      {"tr-bdf2", 6400, 1.7}, {"bdf2", 6400, 1.7},
      {"symplectic-euler", 6400, 0.9}, {"rk4", 800, 3.5},      {"force-gradient", 800, 3.5}};
  for (int pushed = 0; pushed < 2; pushed++)
    for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
      double unused;
      const int64_t least = 100, most = methods[i].most;
      const double coarse = error_at(methods[i].method, pushed, 0.8, least, &unused),
                   fine = error_at(methods[i].method, pushed, 0.8, most, &unused);
      const double order = log(coarse / fine) / log((double)most / (double)least);
      if (!(order >= methods[i].order || fine < 1e-12))
        fail_msg("%s, pushed %d: errors %g and %g, order %g", methods[i].method, pushed, coarse,
                 fine, order);
    }
}

static void error_control_keeps_tol(void **state) {
  (void)state;
  static const char *const methods[] = {"dop853", "velocity-verlet", "tr-bdf2"};
  for (int pushed = 0; pushed < 2; pushed++)
    for (int i = 0; i < 3; i++) {
      double unused;
      msim_options opt = event_options(methods[i], 0.01);
      opt.tol = i ? 1e-4 : 1e-9, opt.t_end = T, opt.steps = -1;
      const double error = error_of(&opt, pushed, 0.8, 0, &unused);
      if (!(error <= 20 * opt.tol)) fail_msg("%s: error %g at tol %g", methods[i], error, opt.tol);
    }
}

/* At restitution 1 nothing dissipates. */
static void energy_is_balanced(void **state) {
  (void)state;
  static const char *const methods[] = {"rk4", "dop853"};
  for (int pushed = 0; pushed < 2; pushed++)
    for (int i = 0; i < 2; i++) {
      double coarse, fine;
      error_at(methods[i], pushed, 1, 128, &coarse);
      error_at(methods[i], pushed, 1, 1024, &fine);
      if (!(fabs(coarse) < 1e-3 && fabs(fine) < 2e-5))
        fail_msg("%s, pushed %d: energy less work changes by %g and %g J", methods[i], pushed,
                 coarse, fine);
    }
}

/* Contact in the matrix, h omega = 60: a rope is lowered onto a floor and drawn along it. */
static void stiff_ropes_are_laid_down(void **state) {
  (void)state;
  enum { N = 20, END = 3 * (N - 1) };
  static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler", "bdf2"};
  const double gravity[3] = {0, 0, -G}, t[3] = {0, 1, 2};
  const double path[9] = {0, 0, 1.2, 0, 0, 0.05, 0.6, 0, 0.05};
  const int32_t pin = 0;
  const msim_rope rope = {.size = sizeof rope,
                          .n = N,
                          .from = {0, 0, 1.2},
                          .to = {1, 0, 1.2},
                          .mass = 0.2,
                          .k = 4000,
                          .npinned = 1,
                          .pinned = &pin};
  const msim_motion m = {.size = sizeof m, .n = 1, .particles = &pin, .nt = 3, .t = t, .x = path};
  for (int i = 0; i < 3; i++) {
    msim_options opt = options(methods[i], 1. / 60);
    opt.collision = MSIM_COLLISION_EVENT;
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_rope(scene, &rope, err));
    assert_ok(msim_scene_add_motion(scene, &m, err));
    assert_ok(msim_scene_set_gravity(scene, gravity, err));
    plane(scene, 0, 0, 1, 0, 0, 0.3);
    msim_sim *sim = make_sim(scene, &opt);
    for (int step = 0; step < 240; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      const msim_state now = state_of(sim);
      for (int32_t p = 0; p < N; p++)
        if (!(now.x[3 * p + 2] >= -1e-12))
          fail_msg("%s, step %d: particle %d is at z = %g", methods[i], step, p, now.x[3 * p + 2]);
    }
    const msim_state now = state_of(sim);
    assert_close(now.x[0], 0.6, 1e-12);
    assert_true(now.x[END + 2] < 1e-6 && fabs(now.v[END]) < 0.05);
    msim_energy e = {.size = sizeof e};
    assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
    assert_true(e.kinetic + e.elastic < 0.02 * 0.2 * G * 1.2);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(methods_keep_their_order), cmocka_unit_test(error_control_keeps_tol),
      cmocka_unit_test(energy_is_balanced), cmocka_unit_test(stiff_ropes_are_laid_down)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
