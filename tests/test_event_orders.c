/* Tests of the order of accuracy with collision = event, through impacts, release and friction. */
#include "event_options.h"

enum { MANY = 12 };

/* A particle on a spring of rest length 0, whose pin is behind a plane that it hits repeatedly: x =
 * A cos(w t + p) between impacts. */
static void oscillator(double t, double z0, double e, double *z, double *vz, int *hits) {
  /* the plane is at z = 0, the pin at z = -1, w = 1: z = -1 + a cos(t - phase), at rest in z0
   * initially */
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

/* The error of an impact depends on its position in the step: the mean over several numbers of
 * steps from `steps` on. */
static double error_through_impacts(const msim_scene *scene, const char *method, int steps) {
  enum { TIMES = 5 };
  const double T = 8;
  double z, vz, sum = 0;
  int hits;
  oscillator(T, 1.5, 0.9, &z, &vz, &hits);
  assert_int_equal(hits, 4);
  for (int k = 0; k < TIMES; k++) {
    const int n = steps + steps * k * 7 / 50;
    msim_options opt = event_options(method, T / n);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, n, err));
    assert_int_equal(stats_of(sim).contacts, hits);
    const msim_state s = state_of(sim);
    sum += hypot(s.x[5] - z, s.v[5] - vz);
    msim_sim_destroy(sim);
  }
  return sum / TIMES;
}

static void order_is_kept_through_impacts(void **state) {
  (void)state;
  msim_scene *scene = spring_on_plane(0.9);
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++) {
    if (!entry->order || refuses_events(entry->name)) continue;
    const int long_steps = entry->order > 4 || takes_positions_only(entry->name);
    const int steps = long_steps ? 10 : entry->order > 2 ? 240 : 300;
    const double coarse = error_through_impacts(scene, entry->name, steps);
    const double fine = error_through_impacts(scene, entry->name, 4 * steps);
    const double order = log2(coarse / fine) / 2;
    print_message("  %-24s %.3g %.3g  order %.2f\n", entry->name, coarse, fine, order);
    /* with long steps a large part of them is shortened by impacts */
    assert_true(order >= (entry->order > 6 ? 6.5 : entry->order > 4 ? 5.5 : entry->order - 0.1));
  }
  msim_scene_destroy(scene);
}

/* Error of a run against the exact state x, v of one component, by the method's own order */
typedef void truth(double t, double *x, double *v);

static double error_at(const msim_scene *scene, const char *method, double T, int steps, int at,
                       truth *exactly) {
  double x, v;
  msim_options opt = event_options(method, T / steps);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  exactly(T, &x, &v);
  const msim_state s = state_of(sim);
  const double off = hypot(s.x[at] - x, s.v[at] - v);
  msim_sim_destroy(sim);
  return off;
}

static void check_order(const msim_scene *scene, double T, int at, truth *exactly) {
  static const struct {
    const char *method;
    int steps;
    double order;
  } row[] = {{"heun", 1200, 1.9},       {"velocity-verlet", 600, 1.9},
             {"rk4", 60, 3.8},          {"implicit-midpoint", 300, 1.8},
             {"trapezoidal", 300, 1.8}, {"newmark", 300, 1.8},
             {"tr-bdf2", 300, 1.8}};
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    const double coarse = error_at(scene, row[i].method, T, row[i].steps, at, exactly);
    const double fine = error_at(scene, row[i].method, T, 4 * row[i].steps, at, exactly);
    const double order = log2(coarse / fine) / 2;
    print_message("  %-24s %.3g %.3g  order %.2f\n", row[i].method, coarse, fine, order);
    assert_true(order >= row[i].order);
  }
}

/* One mass lies on the floor, the other oscillates above it on a spring, which finally lifts the
 * first: k = 100, m = 1 each, g = 10, L = 1, initially compressed by 0.3. */
static void lifted(double t, double *z, double *vz) {
  const double g = 10, off = acos(-2. / 3) / 10, up = 3 * sin(10 * off) / 2, w = sqrt(200);
  const double d = t - off, c = cos(w * d), s = sin(w * d);
  *z = 0, *vz = 0;
  if (d < 0) return;
  /* half the stretch of the spring: initially 0.05, growing by `up` */
  *z = 0.05 + up * d - g * d * d / 2 - (0.05 * c + up / w * s);
  *vz = up - g * d - (-0.05 * w * s + up * c);
}

static void release_is_located(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 0, 0, 1 - 0.1 - 0.3}, v[6] = {0}, mass[2] = {1, 1};
  const double k = 100, rest = 1, none = 0, g[3] = {0, 0, -10};
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &none, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0.3);
  check_order(scene, 0.35, 2, lifted);
  msim_scene_destroy(scene);
}

/* A mass on a spring slides on the floor, mu g = 0.1, k = m = 1, L = 0: each half oscillation is
 * about +-0.1 and 0.2 shorter than the one before, until friction holds the mass. */
static void rubbed(double t, double *x, double *v) {
  const double pi = acos(-1);
  const int swing = (int)fmin(5, floor(t / pi)), sign = swing % 2 ? -1 : 1;
  const double from = 1.05 - 0.2 * swing;
  *x = sign * (0.1 + (from - 0.1) * cos(t - pi * swing));
  *v = -sign * (from - 0.1) * sin(t - pi * swing);
  if (swing == 5) *x = -0.05, *v = 0;
}

static void a_sliding_mass_turns_and_sticks(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 1.05, 0, 0}, v[6] = {0}, mass[2] = {1, 1};
  const double k = 1, rest = 0, none = 0, g[3] = {0, 0, -1};
  const int32_t ij[2] = {0, 1}, pin = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &none, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0.1);
  check_order(scene, 12, 3, rubbed);
  for (int32_t m = 0; event_method_at(m); m++) {
    msim_options opt = event_options(event_method_at(m), 0.02);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 2000, err));
    assert_true(state_of(sim).v[3] == 0);
    assert_true(stats_of(sim).steps_at_rest > 500);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

static msim_scene *many_oscillators(void) {
  const double k[MANY] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1}, none[MANY] = {0};
  double x[6 * MANY] = {0}, mass[2 * MANY];
  int32_t ij[2 * MANY], pin[MANY];
  for (int i = 0; i < MANY; i++) {
    x[6 * i] = x[6 * i + 3] = i, x[6 * i + 2] = -1, x[6 * i + 5] = 1.5 + 1e-4 * i;
    mass[2 * i] = mass[2 * i + 1] = 1;
    ij[2 * i] = 2 * i, ij[2 * i + 1] = 2 * i + 1, pin[i] = 2 * i;
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2 * MANY, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, MANY, ij, k, none, none, err));
  assert_ok(msim_scene_pin(scene, MANY, pin, err));
  plane(scene, 0, 0, 1, 0, 0.9, 0);
  return scene;
}

/* Mean over all oscillators and several numbers of steps from `steps` on. */
static double error_of_many(const msim_scene *scene, const char *method, int steps) {
  enum { TIMES = 5 };
  const double T = 8;
  double sum = 0;
  for (int k = 0; k < TIMES; k++) {
    const int n = steps + steps * k * 7 / 50;
    msim_options opt = event_options(method, T / n);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, n, err));
    const msim_state s = state_of(sim);
    for (int i = 0; i < MANY; i++) {
      double z, vz;
      int hits;
      oscillator(T, 1.5 + 1e-4 * i, 0.9, &z, &vz, &hits);
      sum += hypot(s.x[6 * i + 5] - z, s.v[6 * i + 5] - vz);
    }
    assert_int_equal(stats_of(sim).contacts, 4 * MANY);
    msim_sim_destroy(sim);
  }
  return sum / MANY / TIMES;
}

/* A dozen oscillators hit the plane in the same steps, repeatedly: about second order */
static void many_oscillators_keep_second_order(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "rk4", "heun", "implicit-midpoint"};
  msim_scene *scene = many_oscillators();
  for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
    const double coarse = error_of_many(scene, methods[m], 100);
    const double fine = error_of_many(scene, methods[m], 1600), order = log2(coarse / fine) / 4;
    print_message("  %-24s %.3g %.3g  order %.2f\n", methods[m], coarse, fine, order);
    assert_true(order >= 1.75);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- error control --------------------------------------------*/

/* Sixteen particles of a block land within 1e-10 s of each other, so that some are nearly near
 * enough to touch the floor where a step begins, and in its middle are: they must not bounce
 * there, as steps of any length then differ from two half steps. */
static void particles_land_within_rounding_of_each_other(void **state) {
  (void)state;
  enum { TOLERANCES = 16 };
  static const char *const methods[] = {"velocity-verlet", "rk4"};
  msim_scene *scene = bouncing_block();
  for (int m = 0; m < 2; m++)
    for (int i = 0; i < TOLERANCES; i++) {
      msim_options opt = options(methods[m], 1e-3);
      opt.tol = 3e-4 * pow(10, -i / 8.), opt.steps = -1, opt.t_end = 0.1;
      msim_sim *sim = make_sim(scene, &opt);
      msim_error why;
      if (msim_sim_run(sim, NULL, NULL, &why)) fail_msg("%s: %s", methods[m], why.text);
      assert_true(stats_of(sim).contacts >= 16);
      msim_sim_destroy(sim);
    }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(order_is_kept_through_impacts), cmocka_unit_test(release_is_located),
      cmocka_unit_test(a_sliding_mass_turns_and_sticks),
      cmocka_unit_test(many_oscillators_keep_second_order),
      cmocka_unit_test(particles_land_within_rounding_of_each_other)};
  return cmocka_run_group_tests_name("event_orders", tests, NULL, NULL);
}
