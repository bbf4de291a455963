/* Tests of impacts located inside the step, collision = event: closed forms, rest, corners, and
 * reproducibility. */
#include "event_options.h"

static const char *const exact[] = {"heun", "velocity-verlet", "rk4", "rkn6"};
enum { NEXACT = sizeof exact / sizeof *exact };

/*------------------------------------- one ball -------------------------------------------------*/

/* Height and speed at time t of a ball dropped from 1 m; *bounces so far. */
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

/* 10 bounces in closed form, at any position in their steps; then exact rest, in which steps are
 * skipped. Ten stages of ssprk102 in each of 348 steps round v more often. */
static void ball_bounces_in_closed_form_and_rests(void **state) {
  (void)state;
  const double x[3] = {0.3, 0, 1}, v[3] = {0.5, 0, 0}, g = 9.81, h = 0.0103;
  for (int32_t m = 0; event_method_at(m); m++) {
    if (strstr(event_method_at(m), "euler")) continue; /* of order 1 */
    msim_scene *scene = make_single_particle(x, v, g);
    plane(scene, 0, 0, 1, 0, 0.8, 0);
    msim_options opt = event_options(event_method_at(m), h);
    msim_sim *sim = make_sim(scene, &opt);
    const double rounding = strcmp(opt.integrator, "ssprk102") == 0 ? 2e-13 : 1e-13;
    double z, vz;
    int bounces;
    for (int i = 1; i <= 348; i++) {
      assert_ok(msim_sim_step(sim, 1, err));
      const msim_state s = state_of(sim);
      drop(0.8, g, s.t, &z, &vz, &bounces);
      assert_close(s.x[2], z, 1e-13);
      assert_close(s.v[2], vz, rounding);
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

/* e = 1 conserves the energy; collision = reflect doubles it in 200 s */
static void elastic_ball_keeps_its_energy(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0, 0, 0}, g = 9.81;
  for (int m = 0; m < NEXACT; m++) {
    msim_scene *scene = make_single_particle(x, v, g);
    plane(scene, 0, 0, 1, 0, 1, 0);
    msim_options opt = event_options(exact[m], 0.01);
    msim_sim *sim = make_sim(scene, &opt);
    msim_energy energy = {.size = sizeof energy};
    assert_ok(msim_sim_step(sim, 2000, err));
    msim_sim_energy(sim, &energy);
    assert_close(energy.total, g, 1e-11);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* An oblique bounce with friction on an inclined plane, then free flight */
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
    msim_scene *scene = make_single_particle(x, v, g);
    plane(scene, n[0], n[1], n[2], 0, e, mu);
    msim_options opt = event_options(exact[m], 0.08);
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

/* The slider stops after v^2/(2 mu g), exactly; then the bits never change */
static void slider_stops_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0.1, 0.2, 0}, v[3] = {1.2, 1.6, 0}, mu = 0.3, g = 10;
  const double t_stop = 2 / (mu * g);
  for (int32_t m = 0; event_method_at(m); m++) {
    const char *name = event_method_at(m);
    const int first_order = strstr(name, "euler") != NULL;
    msim_scene *scene = make_single_particle(x, v, g);
    plane(scene, 0, 0, 1, 0, 0.5, mu);
    msim_options opt = event_options(name, 0.013);
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

/* mu > tan a: nothing moves, exactly. mu < tan a: acceleration g (sin a - mu cos a). */
static void incline_sticks_or_slides(void **state) {
  (void)state;
  const double a = 0.3, g = 10, x[3] = {0, 0, 0}, v[3] = {0, 0, 0};
  for (int32_t m = 0; event_method_at(m); m++)
    for (int slides = 0; slides < 2; slides++) {
      const char *name = event_method_at(m);
      msim_scene *scene = make_single_particle(x, v, g);
      const double mu = slides ? 0.1 : 0.5;
      plane(scene, sin(a), 0, cos(a), 0, 0.3, mu);
      msim_options opt = event_options(name, 0.01);
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

/* Without gravity a particle does not come to rest: it slides along a plane, and flies away from
 * it */
static void nothing_rests_without_gravity(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0}, v[3] = {1, 0, 0}, up[3] = {1, 0, 1e-6};
  for (int m = 0; m < NEXACT; m++)
    for (int flies = 0; flies < 2; flies++) {
      msim_scene *scene = make_single_particle(x, flies ? up : v, 0);
      plane(scene, 0, 0, 1, 0, 0.5, 0.5);
      msim_options opt = event_options(exact[m], 0.01);
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

/* A particle in a box, in closed form: several impacts per step, some of them in corners */
static void box_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0.5, 0.5, 0.5}, v[3] = {7, 12, 7}, h = 0.1;
  for (int m = 0; m < NEXACT; m++) {
    msim_scene *scene = make_single_particle(x, v, 0);
    for (int c = 0; c < 3; c++) {
      plane(scene, c == 0, c == 1, c == 2, 0, 1, 0);
      plane(scene, -(c == 0), -(c == 1), -(c == 2), -1, 1, 0);
    }
    msim_options opt = event_options(exact[m], h);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 13, err));
    const msim_state s = state_of(sim);
    for (int c = 0; c < 3; c++) {
      const double distance = fmod(x[c] + v[c] * 1.3, 2); /* sawtooth */
      assert_close(s.x[c], distance < 1 ? distance : 2 - distance, 1e-13);
      assert_close(s.v[c], distance < 1 ? v[c] : -v[c], 1e-13);
    }
    /* x and z hit their walls together, which is one impact */
    assert_int_equal(stats_of(sim).contacts, 9 + 16);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A particle that enters and leaves a plane within a step, outside at both ends, and a near miss */
static void entry_and_exit_in_a_step_are_found(void **state) {
  (void)state;
  const double depth[] = {0.01, 1e-6, -1e-6}, g = -8, h = 1;
  for (int k = 0; k < 3; k++)
    for (int m = 0; m < NEXACT; m++) {
      /* z = -depth + 4 (t - 1/2)^2 without the plane */
      const double x[3] = {0, 0, 1 - depth[k]}, v[3] = {0, 0, -4};
      msim_scene *scene = make_single_particle(x, v, g);
      plane(scene, 0, 0, 1, 0, 1, 0);
      msim_options opt = event_options(exact[m], h);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 1, err));
      assert_int_equal(stats_of(sim).contacts, depth[k] > 0);
      const double u = depth[k] > 0 ? 4 * sqrt(depth[k]) : 0, t = 0.5 + u / 8;
      /* the speed at the impact, upwards from then on: t0 = 1/2 - u/8 */
      const double z = depth[k] > 0 ? u * t + 4 * t * t : x[2];
      assert_close(state_of(sim).x[2], z, 1e-12);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* Pressed into corners of two and three planes, in any order of planes: the same state of exact
 * rest */
static void corners_hold_in_any_order(void **state) {
  (void)state;
  const double n[3][3] = {{1, 0, 0.5}, {-0.5, 0.9, 0.5}, {-0.5, -0.9, 0.6}};
  static const int order[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  const double x[3] = {0.02, 0.05, 1.1}, v[3] = {0.1, 0.2, -0.3};
  for (int32_t m = 0; event_method_at(m); m++) {
    double first[3] = {0};
    for (int o = 0; o < 6; o++) {
      msim_scene *scene = make_single_particle(x, v, 9.81);
      for (int p = 0; p < 3; p++) {
        const double *k = n[order[o][p]];
        plane(scene, k[0], k[1], k[2], 0, 0.1, 0.1);
      }
      msim_options opt = event_options(event_method_at(m), 0.01);
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

/*------------------------------------- simultaneous impacts -------------------------------------*/

enum { MANY = 12 };

/* Balls at nearly equal heights: each bounces at its own time, without additional force
 * evaluations */
static void many_balls_in_closed_form(void **state) {
  (void)state;
  const double g[3] = {0, 0, -9.81};
  double x[3 * MANY] = {0}, mass[MANY];
  for (int i = 0; i < MANY; i++) x[3 * i] = i, x[3 * i + 2] = 1 - 1e-3 * i, mass[i] = 1;
  for (int m = 0; m < NEXACT; m++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, MANY, x, NULL, mass, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    plane(scene, 0, 0, 1, 0, 0.8, 0);
    msim_options opt = event_options(exact[m], 0.01);
    msim_sim *sim = make_sim(scene, &opt);
    for (int i = 0; i < 100; i++) {
      const msim_stats before = stats_of(sim);
      assert_ok(msim_sim_step(sim, 1, err));
      const msim_stats after = stats_of(sim);
      if (strcmp(exact[m], "velocity-verlet") == 0 && after.contacts - before.contacts > 4)
        assert_in_range(after.force_evaluations - before.force_evaluations, 1, 2);
    }
    const msim_state s = state_of(sim);
    int sum = 0;
    for (int i = 0; i < MANY; i++) {
      double z, vz;
      int bounces;
      const double scale = x[3 * i + 2]; /* lengths scale with it, times with its square root */
      drop(0.8, 9.81, s.t / sqrt(scale), &z, &vz, &bounces);
      assert_close(s.x[3 * i + 2], z * scale, 1e-13);
      assert_close(s.v[3 * i + 2], vz * sqrt(scale), 1e-12);
      sum += bounces;
    }
    assert_int_equal(stats_of(sim).contacts, sum);
    assert_ok(msim_sim_step(sim, 500, err));
    for (int i = 0; i < MANY; i++) assert_true(state_of(sim).x[3 * i + 2] == 0);
    assert_true(stats_of(sim).steps_at_rest > 50);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A stiff spring oscillates on a mass that lies on the floor and is never lifted: Newton's method
 * has to take the contact into account. */
static void implicit_steps_find_resting_contacts(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 0, 0, 1 - 1.05e-3}, mass[2] = {1, 1}, k = 1e4, rest = 1, none = 0;
  const double g[3] = {0, 0, -10};
  const int32_t ij[2] = {0, 1};
  static const char *const methods[] = {"implicit-euler", "tr-bdf2", "sdirk2"};
  for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &none, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    plane(scene, 0, 0, 1, 0, 0.5, 0.3);
    msim_options opt = event_options(methods[m], 0.01);
    opt.solver = "pcg", opt.newton_rtol = 1e-8;
    msim_sim *sim = make_sim(scene, &opt);
    for (int i = 0; i < 30; i++) {
      assert_ok(msim_sim_step(sim, 1, err));
      assert_true(state_of(sim).x[2] == 0 && state_of(sim).v[2] == 0);
      assert_close(state_of(sim).x[5], 1 - 1e-3, 5e-4);
    }
    assert_int_equal(stats_of(sim).contacts, 0);
    assert_in_range(stats_of(sim).newton_iterations, 0, 190);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- reproducibility ------------------------------------------*/

/* Blocks of side^3 particles above a rough slope, far from each other */
static msim_scene *blocks(int32_t side, int from, int to) {
  const double g[3] = {0, 0, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = from; i < to; i++) {
    const msim_lattice lattice = {.size = sizeof lattice,
                                  .n = {side, side, side},
                                  .origin = {2 * i, 0.005 * i, 0.001 + 0.001 * i},
                                  .extent = {0.2, 0.2, 0.2},
                                  .mass = 1,
                                  .k = 30};
    assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  }
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0.05, 0, 1, 0, 0.3, 0.5);
  plane(scene, 0, 1, 0, -0.01, 0.3, 0.5);
  return scene;
}

static int lies_inside(const msim_state *s, double nx, double nz) {
  for (int32_t p = 0; p < s->n; p++)
    if (nx * s->x[3 * p] + nz * s->x[3 * p + 2] < -1e-12) return 0;
  return 1;
}

/* From a state set in mid-run, in several calls, with steps at rest skipped or not: the same
 * bits */
static void only_the_state_determines_the_next_step(void **state) {
  (void)state;
  enum { N3 = 3 * 4 * 4 * 4 };
  for (int32_t m = 0; event_method_at(m); m++) {
    const char *name = event_method_at(m);
    if (is_implicit(name) || strcmp(name, "explicit-euler") == 0) continue;
    msim_scene *scene = blocks(4, 0, 1);
    msim_options opt = event_options(name, 1e-3);
    msim_sim *whole = make_sim(scene, &opt);
    assert_ok(msim_options_set(&opt, "skip.at_rest", "off", err));
    msim_sim *pieces = make_sim(scene, &opt);
    assert_ok(msim_sim_step(whole, 120, err));
    for (int i = 0; i < 12; i++) {
      double x[N3], v[N3];
      assert_ok(msim_sim_step(pieces, 10, err));
      msim_state s = state_of(pieces);
      memcpy(x, s.x, sizeof x);
      memcpy(v, s.v, sizeof v);
      s.x = x, s.v = v;
      assert_ok(msim_sim_set_state(pieces, &s, err));
    }
    const msim_state a = state_of(whole), b = state_of(pieces);
    assert_true(stats_of(whole).contacts > 16);
    assert_true(lies_inside(&a, 0.05, 1));
    assert_memory_equal(a.x, b.x, N3 * sizeof *a.x);
    assert_memory_equal(a.v, b.v, N3 * sizeof *a.v);
    msim_sim_destroy(whole), msim_sim_destroy(pieces);
    msim_scene_destroy(scene);
  }
}

/* Blocks that no spring connects: each moves as it does alone, with any number of threads */
static void islands_and_threads_change_no_bit(void **state) {
  (void)state;
  enum { SIDE = 8, N = SIDE * SIDE * SIDE, STEPS = 32 };
  static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler"};
  for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
    msim_scene *scene = blocks(SIDE, 0, 2);
    msim_options opt = event_options(methods[m], 1e-3);
    opt.solver = "pcg", opt.threads = 1;
    msim_sim *one = make_sim(scene, &opt);
    opt.threads = 3;
    msim_sim *three = make_sim(scene, &opt);
    assert_ok(msim_sim_step(one, STEPS, err));
    assert_ok(msim_sim_step(three, STEPS, err));
    const msim_state a = state_of(one), b = state_of(three);
    assert_true(stats_of(one).contacts > SIDE);
    assert_int_equal(stats_of(one).contacts, stats_of(three).contacts);
    assert_memory_equal(a.x, b.x, 6 * N * sizeof *a.x);
    assert_memory_equal(a.v, b.v, 6 * N * sizeof *a.v);
    msim_scene_destroy(scene);
    scene = blocks(SIDE, 0, 1);
    msim_sim *alone = make_sim(scene, &opt);
    assert_ok(msim_sim_step(alone, STEPS, err));
    assert_memory_equal(a.x, state_of(alone).x, 3 * N * sizeof *a.x);
    msim_sim_destroy(one), msim_sim_destroy(three), msim_sim_destroy(alone);
    msim_scene_destroy(scene);
  }
}

/* A planar scene gives the same results in two components as in three */
static void planar_scenes_give_the_same_results(void **state) {
  (void)state;
  const double x[6] = {0, 0, 1, 0.3, 0, 1.2}, v[6] = {0.5, 0, 0, -0.2, 0, 0}, mass[2] = {1, 2};
  const double k = 50, g[3] = {0, 0, -9.81};
  const int32_t ij[2] = {0, 1};
  for (int32_t m = 0; event_method_at(m); m++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    plane(scene, 0.2, 0, 1, 0, 0.6, 0.2);
    plane(scene, -1, 0, 1, -1, 0.6, 0.2);
    msim_options opt = event_options(event_method_at(m), 0.01);
    opt.solver = "pcg";
    msim_sim *flat = make_sim(scene, &opt);
    assert_ok(msim_options_set(&opt, "skip.two_d", "off", err));
    msim_sim *full = make_sim(scene, &opt);
    assert_ok(msim_sim_step(flat, 80, err));
    assert_ok(msim_sim_step(full, 80, err));
    assert_true(stats_of(flat).contacts > 1);
    for (int c = 0; c < 6; c++) assert_close(state_of(flat).x[c], state_of(full).x[c], 1e-8);
    msim_sim_destroy(flat), msim_sim_destroy(full);
    msim_scene_destroy(scene);
  }
}

/* A particle that starts behind a plane is moved onto it, and reflected if it moves inwards */
static void outside_is_put_on_the_plane(void **state) {
  (void)state;
  const double x[3] = {0, 0, -0.5}, v[3] = {1, 0, -2};
  for (int32_t m = 0; event_method_at(m); m++) {
    msim_scene *scene = make_single_particle(x, v, 0);
    plane(scene, 0, 0, 1, 0, 0.5, 0);
    msim_options opt = event_options(event_method_at(m), 0.01);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 10, err));
    assert_close(state_of(sim).x[2], 0.1, 1e-14);
    assert_close(state_of(sim).v[2], 1, 1e-14);
    assert_int_equal(stats_of(sim).contacts, 1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(ball_bounces_in_closed_form_and_rests),
                                     cmocka_unit_test(elastic_ball_keeps_its_energy),
                                     cmocka_unit_test(oblique_bounce_in_closed_form),
                                     cmocka_unit_test(slider_stops_in_closed_form),
                                     cmocka_unit_test(incline_sticks_or_slides),
                                     cmocka_unit_test(nothing_rests_without_gravity),
                                     cmocka_unit_test(box_in_closed_form),
                                     cmocka_unit_test(entry_and_exit_in_a_step_are_found),
                                     cmocka_unit_test(corners_hold_in_any_order),
                                     cmocka_unit_test(many_balls_in_closed_form),
                                     cmocka_unit_test(implicit_steps_find_resting_contacts),
                                     cmocka_unit_test(only_the_state_determines_the_next_step),
                                     cmocka_unit_test(islands_and_threads_change_no_bit),
                                     cmocka_unit_test(planar_scenes_give_the_same_results),
                                     cmocka_unit_test(outside_is_put_on_the_plane)};
  return cmocka_run_group_tests_name("events", tests, NULL, NULL);
}
