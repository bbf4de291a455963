/* Tests of properties of takahashi-imada, force-gradient, ssprk102, ssprk104, rk6, rkc and respa
 * besides their order: conserved quantities, cost, stability, error estimate; of the time that
 * forces take. See also test_respa.c and test_rk6.c */
#include <complex.h>
#include <math.h>
#include <string.h>

#include "methods/rkc.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 5, N = SIDE * SIDE };

/* A free cloth, bent and thrown, two of whose springs have the stiffness `stiff`. Damping = ratio
 * times stiffness. */
static msim_scene *thrown(double stiff, double ratio) {
  msim_scene *cloth = hanging_cloth(SIDE, 50, 0), *scene;
  msim_scene_view view = {.size = sizeof view};
  double x[3 * N], v[3 * N], k[8 * N], c[8 * N];
  unsigned seed = 3;
  msim_scene_get(cloth, &view);
  for (int i = 0; i < 3 * N; i++) {
    x[i] = view.x[i] + 0.02 * uniform(&seed);
    v[i] = uniform(&seed) - 0.5;
  }
  for (int32_t e = 0; e < view.nsprings; e++) {
    k[e] = e == 7 || e == 40 ? stiff : view.k[e];
    c[e] = ratio * k[e];
  }
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, v, view.mass, err));
  assert_ok(msim_scene_add_springs(scene, view.nsprings, view.ij, k, view.rest, c, err));
  msim_scene_destroy(cloth);
  return scene;
}

static double distance(const double *a, const double *b) {
  double sum = 0;
  for (int q = 0; q < 3 * N; q++) sum += (a[q] - b[q]) * (a[q] - b[q]);
  return sqrt(sum);
}

static msim_energy energy_of(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  msim_sim_energy(sim, &e);
  return e;
}

/* The forces of a spring on its ends are opposite: momentum is conserved up to rounding. */
static void momentum_is_kept(void **state) {
  (void)state;
  static const struct {
    const char *method;
    double h, ratio;
  } runs[] = {{"takahashi-imada", 5e-4, 0}, {"force-gradient", 5e-4, 0}, {"ssprk102", 1e-4, 1e-3},
              {"ssprk104", 1e-4, 1e-3},     {"rk6", 1e-4, 1e-3},         {"rkc", 1e-3, 1e-3},
              {"respa", 2.2e-3, 0},         {"respa", 2.2e-3, 1e-5}};
  for (size_t i = 0; i < sizeof runs / sizeof *runs; i++) {
    msim_scene *scene = thrown(1e5, runs[i].ratio);
    msim_options opt = options(runs[i].method, runs[i].h);
    msim_sim *sim = make_sim(scene, &opt);
    const msim_energy before = energy_of(sim);
    assert_ok(msim_sim_step(sim, 500, err));
    const msim_energy after = energy_of(sim);
    const int spins_on = strcmp(runs[i].method, "respa") == 0;
    for (int c = 0; c < 3; c++) {
      assert_close(after.momentum[c], before.momentum[c], 1e-13);
      if (spins_on) assert_close(after.angular_momentum[c], before.angular_momentum[c], 1e-13);
    }
    assert_close(after.total, before.total, runs[i].ratio > 0 ? before.total : 0.1 * before.total);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* After a reversal of v a symmetric method returns to its start, up to rounding. */
static void reversible_methods_return_to_the_start(void **state) {
  (void)state;
  static const struct {
    const char *method;
    double h;
  } runs[] = {{"force-gradient", 5e-4}, {"respa", 2.2e-3}};
  for (size_t i = 0; i < sizeof runs / sizeof *runs; i++) {
    msim_scene *scene = thrown(1e5, 0);
    msim_options opt = options(runs[i].method, runs[i].h);
    msim_sim *sim = make_sim(scene, &opt);
    double start[3 * N], x[3 * N], v[3 * N];
    memcpy(start, state_of(sim).x, sizeof start);
    assert_ok(msim_sim_step(sim, 100, err));
    msim_state s = state_of(sim);
    double moved = 0, off = 0;
    for (int q = 0; q < 3 * N; q++) {
      x[q] = s.x[q], v[q] = -s.v[q];
      moved = fmax(moved, fabs(x[q] - start[q]));
    }
    s.x = x, s.v = v;
    assert_ok(msim_sim_set_state(sim, &s, err));
    assert_ok(msim_sim_step(sim, 100, err));
    s = state_of(sim);
    for (int q = 0; q < 3 * N; q++) off = fmax(off, fabs(s.x[q] - start[q]));
    assert_true(moved > 0.01);
    assert_close(off, 0, 1e-9);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- force-gradient -------------------------------------------*/

/* The state after 0.4 s and so many evaluations, apart from one at the start */
static void spend(const msim_scene *scene, const char *method, int per_step, int evaluations,
                  double *x) {
  const int steps = evaluations / per_step;
  msim_options opt = options(method, 0.4 / steps);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  assert_in_range(stats_of(sim).force_evaluations, per_step * steps, per_step * steps + 1);
  memcpy(x, state_of(sim).x, 3 * N * sizeof *x);
  msim_sim_destroy(sim);
}

/* For errors of 1e-2 to 1e-5 it is the most accurate explicit method for its evaluations. */
static void force_gradient_is_the_cheapest(void **state) {
  (void)state;
  static const struct {
    const char *method;
    int per_step;
    double worse; /* factor of the error, at least */
  } others[] = {{"velocity-verlet", 1, 10}, {"rk4", 4, 10}, {"rkn6", 11, 3}};
  static const struct {
    int evaluations;
    double error;
  } runs[] = {{132, 5e-3}, {198, 3e-4}, {264, 5e-5}};
  static double exact[3 * N], x[3 * N], y[3 * N];
  msim_scene *scene = thrown(50, 0);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  spend(scene, "rkn6", 11, 22000, exact);
  for (size_t r = 0; r < sizeof runs / sizeof *runs; r++) {
    spend(scene, "force-gradient", 5, runs[r].evaluations, x);
    const double off = distance(x, exact);
    assert_true(off < runs[r].error * distance(view.x, exact));
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
      spend(scene, others[i].method, others[i].per_step, runs[r].evaluations, y);
      assert_true(distance(y, exact) > others[i].worse * off);
    }
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- takahashi-imada ------------------------------------------*/

/* In a smooth scene in which the longest stable steps of other methods are more accurate than
 * needed. */
static void takahashi_imada_is_the_cheapest_of_long_steps(void **state) {
  (void)state;
  static double exact[3 * N], x[3 * N], y[3 * N];
  msim_scene *scene = hanging_cloth(SIDE, 500, 0);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  spend(scene, "rkn6", 11, 22000, exact);
  spend(scene, "takahashi-imada", 2, 200, x);
  assert_true(distance(x, exact) < 1e-5 * distance(view.x, exact));
  spend(scene, "velocity-verlet", 1, 200, y);
  assert_true(distance(y, exact) > 8 * distance(x, exact));
  spend(scene, "force-gradient", 5, 200, y);
  assert_true(distance(y, exact) > 8 * distance(x, exact)); /* not stable */
  msim_scene_destroy(scene);
}

/* Its internal variables depend on h and the springs; x and v, which are returned, change only by
 * steps. */
static void new_parameters_move_nothing(void **state) {
  (void)state;
  msim_scene *scene = thrown(50, 0);
  msim_options opt = options("takahashi-imada", 5e-4);
  msim_sim *sim = make_sim(scene, &opt);
  double x[3 * N], v[3 * N], k[8 * N];
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  for (int32_t e = 0; e < view.nsprings; e++) k[e] = 2 * view.k[e];
  for (int round = 0; round < 3; round++) {
    if (round > 0) assert_ok(msim_sim_step(sim, 10, err));
    memcpy(x, round > 0 ? state_of(sim).x : view.x, sizeof x);
    memcpy(v, round > 0 ? state_of(sim).v : view.v, sizeof v);
    if (round == 1) assert_ok(msim_sim_set_step(sim, 1e-3, err));
    if (round == 2) assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
    assert_memory_equal(state_of(sim).x, x, sizeof x);
    assert_memory_equal(state_of(sim).v, v, sizeof v);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A mass on a spring; the energy at any step is that of the start, for any share of the limit. */
static void energy_is_right_at_long_steps(void **state) {
  (void)state;
  const double shares[] = {0.05, 0.2, 0.35, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95};
  for (int i = 0; i < 18; i++) {
    msim_scene *scene = mass_on_spring(1e4, 0, i % 2 ? 0.7 : 0);
    msim_options opt = options("takahashi-imada", shares[i / 2] * sqrt(12) / 100);
    msim_sim *sim = make_sim(scene, &opt);
    const double start = energy_of(sim).total;
    for (int step = 0; step < 100; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      assert_close(energy_of(sim).total, start, 0.02 * start);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void planes_are_refused(void **state) {
  (void)state;
  msim_scene *scene = thrown(50, 0);
  plane(scene, 0, 0, 1, -1, 1, 0);
  msim_options opt = options("takahashi-imada", 5e-4);
  msim_sim *sim = NULL;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "planes"));
  msim_scene_destroy(scene);
}

/*------------------------------------- ssprk102, ssprk104 and rk6 -------------------------------*/

/* The estimated errors of x and v after one step of h */
static void estimate_step(const char *method, double h, double error[2]) {
  msim_scene *scene = thrown(200, 1e-3);
  const msim_options opt = options(method, h);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  ms_stepper *s = &sim->islands->stepper;
  double *d[2] = {ms_unknowns_new_vector(scene->data, &s->model->unknowns),
                  ms_unknowns_new_vector(scene->data, &s->model->unknowns)};
  s->cached_stage = 0; /* as at the start of the step */
  sim->config.integrator->estimate(s, 0, d[0], d[1]);
  for (int i = 0; i < 2; i++) {
    error[i] = sqrt(ms_vector_dot(s->model->shape, d[i], d[i]));
    ms_memory_free(&scene->data->alloc, d[i]);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The difference of two methods of order 2 is proportional to h^3, that of the orders 4 and 3 to
 * h^4, that of 6 and 5 to h^6. */
static void estimates_have_their_order(void **state) {
  (void)state;
  const struct {
    const char *method;
    double h, order;
  } cases[] = {{"ssprk102", 4e-4, 3}, {"ssprk104", 4e-4, 4}, {"rk6", 8e-4, 6}};
  for (int m = 0; m < 3; m++) {
    double whole[2], half[2];
    estimate_step(cases[m].method, cases[m].h, whole);
    estimate_step(cases[m].method, cases[m].h / 2, half);
    for (int i = 0; i < 2; i++) {
      print_message("  %s, %c: half the step, 2^%.3g of the error\n", cases[m].method, "xv"[i],
                    log2(half[i] / whole[i]));
      assert_close(log2(whole[i] / half[i]), cases[m].order, 0.15);
    }
  }
}

/*------------------------------------- rkc ------------------------------------------------------*/

/* T_s and its first two derivatives at w0 > 1, by the hyperbolic formula */
static void chebyshev(int s, double w0, double t[3]) {
  const double u = acosh(w0), r = sinh(u);
  t[0] = cosh(s * u);
  t[1] = s * sinh(s * u) / r;
  t[2] = (s * s * cosh(s * u) - w0 * t[1]) / (r * r);
}

/* The amplification factor of s stages, in closed form */
static double complex amplification(int s, double complex z) {
  const double w0 = 1 + 2. / 13 / (s * (double)s);
  double t[3];
  chebyshev(s, w0, t);
  const double b = t[2] / (t[1] * t[1]), w1 = t[1] / t[2];
  return 1 - b * t[0] + b * ccosh(s * cacosh(w0 + w1 * z));
}

/* With the chosen number of stages all modes within the bounds are stable, if rates grow in
 * proportion to stiffness; with two stages fewer the stiffest is not. */
static void stages_hold_the_whole_strip(void **state) {
  (void)state;
  for (double rate = 0.01; rate < 2000; rate *= 1.3)
    for (double strip = 0.05; strip <= MS_RKC_STRIP; strip += 0.05) {
      const ms_bounds bounds = {.omega = sqrt(strip * rate), .rate = rate};
      const int s = ms_rkc_count_stages(1, bounds);
      double largest = 0;
      for (int i = 1; i <= 200; i++) {
        const double w = bounds.omega * i / 200, g = rate * i * i / 40000;
        const double complex root = csqrt(g * g / 4 - w * w);
        largest = fmax(largest, cabs(amplification(s, -g / 2 + root)));
        largest = fmax(largest, cabs(amplification(s, -g / 2 - root)));
      }
      if (!(largest <= 1 + 1e-12))
        fail_msg("rate %g, omega %g: %d stages grow by %g", rate, bounds.omega, s, largest - 1);
      if (s > 4 && rate > 4 * bounds.omega) assert_true(cabs(amplification(s - 2, -rate)) > 1);
    }
}

/* A mass that oscillates along a damped spring of rest length 0, a linear system */
static msim_scene *oscillator(double omega, double rate) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, v[6] = {0, 0, 0, -0.3, 0, 0}, mass[2] = {1, 1};
  const double k = omega * omega, rest = 0;
  const int32_t ij[2] = {0, 1}, pin = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &rate, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  return scene;
}

/* A step applies this polynomial to the matrix, with one evaluation per stage. */
static void a_step_has_that_amplification(void **state) {
  (void)state;
  static const double modes[][2] = {{1, 0.2}, {1, 3}, {3, 20}, {5, 200}, {10, 1500}};
  for (size_t i = 0; i < sizeof modes / sizeof *modes; i++) {
    const double omega = modes[i][0], rate = modes[i][1];
    msim_scene *scene = oscillator(omega, rate);
    msim_options opt = options("rkc", 1);
    msim_sim *sim = make_sim(scene, &opt);
    /* the bounds would give twice the k and c of the spring */
    const int s = ms_rkc_count_stages(1, (ms_bounds){.omega = omega, .rate = rate});
    assert_ok(msim_sim_step(sim, 1, err));
    assert_int_equal(stats_of(sim).force_evaluations, s);
    /* x = p e^(z t) + q e^(y t) */
    const double complex root = csqrt(rate * rate / 4 - omega * omega);
    const double complex z = -rate / 2 + root, y = -rate / 2 - root;
    const double complex p = (-0.3 - y) / (z - y), q = 1 - p;
    const double complex pz = p * amplification(s, z), qy = q * amplification(s, y);
    assert_close(state_of(sim).x[3], creal(pz + qy), 1e-11);
    assert_close(state_of(sim).v[3], creal(z * pz + y * qy), 1e-11 * rate);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* If damping limits the step: a tenth of the evaluations of velocity Verlet at its stability limit,
 * and an error within 1 %. */
static void strong_damping_takes_few_evaluations(void **state) {
  (void)state;
  static const struct {
    const char *method;
    double h;
  } runs[] = {{"rk4", 4e-5}, {"rkc", 0.04}, {"velocity-verlet", 2.4e-4}};
  static double x[3][3 * N];
  int64_t evaluations[3];
  msim_scene *scene = hanging_cloth(SIDE, 100, 4);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  for (int i = 0; i < 3; i++) {
    msim_options opt = options(runs[i].method, runs[i].h);
    msim_sim *sim = make_sim(scene, &opt);
    const char *text;
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_int_equal(strstr(text, "23 stages per step, chosen for that damping rate") != NULL,
                     i == 1);
    assert_non_null(strstr(text, "is stable for h < "));
    assert_null(strstr(text, "may become unstable"));
    assert_ok(msim_sim_step(sim, (int64_t)round(0.4 / runs[i].h), err));
    memcpy(x[i], state_of(sim).x, sizeof x[i]);
    evaluations[i] = stats_of(sim).force_evaluations;
    msim_sim_destroy(sim);
  }
  assert_true(distance(x[1], x[0]) < 0.01 * distance(x[0], view.x));
  assert_int_equal(evaluations[1], 10 * 23);
  assert_true(10 * evaluations[1] < evaluations[2]);
  msim_scene_destroy(scene);
}

/*------------------------------------- time -----------------------------------------------------*/

/* Of the sweeps of a small scene few are timed, for all: forces take most of its time, less while
 * other programs interrupt the run. */
static void the_time_of_small_sweeps_is_estimated(void **state) {
  (void)state;
  msim_scene *scene = thrown(50, 1e-3);
  const msim_options opt = options("velocity-verlet", 1e-5);
  double share = 0;
  for (int i = 0; i < 8; i++) {
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_true(stats_of(sim).force_s > 0);
    assert_true(stats_of(sim).force_s < stats_of(sim).total_s);
    assert_ok(msim_sim_step(sim, 1000, err));
    const msim_stats of = stats_of(sim);
    share = fmax(share, of.force_s / of.total_s);
    assert_true(of.force_s <= of.total_s);
    msim_sim_destroy(sim);
  }
  print_message("  forces take %.2g of the time\n", share);
  assert_true(share > 0.2);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(momentum_is_kept),
      cmocka_unit_test(reversible_methods_return_to_the_start),
      cmocka_unit_test(force_gradient_is_the_cheapest),
      cmocka_unit_test(takahashi_imada_is_the_cheapest_of_long_steps),
      cmocka_unit_test(energy_is_right_at_long_steps),
      cmocka_unit_test(new_parameters_move_nothing),
      cmocka_unit_test(planes_are_refused),
      cmocka_unit_test(estimates_have_their_order),
      cmocka_unit_test(stages_hold_the_whole_strip),
      cmocka_unit_test(a_step_has_that_amplification),
      cmocka_unit_test(strong_damping_takes_few_evaluations),
      cmocka_unit_test(the_time_of_small_sweeps_is_estimated)};
  return cmocka_run_group_tests_name("explicit", tests, NULL, NULL);
}
