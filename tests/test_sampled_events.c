/* Tests of height fields and grids of signed distances with collision = event: planes and spheres
 * in this form, valleys, uniform motion, bodies that stay outside with bounded energy. */
#include <string.h>

#include "base/vec3.h"
#include "checkpoints.h"
#include "event_options.h"
#include "sampled_colliders.h"
#include "state_hash.h"

static const char *const methods[] = {"velocity-verlet", "rk4", "dop853", "implicit-midpoint"};
enum { NMETHODS = sizeof methods / sizeof *methods };

static msim_sim *run(const msim_scene *scene, const char *method, double T, int steps) {
  const msim_options opt = event_options(method, T / steps);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  return sim;
}

/* A particle over a slope: a plane, a height field, and a level one turned by a motion */
static msim_scene *above_slope(int kind, double e, double mu) {
  const double origin[3] = {-5, -5, -0.5}, spacing[2] = {2.5, 5}, flat[2] = {10, 10},
               x[3] = {0.1, 0.2, 0.6}, v[3] = {1, -0.5, 0};
  double values[5 * 3], level[4] = {0};
  for (int i = 0; i < 5; i++)
    for (int j = 0; j < 3; j++)
      values[3 * i + j] = 0.2 * i * spacing[0] / 2 + 0.1 * j * spacing[1] / 5;
  msim_scene *scene = make_single_particle(x, v, 9.81);
  if (kind == 0) plane(scene, -0.1, -0.02, 1, 0.1, e, mu);
  if (kind == 1) add(scene, heights(origin, spacing, 5, 3, values, e, mu), 0);
  if (kind == 2) { /* about (0, 0, 0.1), where the plane is */
    const double t = 0, middle[3] = {0, 0, 0.1}, tilt = atan(hypot(0.1, 0.02));
    const double w[3] = {0.02 / hypot(0.1, 0.02) * tilt, -0.1 / hypot(0.1, 0.02) * tilt, 0};
    add(scene, heights(origin, flat, 2, 2, level, e, mu), 0);
    set_motion(scene, 0, 1, &t, middle, w, 0);
  }
  return scene;
}

/* Bouncing, sliding and resting: friction that turns makes the parts of a path differ slightly. */
static void slopes_are_planes(void **state) {
  (void)state;
  const double e[4] = {1, 0.6, 0.3, 0}, mu[4] = {0, 0, 0.05, 0.3},
               allowed[4] = {1e-8, 1e-8, 1e-5, 1e-5};
  for (int m = 0; m < NMETHODS; m++)
    for (int i = 0; i < 4; i++) {
      double x[3][3];
      for (int kind = 0; kind < 3; kind++) {
        msim_scene *scene = above_slope(kind, e[i], mu[i]);
        msim_sim *sim = run(scene, methods[m], 1.2, 240);
        memcpy(x[kind], state_of(sim).x, sizeof x[kind]);
        assert_true(stats_of(sim).contacts > 0);
        msim_sim_destroy(sim);
        msim_scene_destroy(scene);
      }
      for (int kind = 1; kind < 3; kind++)
        for (int c = 0; c < 3; c++)
          if (!(fabs(x[kind][c] - x[0][c]) <= allowed[i]))
            fail_msg("%s, case %d, kind %d: %g", methods[m], i, kind, x[kind][c] - x[0][c]);
    }
}

/* A particle bounces off a sampled sphere nearly as off a sphere: the finer the samples, the
 * better. */
static double distance_from_sphere_run(int32_t n, double offset) {
  static double values[MOST];
  double end[2][3];
  sample_sphere(n, values);
  for (int sampled = 0; sampled < 2; sampled++) {
    const double x[3] = {offset, 0.13, 1.6}, v[3] = {0.2, 0, 0};
    msim_scene *scene = make_single_particle(x, v, 9.81);
    add(scene, sampled ? sampled_sphere(n, values, 0.7, 0.1) : sphere(0, 0, 0, 1, 0.7, 0.1), 0);
    msim_sim *sim = run(scene, "velocity-verlet", 0.5, 100);
    assert_int_equal(stats_of(sim).contacts, 1);
    memcpy(end[sampled], state_of(sim).x, sizeof end[sampled]);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  double d[3];
  for (int c = 0; c < 3; c++) d[c] = end[1][c] - end[0][c];
  return ms_vec3_norm(d);
}

static void a_sampled_sphere_is_a_sphere(void **state) {
  (void)state;
  double sum[2] = {0};
  for (int k = 0; k < 20; k++) {
    sum[0] += distance_from_sphere_run(8, -0.4 + 0.04 * k) / 20;
    sum[1] += distance_from_sphere_run(23, -0.4 + 0.04 * k) / 20;
  }
  print_message("  %g, %g\n", sum[0], sum[1]);
  assert_true(sum[0] < 0.2 && sum[1] < sum[0] / 2.5 && sum[1] < 0.05);
}

/* In a valley of two slopes, without friction, kinetic and potential energy do not grow, and with
 * friction a particle comes to rest. */
static void valleys(void **state) {
  (void)state;
  const double origin[3] = {-2, -2, 0}, spacing[2] = {0.5, 4}, x[3] = {1, 0.1, 0.7},
               v[3] = {0, 0.1, 0};
  double values[9 * 2];
  for (int i = 0; i < 9; i++)
    for (int j = 0; j < 2; j++) values[2 * i + j] = 0.05 * (i - 4) * (i - 4);
  for (int m = 0; m < NMETHODS; m++)
    for (int i = 0; i < 4; i++) {
      const double e = i % 2 ? 0.5 : 0, mu = i / 2 ? 0.4 : 0;
      msim_scene *scene = make_single_particle(x, v, 9.81);
      add(scene, heights(origin, spacing, 9, 2, values, e, mu), 0);
      const msim_options opt = event_options(methods[m], 5e-3);
      msim_sim *sim = make_sim(scene, &opt);
      double most = energies_of(sim).total;
      for (int step = 0; step < 1200; step++) {
        assert_ok(msim_sim_step(sim, 1, err));
        const double now = energies_of(sim).total, deep = least_distance(sim);
        if (!(now <= most + 1e-4))
          fail_msg("%s, %d, step %d: %g J more", methods[m], i, step, now - most);
        if (!(deep >= -1e-9)) fail_msg("%s, %d, step %d: %g m", methods[m], i, step, deep);
        most = fmin(most, now);
      }
      if (mu > 0) assert_close(energies_of(sim).kinetic, 0, 1e-12);
      assert_true(fabs(state_of(sim).x[0]) < 1);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* In the frame of rough ground at rest and in uniform motion, the same happens. */
static void ground_in_uniform_motion_is_at_rest_in_its_frame(void **state) {
  (void)state;
  const double u[3] = {0.7, -0.4, 1.1}, T = 0.8, origin[3] = {-2, -2, 0}, spacing[2] = {0.5, 0.4};
  double values[9 * 11];
  unsigned seed = 4;
  for (int k = 0; k < 99; k++) values[k] = 0.2 * uniform(&seed);
  for (int i = 0; i < 12; i++) {
    double y[2][6];
    for (int moves = 0; moves < 2; moves++) {
      const double x[3] = {0.1 * i - 0.5, 0.03 * i, 0.5};
      double v[3] = {0.4, 0.3, 0.2};
      for (int c = 0; c < 3 && moves; c++) v[c] += u[c];
      msim_scene *scene = make_single_particle(x, v, 9.81);
      add(scene, heights(origin, spacing, 9, 11, values, 0.3, 0.5), 0);
      if (moves) set_uniform(scene, origin, u, NULL);
      msim_sim *sim = run(scene, "velocity-verlet", T, 100);
      const msim_state s = state_of(sim);
      for (int c = 0; c < 3; c++) {
        y[moves][c] = s.x[c] - moves * u[c] * T;
        y[moves][3 + c] = s.v[c] - moves * u[c];
      }
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
    for (int c = 0; c < 6; c++)
      if (!(fabs(y[0][c] - y[1][c]) <= 1e-7)) fail_msg("%d: %g", i, y[0][c] - y[1][c]);
  }
}

/* By an explicit method, and by an implicit one with h = 1/60 s; runs resume, with 1 and 2 threads
 */
static void bodies_stay_outside(void **state) {
  (void)state;
  static const struct {
    const char *method;
    double h;
  } cases[] = {{"velocity-verlet", 1e-3},
               {"rk4", 1e-3},
               {"linearly-implicit-euler", 1. / 60},
               {"implicit-euler", 1. / 60}};
  unsigned seed = 12;
  for (int i = 0; i < 8; i++) {
    const char *method = cases[i / 2].method;
    const int steps = (int)(0.5 / cases[i / 2].h);
    const int64_t at[1] = {2 * steps / 3};
    msim_scene *scene = rough_scene(&seed, 0.3 * (i % 2));
    msim_options opt = options(method, cases[i / 2].h);
    opt.collision = MSIM_COLLISION_EVENT;
    uint64_t hash[2];
    for (opt.threads = 1; opt.threads <= 2; opt.threads++) {
      msim_sim *sim = make_sim(scene, &opt);
      const double start = energies_of(sim).total;
      for (int step = 0; step < steps; step++) {
        assert_ok(msim_sim_step(sim, 1, err));
        const double least = least_distance(sim), now = energies_of(sim).total;
        if (!(least >= -1e-9)) fail_msg("%s, step %d: %g m inside", method, step, -least);
        if (!(now <= start + 1e-3)) fail_msg("%s, step %d: %g J more", method, step, now - start);
      }
      assert_true(stats_of(sim).contacts > 50);
      hash[opt.threads - 1] = hash_sim(sim);
      msim_sim_destroy(sim);
    }
    assert_true(hash[0] == hash[1]);
    opt.threads = 1;
    if (i % 2) expect_resumable(scene, &opt, steps, 1, at, method);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(slopes_are_planes),
      cmocka_unit_test(a_sampled_sphere_is_a_sphere),
      cmocka_unit_test(valleys),
      cmocka_unit_test(ground_in_uniform_motion_is_at_rest_in_its_frame),
      cmocka_unit_test(bodies_stay_outside),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
