/* Tests of contact and friction with collision = event, against closed forms and reference
 * solutions: energy in simultaneous impacts, onset of slip, curved sliding, bounces that die out,
 * rounding, cost. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "event_options.h"

static double run(const msim_scene *scene, const char *method, double T, int64_t steps,
                  msim_state *state, msim_sim **sim) {
  msim_options opt = event_options(method, T / (double)steps);
  *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(*sim, steps, err));
  *state = state_of(*sim);
  return (double)stats_of(*sim).force_evaluations;
}

/*------------------------------------- landing --------------------------------------------------*/

enum { LAYERS = 4 };

/* An elastic block of side x side x 4 particles above the floor */
static msim_scene *falling_block(int32_t side, double *energy) {
  const double width = 0.1 * (side - 1), g[3] = {0, 0, -9.81},
               mass = 0.015625 * side * side * LAYERS;
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {side, side, LAYERS},
                                .origin = {0, 0, 0.3},
                                .extent = {width, width, 0.3},
                                .mass = mass,
                                .k = 500};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 1, 0);
  *energy = mass * 9.81 * 0.45;
  return scene;
}

/* For any number of particles that land at once, over many bounces. */
static void elastic_faces_keep_their_energy(void **state) {
  (void)state;
  static const struct {
    const char *method;
    int side;
    int64_t steps;
    double most;
  } row[] = {{"velocity-verlet", 2, 4000, 2e-3},  {"velocity-verlet", 3, 4000, 2e-3},
             {"velocity-verlet", 4, 4000, 2e-3},  {"velocity-verlet", 10, 4000, 2e-3},
             {"velocity-verlet", 32, 4000, 2e-3}, {"dop853", 2, 1000, 1e-6},
             {"dop853", 3, 1000, 1e-6},           {"dop853", 4, 1000, 1e-6},
             {"dop853", 10, 1000, 1e-6}};
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    if (HAS_ADDRESS_SANITIZER && row[i].side > 4) continue;
    double start;
    msim_scene *scene = falling_block(row[i].side, &start);
    msim_sim *sim;
    msim_state s;
    msim_energy energy = {.size = sizeof energy};
    run(scene, row[i].method, 1, row[i].steps, &s, &sim);
    msim_sim_energy(sim, &energy);
    print_message("  %-16s %4d particles land: dE/E = %.1e, %lld impacts\n", row[i].method,
                  row[i].side * row[i].side, energy.total / start - 1,
                  (long long)stats_of(sim).contacts);
    assert_true(stats_of(sim).contacts >= 4 * row[i].side * row[i].side);
    assert_close(energy.total / start, 1, row[i].most);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- friction -------------------------------------------------*/

/* Particles with springs of rest length 0 on a rough floor */
static msim_scene *on_floor(int32_t n, const double *x, const double *v, int32_t nsprings,
                            const int32_t *ij, const double *k, int32_t pin, double g, double mu) {
  const double mass[3] = {1, 1, 1}, none[2] = {0}, gravity[3] = {0, 0, -g};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, n, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, nsprings, ij, k, none, none, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  plane(scene, 0, 0, 1, 0, 0, mu);
  return scene;
}

typedef struct reference {
  double T;
  int at; /* index into x, or into v if of_v; value has two entries from there on */
  int of_v;
  double value[2];
} reference;

static double error_of(const msim_scene *scene, const char *method, int64_t steps,
                       const reference *r) {
  msim_sim *sim;
  msim_state s;
  run(scene, method, r->T, steps, &s, &sim);
  const double *of = r->of_v ? s.v : s.x;
  const double off = fmax(fabs(of[r->at] - r->value[0]), fabs(of[r->at + 1] - r->value[1]));
  assert_true(stats_of(sim).contacts == 0);
  msim_sim_destroy(sim);
  return off;
}

typedef struct expectation {
  const char *method;
  double coarse; /* upper bound of the error at the smallest number of steps */
  double order;  /* least order from there to 4 times as many, unless the error is < `enough` */
  double enough;
} expectation;

static void check_orders(const msim_scene *scene, const reference *r, int64_t steps,
                         const expectation *row, size_t nrows) {
  for (size_t i = 0; i < nrows; i++) {
    const double coarse = error_of(scene, row[i].method, steps, r);
    const double fine = error_of(scene, row[i].method, 4 * steps, r);
    const double order = log2(coarse / fine) / 2;
    print_message("  %-16s %.2e %.2e  order %.2f\n", row[i].method, coarse, fine, order);
    assert_true(coarse <= row[i].coarse);
    assert_true(order >= row[i].order || fine <= row[i].enough);
  }
}

/* A mass that oscillates above a sticking one pulls at it with growing force, until it begins to
 * slip at 0.71 of the run. Reference: closed form until then, then Radau with rtol 1e-12. */
static void slip_begins_to_second_order(void **state) {
  (void)state;
  static const reference r = {
      25 * 0.013751668302064151, 0, 1, {0.008225167108081558, -0.0004982180658425192}};
  static const expectation row[] = {{"velocity-verlet", 3e-4, 1.5, 0},
                                    {"heun", 3e-4, 1.5, 5e-6},
                                    {"rk4", 3e-4, 1.5, 0},
                                    {"dop853", 3e-4, 1.5, 0},
                                    {"rkc", 3e-4, 1.5, 5e-6},
                                    {"rkn6", 3e-4, 1.5, 5e-6},
                                    {"force-gradient", 3e-4, 1.5, 5e-6},
                                    {"implicit-midpoint", 3e-4, 1.5, 0},
                                    {"trapezoidal", 3e-4, 1.5, 0},
                                    {"newmark", 3e-4, 1.5, 0},
                                    {"bdf2", 3e-4, 1.5, 0},
                                    {"tr-bdf2", 3e-4, 1.5, 0},
                                    {"sdirk2", 3e-4, 1.5, 0}};
  const double x[9] = {0, 0, 0, 0, 0.4, 0.4166666666666667, 0, 0, 1}, v[9] = {0, 0, 0, 3.2};
  const double k[2] = {4, 20};
  const int32_t ij[4] = {0, 1, 1, 2};
  msim_scene *scene = on_floor(3, x, v, 2, ij, k, 2, 10, 0.3);
  check_orders(scene, &r, 25, row, sizeof row / sizeof *row);
  msim_scene_destroy(scene);
}

/* An orbit around a spring's pinned end on a rough floor. Reference: DOP853 with rtol 1e-13,
 * confirmed by Radau. */
static void curved_sliding_keeps_the_order(void **state) {
  (void)state;
  static const reference orbit = {4, 3, 0, {-0.5623132073553342, -0.601719995827015}};
  static const expectation row[] = {{"velocity-verlet", 1e-2, 1.9, 0},
                                    {"heun", 2e-2, 1.9, 0},
                                    {"rkc", 2e-2, 1.9, 0},
                                    {"rk4", 4e-5, 3.8, 0},
                                    {"dop853", 2e-12, 0, 1e-13},
                                    {"rkn6", 1e-2, 1.9, 0},
                                    {"force-gradient", 1e-2, 1.9, 0}};
  const double x[6] = {0, 0, 0, 1, 0, 0}, v[6] = {0, 0, 0, 0, 1, 0}, k = 1;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene = on_floor(2, x, v, 1, ij, &k, 0, 1, 0.1);
  check_orders(scene, &orbit, 20, row, sizeof row / sizeof *row);
  msim_scene_destroy(scene);
}

/* At the ends of a narrow ellipse v turns by 90 degrees and more per step, which is no stop.
 * Reference: as above. */
static void sharp_turns_are_no_stops(void **state) {
  (void)state;
  static const reference r = {6, 3, 0, {0.5729147314957811, -0.0014055531692621337}};
  static const expectation row[] = {{"velocity-verlet", 1e-3, 1.8, 0},
                                    {"heun", 4e-3, 1.8, 0},
                                    {"rk4", 1e-4, 1.8, 0},
                                    {"dop853", 1e-5, 2, 0},
                                    {"rkn6", 1e-3, 1.8, 0}};
  const double x[6] = {0, 0, 0, 1, 0, 0}, v[6] = {0, 0, 0, 0, 0.03, 0}, k = 1;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene = on_floor(2, x, v, 1, ij, &k, 0, 1, 0.1);
  check_orders(scene, &r, 60, row, sizeof row / sizeof *row);
  msim_scene_destroy(scene);
}

/* Friction that would stop a mass within two steps keeps its direction throughout a step of an
 * implicit method. With a spring of rest length 0 the step is therefore linear: in each stage
 * Newton's method makes one correction, and a second iteration that finds none. */
static void slow_sliding_takes_no_more_iterations(void **state) {
  (void)state;
  static const struct {
    const char *method;
    int stages; /* of a first step */
  } row[] = {{"implicit-euler", 1}, {"implicit-midpoint", 1}, {"trapezoidal", 1}, {"newmark", 1},
             {"bdf2", 2},           {"tr-bdf2", 2},           {"sdirk2", 2}};
  const double h = 0.01, g = 10, mu = 0.15, share[] = {0.5, 1.1, 1.5, 1.9}, k = 1;
  const int32_t ij[2] = {0, 1};
  for (size_t i = 0; i < 4 * sizeof row / sizeof *row; i++) {
    const double speed = share[i % 4] * h * mu * g, x[6] = {0, 0, 0, 1, 0, 0};
    const double v[6] = {0, 0, 0, 0.2 * speed, sqrt(0.96) * speed, 0};
    msim_scene *scene = on_floor(2, x, v, 1, ij, &k, 0, g, mu);
    msim_sim *sim;
    msim_state s;
    run(scene, row[i / 4].method, h, 1, &s, &sim);
    assert_in_range(stats_of(sim).newton_iterations, 1, 2 * row[i / 4].stages);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- many bounces ---------------------------------------------*/

/* 250 bounces in 5 steps between elastic planes */
static void bounces_without_end_keep_the_speed(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.005}, v[3] = {1, 0, 10};
  for (int32_t m = 0; event_method_at(m); m++) {
    const char *name = event_method_at(m);
    if (is_implicit(name)) continue;
    msim_scene *scene = make_single_particle(x, v, 0);
    plane(scene, 0, 0, 1, 0, 1, 0);
    plane(scene, 0, 0, -1, -0.01, 1, 0);
    msim_sim *sim;
    msim_state s;
    run(scene, name, 0.25, 5, &s, &sim);
    assert_close(s.v[2], 10, 1e-10);
    assert_close(s.x[2], 0.005, 1e-9);
    assert_close(s.x[0], 0.25, 1e-13);
    assert_int_equal(stats_of(sim).contacts, 250);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Infinitely many bounces that die out lose speed by friction just as the few large ones do.
 * Position of rest in closed form. */
static void small_bounces_cause_friction_too(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.5}, v[3] = {3, 0, 0};
  for (int32_t m = 0; event_method_at(m); m++) {
    const char *name = event_method_at(m);
    if (is_implicit(name)) continue;
    msim_scene *scene = make_single_particle(x, v, 9.81);
    plane(scene, 0, 0, 1, 0, 0.5, 0.2);
    msim_sim *sim;
    msim_state s;
    run(scene, name, 2, 200, &s, &sim);
    assert_close(s.x[0], 2.393577981651375, strstr(name, "euler") ? 0.02 : 1e-4);
    assert_true(s.x[2] == 0 && s.v[0] == 0 && s.v[2] == 0);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Elastic bounces of 0.02 s within one step of 1 s, each of which starts on the plane. */
static void short_bounces_are_all_found(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.0005}, v[3] = {0};
  for (int32_t m = 0; event_method_at(m); m++) {
    const char *name = event_method_at(m);
    if (is_implicit(name) || strstr(name, "euler")) continue;
    msim_scene *scene = make_single_particle(x, v, 10);
    plane(scene, 0, 0, 1, 0, 1, 0);
    msim_sim *sim;
    msim_state s;
    run(scene, name, 1, 1, &s, &sim);
    assert_close(s.x[2], 0.0005, 1e-11);
    assert_close(s.v[2], 0, 1e-10);
    assert_int_equal(stats_of(sim).contacts, 50);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* One step with infinitely many bounces, which are summed, followed by sliding, ends where 400
 * single bounces end; so does one with 150 short elastic bounces and half a flight. */
static void bounces_are_summed_exactly(void **state) {
  (void)state;
  const double g = 10, mu = 0.05;
  for (int elastic = 0; elastic < 2; elastic++) {
    const double e = elastic ? 1 : 0.9, T = elastic ? 3.01 : 3;
    double u = elastic ? 0.1 : 1, t = 0, at = 0, vx = 2;
    const double x[3] = {0}, v[3] = {vx, 0, u};
    for (int i = 0; i < (elastic ? 150 : 400); i++) {
      const double flight = 2 * u / g;
      t += flight, at += vx * flight;
      vx -= mu * (1 + e) * u, u *= e;
    }
    const double friction = elastic ? 0 : mu * g;
    at += vx * (T - t) - friction * (T - t) * (T - t) / 2;
    msim_scene *scene = make_single_particle(x, v, g);
    plane(scene, 0, 0, 1, 0, e, mu);
    msim_sim *sim;
    msim_state s;
    run(scene, "velocity-verlet", T, 1, &s, &sim);
    assert_close(s.x[0], at, 1e-12);
    assert_close(s.v[0], vx - friction * (T - t), 1e-12);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- impacts while sliding ------------------------------------*/

/* A particle that friction would stop after d = v^2/(2 mu g), meets an elastic wall at share d: in
 * one long step it bounces when it is there, and stops at (2 share - 1) d. */
static void slides_meet_walls_in_time(void **state) {
  (void)state;
  const double g = 10, mu = 0.2, u = 1, d = u * u / (2 * mu * g), T = 2;
  for (double share = 0.25; share < 1; share += 0.1) {
    const double x[3] = {0}, v[3] = {0, u, 0};
    msim_scene *scene = make_single_particle(x, v, g);
    plane(scene, 0, 0, 1, 0, 0, mu);
    plane(scene, 0, -1, 0, -share * d, 1, 0);
    msim_sim *sim;
    msim_state s;
    run(scene, "velocity-verlet", T, 1, &s, &sim);
    assert_close(s.x[1], (2 * share - 1) * d, 1e-14);
    assert_int_equal(stats_of(sim).contacts, 1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* On a slope friction bends the slide: one long step ends where many short ones do. The parabola
 * through its end misses the wall, or meets it at another time. */
static void curved_slides_meet_walls_in_time(void **state) {
  (void)state;
  for (int i = 0; i < 24; i++) {
    const double slope = 0.2 * sin(2 * i), mu = 0.3, T = 1, x[3] = {0},
                 v[3] = {cos(i), sin(i), -slope * cos(i) - 0.2 * sin(i)};
    double end[2][3];
    for (int fine = 0; fine < 2; fine++) {
      msim_scene *scene = make_single_particle(x, v, 10);
      plane(scene, slope, 0.2, 1, 0, 0, mu);
      plane(scene, 1, -2, 0, -0.11 * (1 + i % 4), 0.5, 0);
      msim_sim *sim;
      msim_state s;
      run(scene, "velocity-verlet", T, fine ? 4096 : 1, &s, &sim);
      memcpy(end[fine], s.x, sizeof end[fine]);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
    for (int c = 0; c < 3; c++) assert_close(end[0][c], end[1][c], 1e-11);
  }
}

/*------------------------------------- rounding -------------------------------------------------*/

/* A particle that leaves a plane at no more than the rounding tolerance, 1e-14 (|v| + h |a|), stays
 * on it. A faster one flies, and lands again. */
static void rounding_lifts_nothing(void **state) {
  (void)state;
  const double g = 10, h = 0.01, noise = 1e-14 * (1 + h * g), x[3] = {0};
  for (int32_t m = 0; event_method_at(m); m++)
    for (int flies = 0; flies < 2; flies++) {
      const double v[3] = {1, 0, (flies ? 2 : 0.5) * noise};
      msim_scene *scene = make_single_particle(x, v, g);
      plane(scene, 0, 0, 1, 0, 0.5, 0);
      msim_sim *sim;
      msim_state s;
      run(scene, event_method_at(m), h, 1, &s, &sim);
      assert_true(s.x[2] == 0 && s.v[2] == 0);
      assert_int_equal(stats_of(sim).contacts, flies);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* On a frictionless slope of at most 16 epsilon, which may be rounding error, nothing moves. */
static void rounding_moves_nothing(void **state) {
  (void)state;
  const double g = 10, x[3] = {0};
  for (int slides = 0; slides < 2; slides++) {
    const double slope = (slides ? 32 : 8) * DBL_EPSILON;
    msim_scene *scene = make_single_particle(x, x, g);
    plane(scene, slope, 0, 1, 0, 0.5, 0);
    msim_sim *sim;
    msim_state s;
    run(scene, "heun", 1, 100, &s, &sim);
    assert_close(s.v[0], slides * g * slope, 1e-10 * g * slope);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Impacts, stops and slips of a cloth that settles on a rough floor add no force evaluations with
 * velocity Verlet, and with rk4 less than half a step each. */
static void a_cloth_lies_down_cheaply(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "rk4"};
  const double g[3] = {0, 0, -9.81};
  const int32_t corners[2] = {0, 9};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 10,
                            .columns = 10,
                            .origin = {0, 0, 0.25},
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 1500,
                            .k_shear = 375,
                            .k_bend = 15,
                            .damping = 0.02,
                            .npinned = 2,
                            .pinned = corners};
  for (size_t m = 0; m < 2; m++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_cloth(scene, &cloth, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    plane(scene, 0.05, 0, 1, 0, 0.3, 0.4);
    msim_sim *sim;
    msim_state s;
    const double evaluations = run(scene, methods[m], 0.5, 500, &s, &sim);
    assert_true(stats_of(sim).contacts > 300);
    assert_true(evaluations <= (m == 0 ? 1000 : 3300));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A mass circles about a pin on a spring without rest length, and grazes a plane by 1e-10 m, in any
 * part of a step. */
static void a_graze_keeps_the_order(void **state) {
  (void)state;
  enum { PHASES = 48 };
  const double tol = 1e-5, T = 2, k = 9;
  for (int i = 0; i < PHASES; i++) {
    const double angle = 6.283185307179586 * i / PHASES + 0.01, end = angle + 3 * T;
    const double x[6] = {0, 0, 0, cos(angle), 0, sin(angle)},
                 v[6] = {0, 0, 0, -3 * sin(angle), 0, 3 * cos(angle)};
    msim_scene *scene = make_oscillator(x, v, k);
    plane(scene, 0, 0, 1, 1e-10 - 1, 0, 0);
    msim_options opt = options("dop853", 0.03);
    opt.tol = tol, opt.t_end = T, opt.steps = -1;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    const msim_state s = state_of(sim);
    assert_true(hypot(s.x[3] - cos(end), s.x[5] - sin(end)) <= 2 * tol);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(elastic_faces_keep_their_energy),
                                     cmocka_unit_test(a_graze_keeps_the_order),
                                     cmocka_unit_test(slip_begins_to_second_order),
                                     cmocka_unit_test(curved_sliding_keeps_the_order),
                                     cmocka_unit_test(sharp_turns_are_no_stops),
                                     cmocka_unit_test(slow_sliding_takes_no_more_iterations),
                                     cmocka_unit_test(bounces_without_end_keep_the_speed),
                                     cmocka_unit_test(small_bounces_cause_friction_too),
                                     cmocka_unit_test(short_bounces_are_all_found),
                                     cmocka_unit_test(bounces_are_summed_exactly),
                                     cmocka_unit_test(slides_meet_walls_in_time),
                                     cmocka_unit_test(curved_slides_meet_walls_in_time),
                                     cmocka_unit_test(rounding_lifts_nothing),
                                     cmocka_unit_test(rounding_moves_nothing),
                                     cmocka_unit_test(a_cloth_lies_down_cheaply)};
  return cmocka_run_group_tests_name("contact", tests, NULL, NULL);
}
