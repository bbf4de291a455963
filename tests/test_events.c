/* Impacts located inside the step, collision = event: closed forms, orders, rest, many at once. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenes.h"

static msim_options event(const char *method, double h) {
  msim_options opt = options(method, h);
  opt.collision = MSIM_COLLISION_EVENT;
  opt.solver_rtol = 1e-13;
  opt.newton_rtol = 1e-12;
  return opt;
}

static const char *const exact[] = {"heun", "velocity-verlet", "rk4", "rkn6"};
enum { NEXACT = sizeof exact / sizeof *exact };

/* Methods that take collision = event; NULL past the end. */
static const char *event_method_at(int32_t i) {
  const char *name = NULL;
  for (int32_t m = 0; (name = method_at(m)) != NULL; m++)
    if (strcmp(name, "verlet") != 0 && i-- == 0) break;
  return name;
}

/*------------------------------------- one ball -------------------------------------------------*/

/* Height and speed of a ball dropped from 1 m at time t; *bounces so far. */
static void drop(double e, double g, double t, double *z, double *vz, int *bounces) {
  double up = sqrt(2 * g), start = up / g;
  *bounces = 0;
  *z = 1 - g * t * t / 2, *vz = -g * t;
  if (t < start) return;
  for (;;) {
    up *= e;
    ++*bounces;
    if (start + 2 * up / g > t) break;
    start += 2 * up / g;
  }
  *z = up * (t - start) - g * (t - start) * (t - start) / 2;
  *vz = up - g * (t - start);
}

/* 10 bounces in closed form, wherever in their steps they fall; then rest, exact and not stepped */
static void ball_bounces_in_closed_form_and_rests(void **state) {
  (void)state;
  const double x[3] = {0.3, 0, 1}, v[3] = {0.5, 0, 0}, g = 9.81, h = 0.0103;
  for (int m = 0; m < NEXACT; m++) {
    msim_scene *scene = single(x, v, g);
    plane(scene, 0, 0, 1, 0, 0.8, 0);
    msim_options opt = event(exact[m], h);
    msim_sim *sim = make_sim(scene, &opt);
    double z, vz;
    int bounces;
    for (int i = 1; i <= 348; i++) {
      assert_ok(msim_sim_step(sim, 1, err));
      const msim_state s = state_of(sim);
      drop(0.8, g, s.t, &z, &vz, &bounces);
      assert_close(s.x[2], z, 1e-13);
      assert_close(s.v[2], vz, 5e-13);
      assert_close(s.x[0], 0.3 + 0.5 * s.t, 1e-13);
    }
    assert_int_equal(bounces, 10);
    assert_int_equal(stats_of(sim).contacts, bounces);
    assert_ok(msim_sim_step(sim, 400, err));
    const msim_state s = state_of(sim);
    assert_true(s.x[2] == 0 && s.v[2] == 0 && s.v[0] == 0.5);
    const int64_t contacts = stats_of(sim).contacts;
    assert_ok(msim_sim_step(sim, 100, err));
    assert_int_equal(stats_of(sim).contacts, contacts);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* e = 1 keeps the energy: `reflect` doubles it in 200 s */
static void elastic_ball_keeps_its_energy(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0, 0, 0}, g = 9.81;
  for (int m = 0; m < NEXACT; m++) {
    msim_scene *scene = single(x, v, g);
    plane(scene, 0, 0, 1, 0, 1, 0);
    msim_options opt = event(exact[m], 0.01);
    msim_sim *sim = make_sim(scene, &opt);
    msim_energy energy = {.size = sizeof energy};
    assert_ok(msim_sim_step(sim, 2000, err));
    msim_sim_energy(sim, &energy);
    assert_close(energy.total, g, 1e-11);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* An oblique bounce with friction on a plane of no simple normal, then free flight */
static void oblique_bounce_in_closed_form(void **state) {
  (void)state;
  const double n[3] = {0.6, 0, 0.8}, along[3] = {0.8, 0, -0.6}, e = 0.7, mu = 0.2, g = 2;
  /* from 1 above the plane, 2 m/s towards it, 3 m/s along it: g is -1.6 across and 1.2 along */
  const double x[3] = {n[0], 0, n[2]};
  const double v[3] = {-2 * n[0] + 3 * along[0], 0, -2 * n[2] + 3 * along[2]};
  const double t1 = (-2 + sqrt(4 + 2 * 1.6)) / 1.6, vn = -2 - 1.6 * t1, vt = 3 + 1.2 * t1;
  const double J = -(1 + e) * vn, t = 0.8 - t1;
  const double un = -e * vn, ut = vt * (1 - mu * J / vt);
  const double xn = un * t - 0.8 * t * t, xt = 3 * t1 + 0.6 * t1 * t1 + ut * t + 0.6 * t * t;
  for (int m = 0; m < NEXACT; m++) {
    msim_scene *scene = single(x, v, g);
    plane(scene, n[0], n[1], n[2], 0, e, mu);
    msim_options opt = event(exact[m], 0.08);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 10, err));
    const msim_state s = state_of(sim);
    for (int c = 0; c < 3; c++) {
      assert_close(s.x[c], xn * n[c] + xt * along[c], 1e-14);
      assert_close(s.v[c], (un - 1.6 * t) * n[c] + (ut + 1.2 * t) * along[c], 1e-14);
    }
    assert_int_equal(stats_of(sim).contacts, 1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* v^2/(2 mu g), to the end and no further; then the same bits for ever */
static void slider_stops_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0.1, 0.2, 0}, v[3] = {1.2, 1.6, 0}, mu = 0.3, g = 10;
  const double t_stop = 2 / (mu * g);
  for (int32_t m = 0; event_method_at(m); m++) {
    const char *name = event_method_at(m);
    const int first_order = strstr(name, "euler") != NULL;
    msim_scene *scene = single(x, v, g);
    plane(scene, 0, 0, 1, 0, 0.5, mu);
    msim_options opt = event(name, 0.013);
    msim_sim *sim = make_sim(scene, &opt);
    for (int i = 0; i < 80; i++) {
      assert_ok(msim_sim_step(sim, 1, err));
      const msim_state s = state_of(sim);
      const double t = fmin(s.t, t_stop), far = 2 * t - mu * g * t * t / 2, fast = 2 - mu * g * t;
      const double tol = first_order ? 0.02 : strcmp(name, "bdf2") ? 1e-12 : 1e-3;
      assert_close(s.x[0], 0.1 + 0.6 * far, tol);
      assert_close(s.x[1], 0.2 + 0.8 * far, tol);
      assert_close(s.v[0], 0.6 * fast, first_order ? 1e-10 : tol);
      assert_true(s.x[2] == 0 && s.v[2] == 0);
    }
    assert_true(state_of(sim).v[0] == 0 && state_of(sim).v[1] == 0);
    assert_int_equal(stats_of(sim).contacts, 0);
    assert_true(stats_of(sim).steps_at_rest > 20);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* mu > tan a: nothing moves, exactly. mu < tan a: g (sin a - mu cos a). */
static void incline_sticks_or_slides(void **state) {
  (void)state;
  const double a = 0.3, g = 10, x[3] = {0, 0, 0}, v[3] = {0, 0, 0};
  for (int32_t m = 0; event_method_at(m); m++)
    for (int slides = 0; slides < 2; slides++) {
      const char *name = event_method_at(m);
      msim_scene *scene = single(x, v, g);
      const double mu = slides ? 0.1 : 0.5;
      plane(scene, sin(a), 0, cos(a), 0, 0.3, mu);
      msim_options opt = event(name, 0.01);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 100, err));
      const msim_state s = state_of(sim);
      const double along = s.x[0] * cos(a) - s.x[2] * sin(a), far = g * (sin(a) - mu * cos(a)) / 2;
      const int rough = strstr(name, "euler") != NULL || strcmp(name, "bdf2") == 0;
      if (slides) assert_close(along, far, rough ? 0.02 * far : 1e-12);
      else assert_memory_equal(s.x, x, sizeof x);
      if (!slides) assert_true(stats_of(sim).steps_at_rest > 90);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* Without gravity nothing rests: it slides along a plane, and flies between two */
static void nothing_rests_without_gravity(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0}, v[3] = {1, 0, 0}, up[3] = {1, 0, 1e-6};
  for (int m = 0; m < NEXACT; m++)
    for (int flies = 0; flies < 2; flies++) {
      msim_scene *scene = single(x, flies ? up : v, 0);
      plane(scene, 0, 0, 1, 0, 0.5, 0.5);
      msim_options opt = event(exact[m], 0.01);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 100, err));
      assert_close(state_of(sim).x[0], 1, 1e-14);
      assert_close(state_of(sim).x[2], flies ? 1e-6 : 0, 1e-18);
      assert_int_equal(stats_of(sim).contacts, 0);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/*------------------------------------- many planes ----------------------------------------------*/

/* A particle in a box: there and back in closed form, several impacts a step and in corners */
static void box_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0.5, 0.5, 0.5}, v[3] = {7, 12, 7}, h = 0.1;
  for (int m = 0; m < NEXACT; m++) {
    msim_scene *scene = single(x, v, 0);
    for (int c = 0; c < 3; c++) {
      plane(scene, c == 0, c == 1, c == 2, 0, 1, 0);
      plane(scene, -(c == 0), -(c == 1), -(c == 2), -1, 1, 0);
    }
    msim_options opt = event(exact[m], h);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 13, err));
    const msim_state s = state_of(sim);
    for (int c = 0; c < 3; c++) {
      const double way = fmod(x[c] + v[c] * 1.3, 2); /* a saw's tooth */
      assert_close(s.x[c], way < 1 ? way : 2 - way, 1e-13);
      assert_close(s.v[c], way < 1 ? v[c] : -v[c], 1e-13);
    }
    /* x and z meet their walls together: that is one impact */
    assert_int_equal(stats_of(sim).contacts, 9 + 16);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* In and out within a step, seen at neither end, and a miss by a hair */
static void in_and_out_is_not_missed(void **state) {
  (void)state;
  const double depth[] = {0.01, 1e-6, -1e-6}, g = -8, h = 1;
  for (int k = 0; k < 3; k++)
    for (int m = 0; m < NEXACT; m++) {
      /* z = -depth + 4 (t - 1/2)^2, were there no plane */
      const double x[3] = {0, 0, 1 - depth[k]}, v[3] = {0, 0, -4};
      msim_scene *scene = single(x, v, g);
      plane(scene, 0, 0, 1, 0, 1, 0);
      msim_options opt = event(exact[m], h);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 1, err));
      assert_int_equal(stats_of(sim).contacts, depth[k] > 0);
      const double u = depth[k] > 0 ? 4 * sqrt(depth[k]) : 0, t = 0.5 + u / 8;
      /* the speed at the impact, up instead of down from there on: t0 = 1/2 - u/8 */
      const double z = depth[k] > 0 ? u * t + 4 * t * t : x[2];
      assert_close(state_of(sim).x[2], z, 1e-12);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* Pressed into corners of two and three planes, in any order of them: the same, at exact rest */
static void corners_hold_in_any_order(void **state) {
  (void)state;
  const double n[3][3] = {{1, 0, 0.5}, {-0.5, 0.9, 0.5}, {-0.5, -0.9, 0.6}};
  static const int order[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  const double x[3] = {0.02, 0.05, 1.1}, v[3] = {0.1, 0.2, -0.3};
  for (int32_t m = 0; event_method_at(m); m++) {
    double first[3] = {0};
    for (int o = 0; o < 6; o++) {
      msim_scene *scene = single(x, v, 9.81);
      for (int p = 0; p < 3; p++) {
        const double *k = n[order[o][p]];
        plane(scene, k[0], k[1], k[2], 0, 0.1, 0.1);
      }
      msim_options opt = event(event_method_at(m), 0.01);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 100, err));
      const double half = state_of(sim).x[2];
      if (o == 0) first[0] = half;
      assert_close(half, first[0], 1e-9);
      assert_ok(msim_sim_step(sim, 400, err));
      const msim_state s = state_of(sim);
      for (int c = 0; c < 3; c++) {
        assert_close(s.x[c], 0, 1e-12);
        assert_true(s.v[c] == 0);
      }
      assert_true(stats_of(sim).steps_at_rest > 50);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
  }
}

/*------------------------------------- orders ---------------------------------------------------*/

/* A particle on a spring of rest length 0 to a pin on the far side of a plane, which it hits again
 * and again while it swings along it: x = A cos(w t + p) between impacts. */
static void oscillator(double t, double z0, double e, double *z, double *vz, int *hits) {
  /* the plane is at z = 0, the pin at z = -1; w = 1: z = -1 + a cos(t - phase), z0 at rest first */
  double a = z0 + 1, at = 0, phase = 0;
  *hits = 0;
  for (;;) {
    const double hit = phase + acos(1 / a);
    if (hit > t) break;
    const double up = e * sqrt(a * a - 1);
    at = hit, a = sqrt(1 + up * up);
    phase = at + atan2(up, 1);
    ++*hits;
  }
  *z = -1 + a * cos(t - phase);
  *vz = -a * sin(t - phase);
}

static msim_scene *spring_on_plane(double e) {
  const double x[6] = {0, 0, -1, 0.2, 0, 1.5}, v[6] = {0, 0, 0, 0.3, 0, 0}, mass[2] = {1, 1}, k = 1;
  const double rest = 0, none = 0;
  const int32_t ij[2] = {0, 1}, pin = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &none, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  plane(scene, 0, 0, 1, 0, e, 0);
  return scene;
}

static double error_through_impacts(const msim_scene *scene, const char *method, int steps) {
  const double T = 8;
  double z, vz;
  int hits;
  msim_options opt = event(method, T / steps);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  oscillator(T, 1.5, 0.9, &z, &vz, &hits);
  assert_int_equal(hits, 4);
  assert_int_equal(stats_of(sim).contacts, hits);
  const msim_state s = state_of(sim);
  const double off = hypot(s.x[5] - z, s.v[5] - vz);
  msim_sim_destroy(sim);
  return off;
}

static void order_is_kept_through_impacts(void **state) {
  (void)state;
  msim_scene *scene = spring_on_plane(0.9);
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++) {
    if (!entry->order || strcmp(entry->name, "verlet") == 0) continue;
    const int steps = entry->order > 4 ? 10 : entry->order > 2 ? 240 : 300;
    const double coarse = error_through_impacts(scene, entry->name, steps);
    const double fine = error_through_impacts(scene, entry->name, 4 * steps);
    const double order = log2(coarse / fine) / 2;
    print_message("  %-24s %.3g %.3g  order %.2f\n", entry->name, coarse, fine, order);
    /* where steps are long, those that an impact cuts short are many */
    assert_true(order >= (entry->order > 6 ? 6.5 : entry->order > 4 ? 5.5 : entry->order - 0.1));
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(ball_bounces_in_closed_form_and_rests),
                                     cmocka_unit_test(elastic_ball_keeps_its_energy),
                                     cmocka_unit_test(oblique_bounce_in_closed_form),
                                     cmocka_unit_test(slider_stops_in_closed_form),
                                     cmocka_unit_test(incline_sticks_or_slides),
                                     cmocka_unit_test(nothing_rests_without_gravity),
                                     cmocka_unit_test(box_in_closed_form),
                                     cmocka_unit_test(in_and_out_is_not_missed),
                                     cmocka_unit_test(corners_hold_in_any_order),
                                     cmocka_unit_test(order_is_kept_through_impacts)};
  return cmocka_run_group_tests_name("events", tests, NULL, NULL);
}
