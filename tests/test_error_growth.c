/* Tests of error growth: the measured rate against that of an unstable equilibrium, and the
 * warning, which appears for chaotic motion only. */
#include <math.h>
#include <stdio.h>

#include "checkpoints.h"
#include "sim/sim.h"

typedef struct reports {
  int n;
  double t; /* of the last one, s */
} reports;

static void log_report(const char *text, void *user) {
  reports *r = user;
  const char *time = strstr(text, "t = ");
  if (!strstr(text, "the motion amplifies small errors")) return;
  assert_non_null(time);
  r->t = strtod(time + 4, NULL);
  r->n++;
}

/* n particles of 1 kg between two pinned ones on a line, 0.5 m apart; springs of 50 N/m and this
 * rest length. The particles move along the line, by different distances. */
static msim_scene *column(int32_t n, double rest, double damping, double drag) {
  const double k = 50, mass = 1;
  const int32_t ends[2] = {0, n + 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t i = 0; i < n + 2; i++) {
    const double speed = i == 1 ? 0.2 : 0, x[3] = {0.3 * i, 0.4 * i, 0};
    const double v[3] = {0.3 * speed, 0.4 * speed, 0};
    const int32_t ij[2] = {i - 1, i};
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
    if (i) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, err));
  }
  assert_ok(msim_scene_pin(scene, 2, ends, err));
  assert_ok(msim_scene_set_drag(scene, drag, err));
  return scene;
}

static msim_options options_to(const char *method, double tol, double t_end, reports *r) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.tol = tol, opt.t_end = t_end;
  opt.warn = log_report, opt.warn_user = r;
  *r = (reports){0};
  return opt;
}

static void run(const msim_scene *scene, const msim_options *opt) {
  msim_sim *sim = make_sim(scene, opt);
  assert_ok(msim_sim_run(sim, NULL, 0, err));
  msim_sim_destroy(sim);
}

/* Displacements y_i perpendicular to the line obey y_i'' = g (2 y_i - y_(i-1) - y_(i+1)) - b y_i'
 * with g = (k/m)(L/l - 1) = 5 and drag b. With the largest eigenvalue of that matrix, 2 for one
 * particle and 3 for two, they grow like exp(a t), a^2 + b a = 10 or 15. So E = (exp(a t) - 1)/(a
 * T) reaches 30 at t = ln(30 a T + 1)/a, or later, as the first disturbance is spread over all
 * modes, and as strides take 0.2 s. Dampers act along the line only. */
static void growth_is_that_of_the_unstable_mode(void **state) {
  static const char *const methods[] = {"dop853", "rk4", "heun", "auto"};
  static const struct {
    int32_t n;
    double damping, drag, a;
  } cases[] = {{1, 0, 0, 3.1623}, {2, 0, 0, 3.8730}, {2, 6, 3, 2.6533}};
  const double T = 4;
  (void)state;
  for (int i = 0; i < 12; i++) {
    reports r;
    const double a = cases[i % 3].a, expected = log(30 * a * T + 1) / a;
    msim_scene *scene = column(cases[i % 3].n, 0.55, cases[i % 3].damping, cases[i % 3].drag);
    const msim_options opt = options_to(methods[i / 3], 1e-7, T, &r);
    run(scene, &opt);
    if (r.n != 1 || !(r.t > expected && r.t < expected + 0.7))
      fail_msg("%s, %d: %d reports, at %g s; 1 expected, at %g s", methods[i / 3], i % 3, r.n, r.t,
               expected);
    msim_scene_destroy(scene);
  }
}

/* The same springs in tension are stable. The first run has an end, the second has none. */
static void regular_motion_is_not_reported(void **state) {
  (void)state;
  for (int endless = 0; endless < 2; endless++) {
    reports r;
    msim_scene *scene = column(1, 0.25, 0, 0);
    const msim_options opt = options_to("dop853", 1e-7, endless ? -1 : 100, &r);
    msim_sim *sim = make_sim(scene, &opt);
    while (state_of(sim).t < 100) assert_ok(msim_sim_step(sim, 1, err));
    assert_int_equal(r.n, 0);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/* Strides stay stable if springs in tension get a hundred times stiffer, so that nothing grows
 * until others that push make the line unstable. */
static void new_springs_start_the_measurement_anew(void **state) {
  const double stiff[2] = {5000, 5000}, longer[2] = {0.55, 0.55};
  const char *text;
  reports r;
  msim_scene *scene = column(1, 0.25, 0, 0);
  const msim_options opt = options_to("dop853", 1e-7, 30, &r);
  msim_sim *sim = make_sim(scene, &opt);
  (void)state;
  while (state_of(sim).t < 10) assert_ok(msim_sim_step(sim, 1, err));
  assert_ok(msim_sim_set_springs(sim, stiff, NULL, NULL, err));
  while (state_of(sim).t < 20) assert_ok(msim_sim_step(sim, 1, err));
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "growth of errors: measured"));
  assert_int_equal(r.n, 0);
  assert_ok(msim_sim_set_springs(sim, NULL, longer, NULL, err));
  while (r.n == 0) assert_ok(msim_sim_step(sim, 1, err));
  assert_ok(msim_sim_set_springs(sim, NULL, longer, NULL, err));
  assert_ok(msim_sim_run(sim, NULL, 0, err));
  assert_int_equal(r.n, 1); /* once a run */
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

static double distance(const msim_scene *scene, const msim_options *a, const msim_options *b) {
  msim_sim *sim[2] = {make_sim(scene, a), make_sim(scene, b)};
  msim_state s[2];
  double largest = 0;
  for (int i = 0; i < 2; i++) {
    assert_ok(msim_sim_run(sim[i], NULL, 0, err));
    s[i] = state_of(sim[i]);
  }
  for (int i = 0; i < 3 * s[0].n; i++) largest = fmax(largest, fabs(s[0].x[i] - s[1].x[i]));
  for (int i = 0; i < 2; i++) msim_sim_destroy(sim[i]);
  return largest;
}

/* The error is far above tol, though each step keeps it. */
static void chaos_is_reported_once(void **state) {
  static const char *const methods[] = {"dop853", "auto"};
  msim_scene *scene = folded_rope(16);
  (void)state;
  for (int i = 0; i < 2; i++) {
    reports r, none;
    const msim_options exact = options_to("dop853", 1e-12, 0.5, &none);
    const msim_options opt = options_to(methods[i], 1e-6, 0.5, &r);
    assert_true(distance(scene, &opt, &exact) > 10 * opt.tol);
    assert_int_equal(r.n, 1);
  }
  msim_scene_destroy(scene);
}

/* With watch = off nothing is measured; the measurement changes no bit of the run. */
static void the_measurement_changes_no_bit(void **state) {
  msim_scene *scene = folded_rope(16);
  reports r, none;
  const msim_options opt = options_to("auto", 1e-6, 0.5, &r);
  msim_options off = options_to("auto", 1e-6, 0.5, &none);
  (void)state;
  off.watch = MSIM_WATCH_OFF;
  assert_true(distance(scene, &opt, &off) == 0);
  assert_int_equal(r.n, 1);
  assert_int_equal(none.n, 0);
  msim_scene_destroy(scene);
}

static void resumed_runs_measure_the_same(void **state) {
  static const char *const methods[] = {"dop853", "auto"};
  const int64_t at[] = {1, 40, 100, 130};
  msim_scene *scene = folded_rope(16);
  (void)state;
  for (int i = 0; i < 2; i++) {
    reports r;
    const msim_options opt = options_to(methods[i], 1e-4, 0.5, &r);
    expect_resumable(scene, &opt, 160, 4, at, methods[i]);
    assert_true(r.n >= 2);
  }
  msim_scene_destroy(scene);
}

/* At the stability limit a measurement with one force evaluation per step would double the cost. */
static void expensive_measurement_is_left_off(void **state) {
  msim_scene *scene = hanging_cloth(5, 1e5, 0);
  reports r;
  const msim_options opt = options_to("velocity-verlet", 0.01, 0.5, &r);
  const char *text;
  (void)state;
  msim_options off = opt;
  off.watch = MSIM_WATCH_OFF;
  msim_sim *sim = make_sim(scene, &opt), *without = make_sim(scene, &off);
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "growth of errors: measured"));
  assert_ok(msim_sim_run(sim, NULL, 0, err));
  assert_ok(msim_sim_run(without, NULL, 0, err));
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "growth of errors: not measured"));
  assert_true((double)stats_of(sim).force_evaluations <
              1.12 * (double)stats_of(without).force_evaluations + 40);
  msim_sim_destroy(sim), msim_sim_destroy(without), msim_scene_destroy(scene);
}

/* Impacts of particle 1 with a plane perpendicular to the line do not affect displacements across
 * the line: E grows as it does without the plane. */
static void growth_goes_on_past_impacts(void **state) {
  static const char *const methods[] = {"dop853", "rk4", "auto"};
  const double T = 4, a = 3.1623, expected = log(30 * a * T + 1) / a;
  (void)state;
  for (int i = 0; i < 6; i++) {
    reports r;
    const double rest = i < 3 ? 0.55 : 0.25; /* unstable, stable */
    msim_scene *scene = column(1, rest, 0, 0);
    const msim_options opt = options_to(methods[i % 3], 1e-7, T, &r);
    plane(scene, -0.6, -0.8, 0, -0.505, 1, 0);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, 0, err));
    assert_true(stats_of(sim).contacts > 3);
    if (i >= 3) assert_int_equal(r.n, 0);
    else if (r.n != 1 || !(r.t > expected && r.t < expected + 0.7))
      fail_msg("%s: %d reports, at %g s; 1 expected, at %g s", methods[i], r.n, r.t, expected);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/* A block of 1 kg with edges of 0.2 m just above a rough floor, under oblique gravity. */
static msim_scene *dropped(int32_t side, double k, double damping, double restitution,
                           const double gravity[3]) {
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {side, side, side},
                                .origin = {0, 0, 7e-4},
                                .extent = {0.2, 0.2, 0.2},
                                .mass = 1,
                                .k = k,
                                .damping = damping};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  plane(scene, 0, 0, 1, 0, restitution, 0.3);
  return scene;
}

/* With elastic impacts the motion of many particles is chaotic, in islands of any size. */
static void chaos_by_impacts_is_reported(void **state) {
  static const char *const methods[] = {"dop853", "auto"};
  const double gravity[3] = {-2.65, -4.5, -8.3};
  (void)state;
  for (int i = 0; i < 4; i++) {
    reports r, none;
    msim_scene *scene = dropped(3 + i / 2, 4171, 0, 1, gravity);
    const msim_options exact = options_to("dop853", 1e-12, 0.3, &none);
    const msim_options opt = options_to(methods[i % 2], 1e-6, 0.3, &r);
    assert_true(distance(scene, &opt, &exact) > 10 * 0.2 * opt.tol);
    assert_int_equal(r.n, 1);
    msim_scene_destroy(scene);
  }
}

/* The block lands and comes to rest, particle by particle: the last bounces take no time, and their
 * effect on a disturbance ends with them. */
static void landing_is_not_reported(void **state) {
  const double gravity[3] = {-0.76, -0.94, -9.7};
  (void)state;
  for (int i = 0; i < 4; i++) {
    reports r;
    msim_scene *scene = dropped(4, 8300, i / 2 ? 0.3 : 0, i % 2 ? 0.5 : 0, gravity);
    const msim_options opt = options_to("auto", 1e-6, 0.2, &r);
    run(scene, &opt);
    assert_int_equal(r.n, 0);
    msim_scene_destroy(scene);
  }
}

/* explain says whether growth is measured, under error control and in fixed steps of auto alike. */
static void explain_reports_what_is_not_measured(void **state) {
  (void)state;
  static const struct {
    const char *method;
    int32_t side;
    double tol;
    int watch;
    const char *growth;
  } row[] = {{"dop853", 9, 1e-4, 1, "not measured in parts of more than 128 springs"},
             {"auto", 9, 1e-4, 1, "not measured in parts of more than 128 springs"},
             {"auto", 5, 1e-9, 1, "measured, and reported if it is large"},
             {"auto", 5, 1e-4, 1, "not measured: that would cost more than a fifth"},
             {"auto", 9, 1e-4, 0, NULL},
             {"velocity-verlet", 5, 0, 1, NULL}};
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    msim_scene *scene = hanging_cloth(row[i].side, 1e3, 0);
    reports r;
    msim_options opt = options_to(row[i].method, row[i].tol, 0.5, &r);
    if (row[i].tol == 0) opt.h = 1e-3;
    opt.watch = row[i].watch ? MSIM_WATCH_ON : MSIM_WATCH_OFF;
    msim_sim *sim = make_sim(scene, &opt);
    const char *text;
    assert_ok(msim_sim_explain(sim, &text, err));
    const char *line = strstr(text, "growth of errors: ");
    assert_int_equal(line != NULL, row[i].growth != NULL);
    if (line) assert_memory_equal(line + 18, row[i].growth, strlen(row[i].growth));
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/* Measurement starts anew from a state that is set, and, if it had been left off, at the first
 * contact, as in an island this large. */
static void measurement_starts_anew(void **state) {
  const double gravity[3] = {-2.65, -4.5, -8.3};
  msim_scene *scene = dropped(5, 4171, 0, 1, gravity);
  reports r;
  const msim_options opt = options_to("dop853", 1e-4, 0.5, &r);
  const char *text;
  (void)state;
  msim_sim *sim = make_sim(scene, &opt);
  double x[3 * 125], v[3 * 125];
  msim_state start = state_of(sim);
  memcpy(x, start.x, sizeof x), memcpy(v, start.v, sizeof v);
  start.x = x, start.v = v;
  for (int i = 0; i < 2; i++) {
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_non_null(strstr(text, "growth of errors: not measured"));
    const int64_t before = stats_of(sim).contacts;
    while (stats_of(sim).contacts == before) assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_non_null(strstr(text, "growth of errors: measured"));
    while (r.n == i && state_of(sim).t < 0.5) assert_ok(msim_sim_step(sim, 1, err));
    assert_int_equal(r.n, i + 1);
    assert_ok(msim_sim_set_state(sim, &start, err));
  }
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* All components of this row are `value`, all other rows 0. */
static void fill(ms_shape shape, int32_t row, double value, double *x) {
  ms_vector_clear_all(shape, x);
  for (int32_t c = 0; c < shape.dims; c++) x[c * shape.stride + row] = value;
}

/* A checkpoint with a correct hash may hold any such numbers of the measurement, and counts that
 * let it cost more. The run goes on, without endless strides, and what it saves can be loaded. */
static void forged_measurements_can_be_saved(void **state) {
  static const double values[] = {0, 1e-300, 1e-150, 1, MS_LARGEST_VALID, 1e200, 1e300, INFINITY};
  const double gravity[3] = {-2.65, -4.5, -8.3};
  enum { NVALUES = 8, NVECTORS = 5 }; /* valid in vectors */
  msim_scene *scene = dropped(2, 4171, 0, 1, gravity);
  reports r;
  const msim_options opt = options_to("rk4", 1e-4, 0.5, &r);
  msim_sim *landed = make_sim(scene, &opt), *before = make_sim(scene, &opt);
  (void)state;
  while (stats_of(landed).contacts == 0) assert_ok(msim_sim_step(landed, 1, err));
  assert_ok(msim_sim_step(before, state_of(landed).step - 2, err));
  for (int i = 0; i < NVALUES * NVALUES * NVECTORS * NVECTORS; i++) {
    msim_sim *sim;
    assert_ok(msim_sim_clone(before, &sim, err));
    ms_disturbance *d = &sim->islands[0].disturbance;
    const ms_shape shape = sim->islands[0].model.shape;
    d->stride = values[i % NVALUES], d->time = values[i / NVALUES % NVALUES];
    fill(shape, i % 7, values[i / NVALUES / NVALUES % NVECTORS], d->dx);
    fill(shape, i % 7, values[i / NVALUES / NVALUES % NVECTORS], d->dv);
    fill(shape, i % 5, values[i / NVALUES / NVALUES / NVECTORS], d->a);
    if (i % 3 == 0) d->error = 0;
    if (i % 5 == 0) sim->stats.force_evaluations = INT64_MAX / 4;
    sim->error_growth.has_contact = 1;
    const checkpoint forged = save(sim);
    msim_sim *forged_sim = resume(scene, &opt, &forged);
    assert_ok(msim_sim_step(forged_sim, 5, err));
    const checkpoint later = save(forged_sim);
    msim_sim_destroy(resume(scene, &opt, &later));
    free(forged.bytes), free(later.bytes);
    msim_sim_destroy(forged_sim), msim_sim_destroy(sim);
  }
  msim_sim_destroy(landed), msim_sim_destroy(before), msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(growth_is_that_of_the_unstable_mode),
                                     cmocka_unit_test(regular_motion_is_not_reported),
                                     cmocka_unit_test(new_springs_start_the_measurement_anew),
                                     cmocka_unit_test(chaos_is_reported_once),
                                     cmocka_unit_test(the_measurement_changes_no_bit),
                                     cmocka_unit_test(resumed_runs_measure_the_same),
                                     cmocka_unit_test(expensive_measurement_is_left_off),
                                     cmocka_unit_test(growth_goes_on_past_impacts),
                                     cmocka_unit_test(chaos_by_impacts_is_reported),
                                     cmocka_unit_test(landing_is_not_reported),
                                     cmocka_unit_test(explain_reports_what_is_not_measured),
                                     cmocka_unit_test(measurement_starts_anew),
                                     cmocka_unit_test(forged_measurements_can_be_saved)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
