/* Tests of the impulses of contacts with collision = event, by all methods that have it, with fixed
 * steps and under error control: m dv of particles that bounce, rest and slide, the momentum of
 * bodies, and that recording changes no bit. */
#include <math.h>

#include "base/vec3.h"
#include "checkpoints.h"
#include "colliders.h"
#include "event_options.h"
#include "state_hash.h"

static const double weight = 9.81;

static int takes_tol(const char *method) { return strcmp(method, "takahashi-imada") != 0; }

static msim_options recording(const char *method, double h, double tol) {
  msim_options opt = event_options(method, h);
  opt.contacts = MSIM_CONTACTS_ON, opt.newton_rtol = 1e-13;
  if (tol > 0) opt.tol = tol, opt.steps = -1, opt.t_end = 2;
  return opt;
}

static void momentum_of(msim_sim *sim, double p[3]) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  for (int c = 0; c < 3; c++) p[c] = e.momentum[c];
}

/* The sum of all impulses of the last step; returns the number of contacts. */
static int32_t sum_impulses(msim_sim *sim, double sum[3]) {
  int32_t n;
  const msim_contact *all;
  assert_int_equal(msim_sim_contacts(sim, &n, &all), MSIM_OK);
  for (int c = 0; c < 3; c++) sum[c] = 0;
  for (int32_t i = 0; i < n; i++) ms_vec3_axpy(1, all[i].impulse, sum);
  return n;
}

/* The largest |m dv - m g h - sum of impulses| of the steps up to t, N s; *touched += contacts */
static double find_defect(msim_sim *sim, double mass, double t, int64_t *touched) {
  double worst = 0;
  while (state_of(sim).t < t - 1e-9) {
    const double before = state_of(sim).t;
    double p[3], q[3], sum[3];
    momentum_of(sim, p);
    assert_ok(msim_sim_step(sim, 1, err));
    momentum_of(sim, q);
    *touched += sum_impulses(sim, sum);
    for (int c = 0; c < 3; c++) {
      const double fall = c == 2 ? -weight * mass * (state_of(sim).t - before) : 0;
      worst = fmax(worst, fabs(q[c] - p[c] - fall - sum[c]));
    }
  }
  return worst;
}

/* A plane, a groove, a bowl, a ball */
static void add_obstacle(msim_scene *scene, int kind) {
  if (kind == 0) plane(scene, 0.1, 0, 1, 0, 0.6, 0.3);
  if (kind == 1) plane(scene, 1, 0, 1, 0, 0.6, 0.3), plane(scene, -1, 0, 1, -0.5, 0.6, 0.3);
  if (kind == 2) add(scene, sphere(0, 0, 0, 1, 0.5, 0.2), 1);
  if (kind == 3) add(scene, sphere(0, 0, -1, 1, 0.5, 0.2), 0);
}

/* It bounces, slides and comes to rest, also while steps are skipped, whose length tol changes. */
static void particles_change_their_momentum(void **state) {
  (void)state;
  const double x[3] = {0.1, 0, 0.3}, v[3] = {1, 0.2, -1};
  const char *method;
  for (int32_t m = 0; (method = event_method_at(m)) != NULL; m++)
    for (int kind = 0; kind < 4; kind++)
      for (int with_tol = 0; with_tol <= takes_tol(method); with_tol++) {
        msim_scene *scene = make_single_particle(x, v, weight);
        add_obstacle(scene, kind);
        const msim_options opt = recording(method, 5e-3, with_tol ? 1e-4 : 0);
        msim_sim *sim = make_sim(scene, &opt);
        int64_t touched = 0;
        const double off = find_defect(sim, 1, 1, &touched);
        if (!(off <= 1e-14) || touched < 1)
          fail_msg("%s, obstacle %d, tol %d: off by %g N s", method, kind, with_tol, off);
        msim_sim_destroy(sim);
        msim_scene_destroy(scene);
      }
}

/* m g h from below, and mu m g h against the motion while it slides */
static void lasting_contacts_carry_the_weight(void **state) {
  (void)state;
  const double x[3] = {0}, h = 0.01, mu = 0.3;
  const char *method;
  for (int32_t m = 0; (method = event_method_at(m)) != NULL; m++)
    for (int slides = 0; slides < 2; slides++) {
      const double v[3] = {2.0 * slides, 0, 0};
      msim_scene *scene = make_single_particle(x, v, weight);
      plane(scene, 0, 0, 1, 0, 0.5, mu);
      const msim_options opt = recording(method, h, 0);
      msim_sim *sim = make_sim(scene, &opt);
      for (int i = 0; i < 10; i++) {
        double sum[3];
        assert_ok(msim_sim_step(sim, 1, err));
        assert_int_equal(sum_impulses(sim, sum), 1);
        assert_close(sum[0], -mu * weight * h * slides, 1e-14);
        assert_close(sum[1], 0, 0);
        assert_close(sum[2], weight * h, 1e-14);
      }
      assert_true(slides || stats_of(sim).steps_at_rest > 0);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* A block that lands on a plane and in the corner of two, or on a ball */
static double land_block(const char *method, int which, double k, double h) {
  msim_scene *scene = falling_block(k);
  int64_t touched = 0;
  plane(scene, 0.1, 0.05, 1, 0, which == 1 ? 0.5 : 0, 0.3);
  if (which > 0) plane(scene, -1, 0, 0.2, -0.101, 0.5, 0.3);
  if (which > 1) add(scene, sphere(0.05, 0, -0.1, 0.2, 0.5, 0.2), 0);
  msim_options opt = recording(method, h, 0);
  if (k > 1e4) opt.newton_rtol = 1e-9;
  msim_sim *sim = make_sim(scene, &opt);
  const double off = find_defect(sim, 2, 0.25, &touched);
  assert_true(touched > 20 || which > 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return off;
}

/* To rounding where forces are integrated as the method does: by the trapezoidal rule, and in
 * stiff bodies by both implicit Euler methods; by others with an error of order h^3 a step */
static void bodies_change_their_momentum(void **state) {
  (void)state;
  static const char *const exact[] = {"velocity-verlet", "trapezoidal", "newmark"},
                           *const stiff[] = {"linearly-implicit-euler", "implicit-euler"},
                           *const others[] = {"heun", "rk4", "implicit-midpoint"};
  for (int i = 0; i < 3; i++)
    for (int which = 0; which < 3; which++) {
      const double off = land_block(exact[i], which, 200, 1e-3);
      if (!(off <= 1e-11)) fail_msg("%s, %d: off by %g N s", exact[i], which, off);
    }
  for (int i = 0; i < 2; i++)
    for (int which = 0; which < 3; which++) {
      const double off = land_block(stiff[i], which, 3e5, 0.01);
      if (!(off <= 1e-8)) fail_msg("%s, %d: off by %g N s", stiff[i], which, off);
    }
  for (int i = 0; i < 3; i++) {
    const double coarse = land_block(others[i], 0, 200, 5e-4),
                 fine = land_block(others[i], 0, 200, 2.5e-4);
    if (!(fine <= coarse / 6)) fail_msg("%s: %g to %g N s", others[i], coarse, fine);
  }
}

static void recording_changes_nothing(void **state) {
  (void)state;
  static const char *const methods[] = {"rk4", "symplectic-euler", "linearly-implicit-euler",
                                        "implicit-midpoint"};
  for (int i = 0; i < 8; i++) {
    msim_scene *scene = bodies(0.4, 0.5);
    msim_options opt = recording(methods[i / 2], 1. / 200, i % 2 ? 1e-2 : 0);
    opt.solver_rtol = opt.newton_rtol = 1e-8, opt.t_end = 0.2, opt.threads = 1 + i % 2;
    msim_sim *sim = make_sim(scene, &opt), *resumed = make_sim(scene, &opt);
    opt.contacts = MSIM_CONTACTS_OFF;
    msim_sim *plain = make_sim(scene, &opt);
    double sum[3], again[3];
    assert_ok(msim_sim_step(sim, 20, err));
    assert_ok(msim_sim_step(plain, 20, err));
    const checkpoint saved = save(sim);
    assert_ok(msim_sim_load(resumed, saved.bytes, saved.length, err));
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(plain, 5, err));
    assert_ok(msim_sim_step(resumed, 5, err));
    assert_true(hash_sim(sim) == hash_sim(plain));
    assert_int_equal(sum_impulses(sim, sum), sum_impulses(resumed, again));
    assert_memory_equal(sum, again, sizeof sum);
    free(saved.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(plain), msim_sim_destroy(resumed);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(particles_change_their_momentum),
                                     cmocka_unit_test(lasting_contacts_carry_the_weight),
                                     cmocka_unit_test(bodies_change_their_momentum),
                                     cmocka_unit_test(recording_changes_nothing)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
