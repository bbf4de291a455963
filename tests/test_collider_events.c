/* Tests of colliders with collision = event: closed forms of impacts, sliding and release on curved
 * surfaces, orders of accuracy, edges, thin solids. */
#include <string.h>

#include "base/vec3.h"
#include "colliders.h"
#include "path_orders.h"
#include "event_options.h"

static const double pi = 3.14159265358979323846;

static int64_t run(const msim_scene *scene, const char *method, double T, int steps, double *x,
                   double *v) {
  const msim_options opt = event_options(method, T / steps);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  const msim_state s = state_of(sim);
  memcpy(x, s.x, 3 * (size_t)s.n * sizeof *x);
  memcpy(v, s.v, 3 * (size_t)s.n * sizeof *v);
  const int64_t contacts = stats_of(sim).contacts;
  msim_sim_destroy(sim);
  return contacts;
}

static double distance(const double *x, const double *y) {
  const double d[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
  return ms_vec3_norm(d);
}

/*------------------------------------- closed forms ---------------------------------------------*/

/* On a circle inside a sphere or a cylinder, without gravity: v' = -mu v^2/R, so that
 * v = v0/(1 + mu v0 t/R), and the angle is ln(1 + mu v0 t/R)/mu. */
static void friction_of_a_circular_motion(void **state) {
  (void)state;
  const double R = 2, v0 = 3, mu = 0.4, T = 2, x[3] = {R, 0, 0}, v[3] = {0, v0, 0};
  const double along[3] = {0, 0, 1}, center[3] = {0};
  for (int i = 0; i < 2 * NMETHODS; i++) {
    msim_scene *scene = make_single_particle(x, v, 0);
    const msim_collider bar = round_bar(MSIM_COLLIDER_CYLINDER, center, along, R, 0, mu);
    add(scene, i % 2 ? bar : sphere(0, 0, 0, R, 0, mu), 1);
    double error[4], y[3], w[3];
    for (int k = 0; k < 4; k++) {
      run(scene, path_methods[i / 2], T, 50 << k, y, w);
      const double slower = 1 + mu * v0 * T / R, angle = log(slower) / mu;
      error[k] =
          fabs(remainder(atan2(y[1], y[0]) - angle, 2 * pi)) + fabs(ms_vec3_norm(w) - v0 / slower);
      assert_close(ms_vec3_norm(y), R, 1e-14);
      assert_close(ms_vec3_dot(y, w), 0, 1e-14);
    }
    expect_order(path_methods[i / 2], error, 4, 1.9);
    assert_true(error[3] < 1e-4);
    msim_scene_destroy(scene);
  }
}

/* A particle slides off a sphere from rest at the angle a: it leaves where cos = 2/3 cos(a), and
 * keeps the horizontal velocity that it has there. */
static void a_particle_leaves_a_sphere(void **state) {
  (void)state;
  const double g = 9.81, a = 0.1, x[3] = {sin(a), 0, cos(a)}, v[3] = {0};
  const double c = 2. / 3 * cos(a), vx = c * sqrt(2 * g * (cos(a) - c));
  for (int i = 0; i < NMETHODS; i++) {
    msim_scene *scene = make_single_particle(x, v, g);
    add(scene, sphere(0, 0, 0, 1, 0, 0), 0);
    double error[5] = {0}, y[3], w[3];
    for (int k = 0; k < 5; k++)
      for (int n = 0; n < 5; n++) { /* the place of the release in its step varies */
        run(scene, path_methods[i], 1.1, (40 << k) + n * (7 << k), y, w);
        assert_true(ms_vec3_norm(y) > 1.01);
        error[k] += fabs(w[0] - vx) / 5;
      }
    expect_order(path_methods[i], error, 5, 1.8);
    assert_true(error[4] < 1e-4);
    msim_scene_destroy(scene);
  }
}

/* Inside a sphere, from its foot: with v^2 = 6 g R a full loop on the surface; with v^2 = 4 g R the
 * particle leaves at the angle asin(2/3) above the center, where v^2 = 2/3 g R. */
static void loops_inside_a_sphere(void **state) {
  (void)state;
  const double g = 9.81, R = 0.5, x[3] = {0, 0, -R};
  for (int i = 0; i < 2 * NMETHODS; i++) {
    const int falls = i % 2;
    const double v[3] = {sqrt((falls ? 4 : 6) * g * R), 0, 0}, vx = -2. / 3 * sqrt(2. / 3 * g * R);
    msim_scene *scene = make_single_particle(x, v, g);
    add(scene, sphere(0, 0, 0, R, 0.5, 0), 1);
    double error[4], y[3], w[3];
    for (int k = 0; k < 4; k++) {
      run(scene, path_methods[i / 2], falls ? 0.45 : 0.7, 64 << k, y, w);
      error[k] = falls ? fabs(w[0] - vx)
                       : fabs(ms_vec3_dot(w, w) / 2 + g * y[2] - ms_vec3_dot(v, v) / 2 + g * R);
      if (!falls) assert_close(ms_vec3_norm(y), R, 1e-15);
      else assert_true(ms_vec3_norm(y) < 0.99 * R);
    }
    expect_order(path_methods[i / 2], error, 4, 1.7);
    msim_scene_destroy(scene);
  }
}

/* A particle slides over the flat top of a box, or of a cylinder, with friction: its speed at the
 * edge is sqrt(v^2 - 2 mu g d), then it falls freely. */
static void a_particle_slides_off_an_edge(void **state) {
  (void)state;
  const double g = 9.81, mu = 0.2, d = 0.5, x[3] = {0, 0, 0}, v[3] = {2, 0.3, 0}, T = 0.6;
  const double speed = ms_vec3_norm(v), cosine = v[0] / speed, below[3] = {0, 0, -1},
               up[3] = {0, 0, 1};
  for (int i = 0; i < 2 * NMETHODS; i++) {
    const int is_round = i % 2;
    const double distance = is_round ? d : d / cosine,
                 u = sqrt(speed * speed - 2 * mu * g * distance);
    const double fall = T - (speed - u) / (mu * g), far = (distance + u * fall) * cosine;
    msim_scene *scene = make_single_particle(x, v, g);
    msim_collider c = round_bar(MSIM_COLLIDER_CYLINDER, below, up, d, 0.5, mu);
    if (!is_round) c = box(0, 0, -d, 2 * d, 0.5, mu);
    add(scene, c, 0);
    double y[3], w[3];
    run(scene, path_methods[i / 2], T, 87, y, w);
    assert_close(y[0], far, 1e-9);
    assert_close(y[2], -g * fall * fall / 2, 1e-9);
    assert_close(w[0], u * cosine, 1e-9);
    msim_scene_destroy(scene);
  }
}

/* Faces of boxes and cylinders inside out are planes. */
static void rooms_are_planes(void **state) {
  (void)state;
  const double x[3] = {0.1, 0.2, 0.3}, v[3] = {3, -2, 1}, e = 0.8, mu = 0.1;
  for (int32_t m = 0; event_method_at(m); m++) {
    msim_scene *scenes[2] = {make_single_particle(x, v, 9.81), make_single_particle(x, v, 9.81)};
    for (int k = 0; k < 3; k++)
      for (int side = 1; side >= -1; side -= 2)
        plane(scenes[0], k == 0 ? side : 0, k == 1 ? side : 0, k == 2 ? side : 0, -1, e, mu);
    add(scenes[1], box(0, 0, 0, 2, e, mu), 1);
    double y[2][3], w[2][3];
    int64_t contacts[2];
    for (int i = 0; i < 2; i++)
      contacts[i] = run(scenes[i], event_method_at(m), 2, 200, y[i], w[i]);
    assert_int_equal(contacts[0], contacts[1]);
    for (int c = 0; c < 3; c++) assert_close(y[0][c], y[1][c], 1e-14);
    for (int c = 0; c < 3; c++) assert_close(w[0][c], w[1][c], 1e-14);
    for (int i = 0; i < 2; i++) msim_scene_destroy(scenes[i]);
  }
}

static msim_collider random_collider(unsigned *seed) {
  double x[3], along[3];
  for (int i = 0; i < 3; i++) x[i] = 1.6 * uniform(seed) - 0.8, along[i] = 0.3 * uniform(seed);
  const double e = 0.7 + 0.3 * uniform(seed), mu = uniform(seed) / 2,
               size = 0.2 + uniform(seed) / 4;
  const int32_t type = MSIM_COLLIDER_SPHERE + (int32_t)(4 * uniform(seed));
  if (type == MSIM_COLLIDER_SPHERE) return sphere(x[0], x[1], x[2], size, e, mu);
  if (type != MSIM_COLLIDER_BOX) return round_bar(type, x, along, size, e, mu);
  msim_collider c = box(x[0], x[1], x[2], size, e, mu);
  for (int i = 0; i < 3; i++) c.rotation[i] = 9 * along[i];
  return c;
}

/* Between impacts the path of a particle is a parabola, whatever the step: one step, in which it
 * bounces several times, and 50 steps lead to the same point. */
static void one_step_or_many(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1.5}, T = 0.8;
  unsigned seed = 4;
  int bounces = 0;
  for (int i = 0; i < 300; i++) {
    const double v[3] = {6 * uniform(&seed) - 3, 6 * uniform(&seed) - 3, -5 * uniform(&seed)};
    msim_scene *scene = make_single_particle(x, v, 9.81);
    for (int k = 0; k < 4; k++) add(scene, random_collider(&seed), 0);
    const double along[3] = {0, 0, i % 3}, center[3] = {0};
    add(scene, round_bar(MSIM_COLLIDER_CAPSULE, center, along[2] > 0 ? along : x, 1.8, 0.9, 0.1),
        1);
    double y[3][3], w[3];
    const int64_t n = run(scene, "velocity-verlet", T, 1, y[0], w);
    const int64_t more = run(scene, "velocity-verlet", T, 50, y[1], w);
    run(scene, "rk4", T, 3, y[2], w);
    assert_int_equal(n, more);
    if (n <= 3) { /* errors grow at each impact */
      assert_true(distance(y[0], y[1]) < 1e-7 && distance(y[0], y[2]) < 1e-7);
      bounces += (int)n;
    }
    msim_scene_destroy(scene);
  }
  assert_true(bounces > 200);
}

/*------------------------------------- orders ---------------------------------------------------*/

/* A particle on a spring bounces off a sphere, twice. */
static msim_scene *spring_above_sphere(double e, double mu) {
  const double x[6] = {0, 0, 2.2, 0.6, 0.2, 1.9}, mass[2] = {1, 1}, k = 30, rest = 0.5;
  const int32_t pin = 0, ij[2] = {0, 1};
  msim_scene *scene = new_scene();
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  add(scene, sphere(0, 0, 0.5, 0.5, e, mu), 0);
  return scene;
}

static void order_is_kept_through_impacts_on_a_sphere(void **state) {
  (void)state;
  for (int i = 0; i < 2 * NMETHODS; i++) {
    msim_scene *scene = spring_above_sphere(i % 2 ? 0.5 : 1, i % 2 ? 0.3 : 0);
    double exact[6], y[6], w[6], error[4] = {0};
    run(scene, "dop853", 3, 60000, exact, w);
    for (int k = 0; k < 4; k++)
      for (int n = 0; n < 5; n++) { /* the place of the impact in its step varies */
        assert_int_equal(run(scene, path_methods[i / 2], 3, (160 << k) + n * (23 << k), y, w), 2);
        error[k] += distance(y + 3, exact + 3) / 5;
      }
    expect_order(path_methods[i / 2], error, 4, 1.75);
    assert_true(error[3] < 1e-3);
    msim_scene_destroy(scene);
  }
}

/* Near a sphere that they do not touch methods keep their order. */
static void order_is_kept_near_a_sphere(void **state) {
  (void)state;
  msim_scene *scene = spring_above_sphere(1, 0), *empty = spring_above_sphere(1, 0);
  msim_scene_destroy(empty);
  const double x[6] = {0, 0, 2.2, 0.6, 0.2, 1.9}, mass[2] = {1, 1}, k = 30, rest = 0.5;
  const int32_t pin = 0, ij[2] = {0, 1};
  empty = new_scene();
  assert_ok(msim_scene_add_particles(empty, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(empty, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(empty, 1, &pin, err));
  for (int i = 0; i < NMETHODS; i++) {
    double y[2][6], w[2][6];
    assert_int_equal(run(scene, path_methods[i], 0.25, 25, y[0], w[0]), 0);
    run(empty, path_methods[i], 0.25, 25, y[1], w[1]);
    assert_memory_equal(y[0], y[1], sizeof y[0]);
  }
  msim_scene_destroy(scene), msim_scene_destroy(empty);
}

static void error_control_keeps_tol_on_a_sphere(void **state) {
  (void)state;
  static const char *const methods[] = {"dop853", "rk4", "tr-bdf2", "velocity-verlet", "auto"};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene = spring_above_sphere(i ? 0.5 : 1, i ? 0.3 : 0);
    double exact[6], w[6];
    run(scene, "dop853", 3, 60000, exact, w);
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++)
      for (int digits = 3; digits <= 5; digits++) {
        msim_options opt = options(methods[m], m == 4 ? MSIM_H_AUTO : 1e-2);
        opt.tol = pow(10, -digits), opt.t_end = 3, opt.steps = -1;
        msim_sim *sim = make_sim(scene, &opt);
        assert_ok(msim_sim_run(sim, NULL, NULL, err));
        const double error = distance(state_of(sim).x + 3, exact + 3);
        if (!(error <= 3 * opt.tol)) fail_msg("%s: %g with tol %g", methods[m], error, opt.tol);
        assert_int_equal(stats_of(sim).contacts, 2);
        msim_sim_destroy(sim);
      }
    msim_scene_destroy(scene);
  }
}

static const char *const controlled_methods[] = {"dop853", "rk4", "tr-bdf2", "velocity-verlet",
                                                 "auto"};
enum { NCONTROLLED = sizeof controlled_methods / sizeof *controlled_methods };

/* The state after T with error control */
static msim_state run_controlled(const msim_scene *scene, int method, int digits, double T,
                                 msim_sim **sim) {
  const char *name = controlled_methods[method];
  msim_options opt = options(name, strcmp(name, "auto") == 0 ? MSIM_H_AUTO : 1e-2);
  opt.tol = pow(10, -digits), opt.t_end = T, opt.steps = -1;
  *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(*sim, NULL, NULL, err));
  return state_of(*sim);
}

/* The circular motion above in few steps: no force changes, so that only the turning of the surface
 * gives errors. */
static void error_control_keeps_tol_on_a_circle(void **state) {
  (void)state;
  const double R = 2, v0 = 3, T = 2, x[3] = {R, 0, 0}, v[3] = {0, v0, 0};
  for (int i = 0; i < 2; i++) {
    const double mu = i ? 0.4 : 1e-12, q = mu * v0 * T / R, slower = 1 + q, angle = log1p(q) / mu;
    msim_scene *scene = make_single_particle(x, v, 0);
    add(scene, sphere(0, 0, 0, R, 0, mu), 1);
    for (int m = 0; m < NCONTROLLED; m++)
      for (int digits = 3; digits <= 7; digits += 2) {
        msim_sim *sim;
        const msim_state s = run_controlled(scene, m, digits, T, &sim);
        const double end[3] = {R * cos(angle), R * sin(angle), 0};
        const double slow = fabs(ms_vec3_norm(s.v) - v0 / slower);
        if (!(fmax(distance(s.x, end), slow) <= 2 * pow(10, -digits)))
          fail_msg("%s: %g with tol 1e-%d", controlled_methods[m], distance(s.x, end), digits);
        msim_sim_destroy(sim);
      }
    double y[3], w[3];
    run(scene, "dop853", T, 1, y, w); /* without tol, in parts of 1/8 rad */
    assert_true(fabs(remainder(atan2(y[1], y[0]) - angle, 2 * pi)) < 0.02);
    msim_scene_destroy(scene);
  }
}

/* The angle of a pendulum of length r after T, by the leapfrog method; w: its angular velocity */
static double find_pendulum_angle(double r, double angle, double w, double T) {
  enum { STEPS = 70000 };
  const double h = T / STEPS;
  for (int i = 0; i < STEPS; i++) {
    w -= h / 2 * 9.81 / r * sin(angle);
    angle += h * w;
    w -= h / 2 * 9.81 / r * sin(angle);
  }
  return angle;
}

static void a_bead_in_a_bowl_is_a_pendulum(void **state) {
  (void)state;
  const double T = 3, v[3] = {0};
  for (double angle = 0.01; angle <= 1; angle *= 10) {
    const double x[3] = {sin(angle), 0, -cos(angle)}, last = find_pendulum_angle(1, angle, 0, T),
                 end[3] = {sin(last), 0, -cos(last)};
    msim_scene *scene = make_single_particle(x, v, 9.81);
    add(scene, sphere(0, 0, 0, 1, 0, 0), 1);
    for (int m = 0; m < NCONTROLLED; m++)
      for (int digits = 4; digits <= 6; digits++) {
        msim_sim *sim;
        const double error = distance(run_controlled(scene, m, digits, T, &sim).x, end);
        if (!(error <= 4 * pow(10, -digits)))
          fail_msg("%s: %g with tol 1e-%d", controlled_methods[m], error, digits);
        assert_true(stats_of(sim).steps < 200);
        msim_sim_destroy(sim);
      }
    msim_scene_destroy(scene);
  }
}

/* A bead slides on a floor to a plane that overhangs it, or around a bowl to a ball: it stays on
 * its path, and returns with the restitution of what it hits. */
static void a_sliding_bead_returns_from_an_overhang(void **state) {
  (void)state;
  const double v0 = 2, e = 0.7, T = 1, d = 0.8, r = 0.5, turn = 1.3;
  for (int bowl = 0; bowl < 2; bowl++) {
    const double x[3] = {bowl, 0, 0}, v[3] = {bowl ? 0 : v0, bowl ? v0 : 0, 0};
    const double until = bowl ? turn - acos((1 + d * d - r * r) / (2 * d)) : 0.9;
    const double last = until - e * (v0 * T - until);
    const double end[3] = {bowl ? cos(last) : last, bowl ? sin(last) : 0, 0};
    msim_scene *scene = make_single_particle(x, v, bowl ? 0 : 9.81);
    if (bowl) {
      add(scene, sphere(0, 0, 0, 1, 0, 0), 1);
      add(scene, sphere(d * cos(turn), d * sin(turn), 0, r, e, 0), 0);
    } else {
      plane(scene, 0, 0, 1, 0, 0, 0);
      plane(scene, -cos(0.5), 0, -sin(0.5), -until * cos(0.5), e, 0);
    }
    for (int m = 0; m < NCONTROLLED; m++)
      for (int digits = 3; digits <= 10; digits++) {
        msim_sim *sim;
        const double error = distance(run_controlled(scene, m, digits, T, &sim).x, end);
        if (!(error <= 4 * pow(10, -digits)))
          fail_msg("%s, %d: %g with tol 1e-%d", controlled_methods[m], bowl, error, digits);
        msim_sim_destroy(sim);
      }
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- solids ---------------------------------------------------*/

/* Fast particles do not pass through a thin plate or a thin bar: single ones, and pairs tied by
 * stiff springs, for which h omega = 20. */
static void thin_solids_stop_particles(void **state) {
  (void)state;
  const double x[6] = {0, 0.02, 0.4, 0, -0.02, 0.4}, v[6] = {0, 0, -90, 0, 0, -90},
               mass[2] = {1, 1}, k = 2e6, center[3] = {0}, along[3] = {0, 1, 0};
  const int32_t ij[2] = {0, 1};
  for (int32_t m = 0; event_method_at(m); m++)
    for (int i = 0; i < 4; i++) {
      const int tied = i % 2;
      if (tied && !is_implicit(event_method_at(m))) continue;
      msim_scene *scene = new_scene();
      assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
      if (tied) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
      msim_collider c = round_bar(MSIM_COLLIDER_CAPSULE, center, along, 0.01, 0.5, 0);
      if (i / 2) c = box(0, 0, 0, 1, 0.5, 0), c.extent[2] = 1e-3;
      add(scene, c, 0);
      const msim_options opt = event_options(event_method_at(m), 0.01);
      msim_sim *sim = make_sim(scene, &opt);
      for (int step = 0; step < 3; step++) {
        assert_ok(msim_sim_step(sim, 1, err));
        const double *y = state_of(sim).x;
        if (!(y[2] > 0 && y[5] > 0))
          fail_msg("%s, %d, step %d: %g %g", event_method_at(m), i, step, y[2], y[5]);
      }
      assert_true(stats_of(sim).contacts > 0);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* Two particles tied by a stiff spring slide in a sphere, perpendicular to the spring: a pendulum
 * of length sqrt(R^2 - a^2), slow, or fast enough for a loop. Implicit Euler, h omega = 140 and
 * less: of order 1 */
static void a_stiff_pair_slides_in_a_sphere(void **state) {
  (void)state;
  const double R = 1, a = 0.3, r = sqrt(R * R - a * a), T = 0.7, k = 1e8, mass[2] = {1, 1};
  const int32_t ij[2] = {0, 1};
  static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler", "bdf2"};
  for (int m = 0; m < 6; m++) {
    const double start = m % 2 ? 0 : 0.2, w = m % 2 ? 9 : 0, y0 = r * sin(start),
                 z0 = -r * cos(start), angle = find_pendulum_angle(r, start, w, T);
    const double x[6] = {-a, y0, z0, a, y0, z0}, v[6] = {0, r * w, 0, 0, r * w, 0};
    msim_scene *scene = new_scene();
    assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
    add(scene, sphere(0, 0, 0, R, 0, 0), 1);
    double error[3], y[6], u[6];
    for (int i = 0; i < 3; i++) {
      run(scene, methods[m / 2], T, 140 << i, y, u);
      error[i] = fabs(remainder(atan2(y[1], -y[2]) - angle, 2 * pi));
      assert_close(ms_vec3_norm(y), R, 1e-14);
      assert_close(y[1], y[4], 1e-9);
    }
    if (!(error[2] < (m % 2 ? 0.12 : 0.005)))
      fail_msg("%s: %g %g %g", methods[m / 2], error[0], error[1], error[2]);
    if (m % 2) expect_order(methods[m / 2], error, 3, 0.8);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(friction_of_a_circular_motion),
                                     cmocka_unit_test(a_particle_leaves_a_sphere),
                                     cmocka_unit_test(loops_inside_a_sphere),
                                     cmocka_unit_test(a_particle_slides_off_an_edge),
                                     cmocka_unit_test(rooms_are_planes),
                                     cmocka_unit_test(one_step_or_many),
                                     cmocka_unit_test(order_is_kept_through_impacts_on_a_sphere),
                                     cmocka_unit_test(order_is_kept_near_a_sphere),
                                     cmocka_unit_test(error_control_keeps_tol_on_a_sphere),
                                     cmocka_unit_test(error_control_keeps_tol_on_a_circle),
                                     cmocka_unit_test(a_bead_in_a_bowl_is_a_pendulum),
                                     cmocka_unit_test(a_sliding_bead_returns_from_an_overhang),
                                     cmocka_unit_test(thin_solids_stop_particles),
                                     cmocka_unit_test(a_stiff_pair_slides_in_a_sphere)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
