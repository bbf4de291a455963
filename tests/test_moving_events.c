/* Tests of colliders that move with collision = event: closed forms of impacts, friction, rest and
 * release on moving surfaces, orders of accuracy, the work of colliders, depth, equal bits. */
#include <string.h>

#include "base/vec3.h"
#include "checkpoints.h"
#include "event_options.h"
#include "moving_colliders.h"
#include "path_orders.h"
#include "state_hash.h"

static const double g = 9.81;

static msim_sim *run(const msim_scene *scene, const char *method, double T, int steps) {
  const msim_options opt = event_options(method, T / steps);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  return sim;
}

/*------------------------------------- closed forms ---------------------------------------------*/

/* In the frame of a table, with and without friction, at rest and in uniform motion, a particle
 * bounces, slides and comes to rest in the same way. */
static void tables_in_uniform_motion_are_at_rest_in_their_frame(void **state) {
  (void)state;
  const double u[3] = {0.7, -0.4, 1.1}, T = 1.5, e[4] = {1, 0.6, 0.3, 0},
               mu[4] = {0, 0.2, 0.4, 0.1};
  for (int m = 0; m < NMETHODS; m++)
    for (int i = 0; i < 8; i++) {
      double y[2][6];
      for (int moves = 0; moves < 2; moves++) {
        const double x[3] = {0.1, 0.2, 0.5}, at[3] = {0, 0, -20};
        double v[3] = {1.5, 0.3, 0.2};
        for (int c = 0; c < 3 && moves; c++) v[c] += u[c];
        msim_scene *scene = make_single_particle(x, v, g);
        if (i < 4) add(scene, box(0, 0, -20, 40, e[i], mu[i]), 0);
        else add(scene, box(0, 0, 20, 40, e[i - 4], mu[i - 4]), 1);
        if (moves) set_uniform(scene, i < 4 ? at : (double[3]){0, 0, 20}, u, NULL);
        msim_sim *sim = run(scene, path_methods[m], T, 100);
        const msim_state s = state_of(sim);
        for (int c = 0; c < 3; c++) {
          y[moves][c] = s.x[c] - moves * u[c] * T;
          y[moves][3 + c] = s.v[c] - moves * u[c];
        }
        msim_sim_destroy(sim);
        msim_scene_destroy(scene);
      }
      const double off = largest_difference(y[0], y[1], 6);
      if (!(off <= 1e-8)) fail_msg("%s, case %d: %g", path_methods[m], i, off);
    }
}

/* A particle is laid on a belt of velocity V: friction accelerates it by mu g until it moves with
 * the belt. The belt does the work m mu g V t = m V^2, half of which becomes kinetic energy. */
static void a_belt_takes_a_particle_along(void **state) {
  (void)state;
  const double x[3] = {0}, v[3] = {0}, at[3] = {0, 0, -20}, V[3] = {1.3, 0, 0}, mu = 0.25, T = 1,
               stop = V[0] / (mu * g), end = V[0] * T - V[0] * stop / 2;
  for (int m = 0; m < NMETHODS; m++) {
    msim_scene *scene = make_single_particle(x, v, g);
    add(scene, box(0, 0, -20, 40, 0, mu), 0);
    set_uniform(scene, at, V, NULL);
    msim_sim *sim = run(scene, path_methods[m], T, 73);
    assert_close(state_of(sim).x[0], end, 1e-9);
    assert_close(state_of(sim).v[0], V[0], 1e-12);
    assert_close(state_of(sim).x[2], 0, 1e-10);
    assert_close(energies_of(sim).work, V[0] * V[0], 1e-4);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* The table moves as z = A s^2 (3 - 2 s), s = t/H: z'' = 6 A (1 - 2 s)/H^2, upwards to s = 1/2. It
 * pulls away from a particle at rest on it when z'' = -g: at s = (1 + g H^2/(6 A))/2. */
static void an_accelerated_table_releases_a_particle(void **state) {
  (void)state;
  const double A = 1.2, H = 0.5, s = 0.5 * (1 + g * H * H / (6 * A)), t0 = s * H, T = 0.55;
  const double z0 = A * s * s * (3 - 2 * s), w0 = 6 * A * s * (1 - s) / H, t = T - t0;
  const double z = z0 + w0 * t - g * t * t / 2, w = w0 - g * t;
  const double times[2] = {0, 0.5}, points[6] = {0, 0, -20, 0, 0, -20 + 1.2};
  assert_true(s < 1 && z > A);
  for (int m = 0; m < NMETHODS; m++)
    for (int steps = 1; steps <= 40; steps += 13) {
      const double x[3] = {0}, v[3] = {0};
      msim_scene *scene = make_single_particle(x, v, g);
      add(scene, box(0, 0, -20, 40, 0, 0.3), 0);
      set_motion(scene, 0, 2, times, points, NULL, MSIM_MOTION_CUBIC);
      msim_sim *sim = run(scene, path_methods[m], T, steps);
      const msim_state end = state_of(sim);
      if (!(fabs(end.x[2] - z) <= 1e-8 && fabs(end.v[2] - w) <= 1e-8))
        fail_msg("%s, %d steps: %g, %g", path_methods[m], steps, end.x[2] - z, end.v[2] - w);
      const msim_energy e = energies_of(sim);
      assert_close(e.work, w * w / 2 + g * z, 1e-7);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* A ball between walls, one of which oscillates as a saw-tooth (Fermi and Ulam): events in closed
 * form. */
static void a_ball_between_moving_walls(void **state) {
  (void)state;
  enum { KNOTS = 40 };
  double times[KNOTS], points[3 * KNOTS] = {0};
  for (int k = 0; k < KNOTS; k++) times[k] = 0.31 * k, points[3 * k] = -10 + (k % 2 ? 0.2 : 0);
  double x = 0.6, v = 3, t = 0;
  const double T = 9, e = 0.95;
  int bounces = 0;
  while (t < T) {
    const int k = (int)(t / 0.31 + 1e-9);
    const double end = fmin(T, 0.31 * (k + 1)), u = (k % 2 ? -0.2 : 0.2) / 0.31,
                 wall = (k % 2 ? 0.2 : 0) + u * (t - 0.31 * k);
    double dt = end - t;
    int hit = 0;
    if (v > 0 && (1 - x) / v < dt) dt = (1 - x) / v, hit = 1;
    if (v < u && (x - wall) / (u - v) < dt) dt = (x - wall) / (u - v), hit = 2;
    x += v * dt, t = hit ? t + dt : end;
    if (hit == 1) v = -e * v;
    if (hit == 2) v = u - e * (v - u);
    bounces += hit > 0;
  }
  assert_true(bounces > 20);
  for (int m = 0; m < NMETHODS; m++)
    for (int i = 0; i < 2; i++) {
      const double from[3] = {0.6, 0, 0}, speed[3] = {3, 0, 0};
      msim_scene *scene = make_single_particle(from, speed, 0);
      add(scene, box(-10, 0, 0, 20, e, 0), 0);
      set_motion(scene, 0, KNOTS, times, points, NULL, 0);
      plane(scene, -1, 0, 0, -1, e, 0);
      msim_sim *sim = run(scene, path_methods[m], T, i ? 900 : 17);
      const msim_state s = state_of(sim);
      if (!(fabs(s.x[0] - x) <= 1e-9 && fabs(s.v[0] - v) <= 1e-9))
        fail_msg("%s, %d: %g, %g", path_methods[m], i, s.x[0] - x, s.v[0] - v);
      assert_int_equal(stats_of(sim).contacts, bounces);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* On a disk that rotates about z a particle that sticks moves on a circle; one without friction
 * stays where it is, up to the error of steps, W^3 h^2 T r/12. */
static void a_disk_rotates_below_particles(void **state) {
  (void)state;
  const double zero[3] = {0, 0, -1}, up[3] = {0, 0, 1}, w[3] = {0, 0, 2}, none[3] = {0}, T = 0.9;
  for (int m = 0; m < NMETHODS; m++)
    for (int i = 0; i < 2; i++) {
      const double x[3] = {0.5, 0, 0}, v[3] = {0, i ? 0 : 1, 0};
      msim_scene *scene = make_single_particle(x, v, g);
      add(scene, round_bar(MSIM_COLLIDER_CYLINDER, zero, up, 8, 0, i ? 0 : 1), 0);
      set_uniform(scene, zero, none, w);
      msim_sim *sim = run(scene, path_methods[m], T, 60);
      const msim_state s = state_of(sim);
      const double allowed = i ? 2e-4 : 1e-9;
      assert_close(s.x[0], i ? 0.5 : 0.5 * cos(2 * T), allowed);
      assert_close(s.x[1], i ? 0 : 0.5 * sin(2 * T), allowed);
      assert_close(s.v[0], i ? 0 : -sin(2 * T), allowed);
      assert_close(s.x[2], 0, 1e-10);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* A particle slides without friction along the upper face of a plate that rotates about y by
 * a = W t. In its frame q'' = W^2 q + g sin a along the face, which is at the height d: from rest
 * there q = q0 cosh a + g/(2 W^2) (sinh a - sin a). */
static void a_particle_slides_on_a_tilting_plate(void **state) {
  (void)state;
  const double W = -1.1, T = 0.7, a = W * T, q0 = 0.4, d = 0.1, none[3] = {0}, w[3] = {0, W, 0};
  const double q = q0 * cosh(a) + g / (2 * W * W) * (sinh(a) - sin(a));
  const double exact[3] = {q * cos(a) + d * sin(a), 0, d * cos(a) - q * sin(a)};
  for (int m = 0; m < NMETHODS; m++) {
    double error[4];
    for (int k = 0; k < 4; k++) {
      const double x[3] = {q0, 0, d}, v[3] = {W * d, 0, -q0 * W};
      msim_scene *scene = make_single_particle(x, v, g);
      msim_collider plate = box(0, 0, 0, 40, 0, 0);
      plate.extent[2] = 2 * d;
      add(scene, plate, 0);
      set_uniform(scene, none, none, w);
      msim_sim *sim = run(scene, path_methods[m], T, 20 << k);
      error[k] = largest_difference(state_of(sim).x, exact, 3);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
    expect_order(path_methods[m], error, 4, 1.75);
    assert_true(error[3] < 1e-4);
  }
}

/*------------------------------------- order ----------------------------------------------------*/

/* A particle on a spring over a sphere that moves along a cubic path */
static msim_scene *spring_above_sphere(double e, double mu) {
  const double x[6] = {0, 0, 2.2, 0.6, 0.2, 1.9}, mass[2] = {1, 1}, k = 30, rest = 0.5;
  const double t[5] = {-0.5, 0.6, 1.4, 2.3, 3.6},
               points[15] = {0, 0, 0.3, 0.3, 0.1, 0.6, -0.1, 0.1, 0.4, 0.1, -0.2, 0.7, 0, 0, 0};
  const int32_t pin = 0, ij[2] = {0, 1};
  msim_scene *scene = new_scene();
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  add(scene, sphere(0, 0, 0.5, 0.5, e, mu), 0);
  set_motion(scene, 0, 5, t, points, NULL, MSIM_MOTION_CUBIC);
  return scene;
}

static void order_is_kept_through_impacts_on_a_sphere(void **state) {
  (void)state;
  for (int i = 0; i < 2 * NMETHODS; i++) {
    msim_scene *scene = spring_above_sphere(i % 2 ? 0.5 : 1, i % 2 ? 0.3 : 0);
    msim_sim *sim = run(scene, "dop853", 2, 40000);
    double exact[3], error[4] = {0};
    memcpy(exact, state_of(sim).x + 3, sizeof exact);
    const int64_t contacts = stats_of(sim).contacts;
    const double balance = balance_of(sim);
    msim_sim_destroy(sim);
    for (int k = 0; k < 4; k++)
      for (int n = 0; n < 5; n++) { /* the place of the impact in its step varies */
        sim = run(scene, path_methods[i / 2], 2, (160 << k) + n * (23 << k));
        error[k] += largest_difference(state_of(sim).x + 3, exact, 3) / 5;
        assert_int_equal(stats_of(sim).contacts, contacts);
        if (k == 3) assert_close(balance_of(sim), balance, 2e-3);
        msim_sim_destroy(sim);
      }
    print_message("  %s: %lld contacts, %g %g %g %g\n", path_methods[i / 2], (long long)contacts,
                  error[0], error[1], error[2], error[3]);
    expect_order(path_methods[i / 2], error, 4, 1.75);
    assert_true(error[3] < 1e-3);
    msim_scene_destroy(scene);
  }
}

static void error_control_keeps_tol(void **state) {
  (void)state;
  static const char *const controlled[] = {"dop853", "rk4", "tr-bdf2", "velocity-verlet"};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene = spring_above_sphere(i ? 0.5 : 1, i ? 0.3 : 0);
    msim_sim *sim = run(scene, "dop853", 2, 40000);
    double exact[3];
    memcpy(exact, state_of(sim).x + 3, sizeof exact);
    msim_sim_destroy(sim);
    for (size_t m = 0; m < sizeof controlled / sizeof *controlled; m++)
      for (int digits = 3; digits <= 5; digits++) {
        msim_options opt = options(controlled[m], 1e-2);
        opt.tol = pow(10, -digits), opt.t_end = 2, opt.steps = -1;
        sim = make_sim(scene, &opt);
        assert_ok(msim_sim_run(sim, NULL, NULL, err));
        const double error = largest_difference(state_of(sim).x + 3, exact, 3);
        if (!(error <= 3 * opt.tol)) fail_msg("%s: %g with tol %g", controlled[m], error, opt.tol);
        msim_sim_destroy(sim);
      }
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- random scenes --------------------------------------------*/

static msim_collider random_collider(unsigned *seed, double e, double mu) {
  double x[3], along[3];
  for (int c = 0; c < 3; c++) x[c] = 0, along[c] = uniform(seed) - 0.5;
  switch ((int)(4 * uniform(seed))) {
    case 0:
      return sphere(x[0], x[1], x[2], 0.2 + 0.5 * uniform(seed), e, mu);
    case 1:
      return box(x[0], x[1], x[2], 0.3 + 0.6 * uniform(seed), e, mu);
    default:
      return round_bar(2 * uniform(seed) < 1 ? MSIM_COLLIDER_CAPSULE : MSIM_COLLIDER_CYLINDER, x,
                       along, 0.1 + 0.3 * uniform(seed), e, mu);
  }
}

/* A random path through a room, linear or cubic, with rotations */
static void set_random_motion(msim_scene *scene, unsigned *seed, int rotates) {
  double t[6], x[18], w[18];
  for (int k = 0; k < 6; k++) {
    t[k] = 0.2 * k + 0.1 * uniform(seed);
    for (int c = 0; c < 3; c++) {
      x[3 * k + c] = 1.6 * (2 * uniform(seed) - 1);
      w[3 * k + c] = k ? w[3 * k - 3 + c] + 2 * uniform(seed) - 1 : 0;
    }
  }
  set_motion(scene, scene->data->ncolliders - 1, 6, t, x, rotates ? w : NULL, uniform(seed) < 0.5);
}

static msim_scene *random_scene(unsigned *seed, int32_t n, double e, double mu) {
  msim_scene *scene = new_scene();
  for (int32_t i = 0; i < n; i++) {
    double x[3], v[3], mass = 0.5 + uniform(seed);
    for (int c = 0; c < 3; c++) x[c] = 2 * uniform(seed) - 1, v[c] = 2 * uniform(seed) - 1;
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  }
  add(scene, random_collider(seed, e, mu), 0);
  set_random_motion(scene, seed, uniform(seed) < 0.5);
  return scene;
}

/* Without friction and with e = 1 energy less work is constant; else it never grows. */
static void work_balances_energy(void **state) {
  (void)state;
  unsigned seed = 21;
  int64_t contacts = 0;
  for (int i = 0; i < 60; i++) {
    const int elastic = i % 2;
    const double e = elastic ? 1 : uniform(&seed), mu = elastic ? 0 : uniform(&seed);
    msim_scene *scene = random_scene(&seed, 60, e, mu);
    const msim_options opt = event_options(path_methods[i % 3 ? 0 : 4], 5e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 1, err)); /* particles in colliders are moved out */
    expect_balance(i, sim, elastic, 1e-5, 1e-9);
    contacts += stats_of(sim).contacts;
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  print_message("  %lld contacts\n", (long long)contacts);
  assert_true(contacts > 500);
}

/*------------------------------------- stiff bodies ---------------------------------------------*/

/* A stiff pair, h omega = 20, rests on a table that moves up, and is carried by a belt; the work is
 * that of its weight, and of friction. */
static void a_stiff_pair_is_lifted(void **state) {
  (void)state;
  const char *const stiff[] = {"linearly-implicit-euler", "implicit-euler", "implicit-midpoint"};
  const double x[6] = {0, 0, 0, 0.3, 0, 0}, mass[2] = {0.5, 0.5}, k = 2e5, u[3] = {0.4, 0, 0.3},
               at[3] = {0, 0, -20};
  const int32_t ij[2] = {0, 1};
  for (int m = 0; m < 3; m++) {
    msim_scene *scene = new_scene();
    double v[6];
    for (int c = 0; c < 6; c++) v[c] = u[c % 3] * (c % 3 == 2);
    assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
    add(scene, box(0, 0, -20, 40, 0, 0.5), 0);
    set_uniform(scene, at, u, NULL);
    msim_sim *sim = run(scene, stiff[m], 1, 60);
    const msim_state s = state_of(sim);
    for (int p = 0; p < 2; p++) {
      assert_close(s.x[3 * p + 2], u[2], 1e-10);
      assert_close(s.v[3 * p + 2], u[2], 1e-10);
      assert_close(s.v[3 * p], u[0], 1e-6);
    }
    assert_close(energies_of(sim).work, g * u[2] + u[0] * u[0], 0.02);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A cloth on a sphere and a box, a rope over a capsule, a jelly; the sphere or the capsule moves */
static msim_scene *bodies_on_moving_colliders(int rope) {
  const double t[4] = {0, 0.2, 0.5, 0.8},
               displacement[12] = {0, 0, 0, 0.05, 0, 0.1, -0.05, 0.1, 0.02, 0, 0, 0},
               w[12] = {0, 0, 0, 0, 0, 0.3, 0.2, 0, 0.5, 0, 0, 0};
  msim_scene *scene = bodies(0.4, 0.3);
  const int32_t collider = rope ? 2 : 0;
  double x[12];
  for (int k = 0; k < 12; k++) x[k] = scene->data->solids[collider].center[k % 3] + displacement[k];
  set_motion(scene, collider, 4, t, x, w, MSIM_MOTION_CUBIC);
  return scene;
}

/* They stay outside, and energy less work does not grow; runs resume from checkpoints and clones,
 * with 1 and 2 threads. */
static void bodies_stay_outside(void **state) {
  (void)state;
  static const struct {
    const char *method;
    double h;
  } cases[] = {{"velocity-verlet", 1e-3}, {"linearly-implicit-euler", 1. / 60}};
  for (int i = 0; i < 4; i++) {
    const char *method = cases[i / 2].method;
    const int steps = (int)(0.5 / cases[i / 2].h);
    const int64_t at[1] = {2 * steps / 3};
    msim_scene *scene = bodies_on_moving_colliders(i % 2);
    msim_options opt = options(method, cases[i / 2].h);
    opt.collision = MSIM_COLLISION_EVENT;
    uint64_t hash[2];
    for (opt.threads = 1; opt.threads <= 2; opt.threads++) {
      msim_sim *sim = make_sim(scene, &opt);
      const double start = balance_of(sim);
      for (int step = 0; step < steps; step++) {
        assert_ok(msim_sim_step(sim, 1, err));
        const double least = least_distance(sim), more = balance_of(sim) - start;
        if (!(least >= -1e-9)) fail_msg("%s, step %d: %g m inside", method, step, -least);
        if (!(more <= 1e-3)) fail_msg("%s, step %d: %g J more", method, step, more);
      }
      assert_true(stats_of(sim).contacts > 100 && fabs(energies_of(sim).work) > 1e-3);
      hash[opt.threads - 1] = hash_sim(sim);
      msim_sim_destroy(sim);
    }
    assert_true(hash[0] == hash[1]);
    opt.threads = 1;
    expect_resumable(scene, &opt, steps, 1, at, method);
    msim_scene_destroy(scene);
  }
}

/* Islands that a change of the motion leaves as they are meet the collider on its new path. */
static void a_collider_is_moved_in_a_run(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0.5, 5, 0, 0.5}, mass[2] = {1, 1}, to[3] = {0, 0, -19.7};
  msim_scene *scene = new_scene();
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  add(scene, box(0, 0, -20, 40, 0, 0.3), 0);
  msim_sim *sim = run(scene, "velocity-verlet", 0.5, 50);
  assert_ok(msim_sim_move_collider(sim, 0, to, NULL, 0.5, err));
  assert_ok(msim_sim_step(sim, 40, err));
  for (int p = 0; p < 2; p++) {
    assert_close(state_of(sim).x[3 * p + 2], 0.24, 1e-9);
    assert_close(state_of(sim).v[3 * p + 2], 0.6, 1e-9);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(tables_in_uniform_motion_are_at_rest_in_their_frame),
      cmocka_unit_test(a_belt_takes_a_particle_along),
      cmocka_unit_test(an_accelerated_table_releases_a_particle),
      cmocka_unit_test(a_ball_between_moving_walls),
      cmocka_unit_test(a_disk_rotates_below_particles),
      cmocka_unit_test(a_particle_slides_on_a_tilting_plate),
      cmocka_unit_test(order_is_kept_through_impacts_on_a_sphere),
      cmocka_unit_test(error_control_keeps_tol),
      cmocka_unit_test(work_balances_energy),
      cmocka_unit_test(a_stiff_pair_is_lifted),
      cmocka_unit_test(bodies_stay_outside),
      cmocka_unit_test(a_collider_is_moved_in_a_run),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
