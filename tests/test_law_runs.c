/* Tests of runs with laws of springs: closed solutions, orders, energy, restarts, threads, and what
 * does not change where no spring has a law. */
#include "laws.h"

#include "checkpoints.h"

#define PI 3.141592653589793

/*------------------------------------- closed solutions -----------------------------------------*/

/* A pinned and a free particle of mass 1 on the x axis, and a spring of length 1 with `law` */
static msim_scene *oscillator(const msim_law *law, double k, double stretch) {
  const double x[6] = {0, 0, 0, 1 + stretch, 0, 0}, mass[2] = {1, 1}, rest = 1;
  msim_scene *scene;
  int32_t index;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, (int32_t[]){0, 1}, &k, &rest, NULL, err));
  assert_ok(msim_scene_add_law(scene, law, &index, err));
  assert_ok(msim_scene_set_law(scene, 1, &(int32_t){0}, index, err));
  assert_ok(msim_scene_pin(scene, 1, &(int32_t){0}, err));
  return scene;
}

static void run_for(const msim_scene *scene, double time, double *x, double *v) {
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-12, opt.steps = -1, opt.t_end = time;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  *x = state_of(sim).x[3], *v = state_of(sim).v[3];
  msim_sim_destroy(sim);
}

/* The complete elliptic integral K(m), by the arithmetic-geometric mean */
static double elliptic_k(double m) {
  double a = 1, b = sqrt(1 - m);
  for (int i = 0; i < 8; i++) {
    const double mean = (a + b) / 2;
    b = sqrt(a * b), a = mean;
  }
  return PI / (2 * a);
}

/* x'' = -k (e + c e^3) has the period 4 K(m)/w, w^2 = k (1 + c A^2), m = k c A^2/(2 w^2). */
static void duffing_has_its_period(void **state) {
  (void)state;
  for (int soft = 0; soft < 2; soft++) {
    const double k = 7, A = 0.4, c[3] = {1, 0, soft ? -2 : 15};
    const msim_law law = {
        .size = sizeof law, .kind = MSIM_LAW_POLYNOMIAL, .n = 3, .coefficients = c, .limit = 0.5};
    const double w2 = k * (1 + c[2] * A * A), m = k * c[2] * A * A / (2 * w2);
    msim_scene *scene = oscillator(&law, k, A);
    double x, v;
    run_for(scene, 4 * elliptic_k(m) / sqrt(w2), &x, &v);
    assert_close(x, 1 + A, 1e-10);
    assert_close(v, 0, 1e-9);
    msim_scene_destroy(scene);
  }
}

/* Half a period of the spring, then free flight; the dead band: two half periods and two flights */
static void one_sided_springs_let_go(void **state) {
  (void)state;
  const double k = 4, w = 2, A = 0.3;
  const msim_law tension = {.size = sizeof tension, .kind = MSIM_LAW_TENSION};
  const msim_law band = {.size = sizeof band, .kind = MSIM_LAW_DEAD_BAND, .half_width = 0.1};
  double x, v;
  msim_scene *scene = oscillator(&tension, k, A);
  run_for(scene, PI / 2 / w + 0.5, &x, &v);
  assert_close(x, 1 - A * w * 0.5, 1e-9);
  assert_close(v, -A * w, 1e-9);
  msim_scene_destroy(scene);
  scene = oscillator(&band, k, 0.1 + A);
  run_for(scene, 2 * PI / w + 2 * 0.2 / (A * w), &x, &v);
  assert_close(x, 1.1 + A, 1e-9);
  assert_close(v, 0, 1e-8);
  msim_scene_destroy(scene);
}

/*------------------------------------- the same bits --------------------------------------------*/

static const char *const methods[] = {"velocity-verlet",
                                      "verlet",
                                      "symplectic-euler",
                                      "rk4",
                                      "dop853",
                                      "rkn6",
                                      "heun",
                                      "respa",
                                      "rkc",
                                      "implicit-euler",
                                      "trapezoidal",
                                      "bdf2",
                                      "sdirk2",
                                      "linearly-implicit-euler",
                                      "force-gradient",
                                      "takahashi-imada"};
enum { METHODS = sizeof methods / sizeof *methods };

static msim_options method_options(const char *method, int threads) {
  msim_options opt = options(method, 1e-3);
  opt.threads = threads;
  opt.indefinite = MSIM_INDEFINITE_CLAMP;
  return opt;
}

static double damping_for(const char *method) { return takes_positions_only(method) ? 0 : 0.02; }

static void states_are_equal(msim_sim *a, msim_sim *b, const char *label) {
  const msim_state s = state_of(a), t = state_of(b);
  const size_t size = 3 * (size_t)s.n * sizeof *s.x;
  if (memcmp(s.x, t.x, size) || memcmp(s.v, t.v, size)) fail_msg("%s: the states differ", label);
}

static void runs_resume_bit_for_bit(void **state) {
  (void)state;
  for (int i = 0; i < METHODS; i++) {
    msim_scene *scene = law_net(30, 140, 0, damping_for(methods[i]), 31);
    const msim_options opt = method_options(methods[i], 1);
    expect_resumable(scene, &opt, 20, 2, (const int64_t[]){7, 13}, methods[i]);
    msim_scene_destroy(scene);
  }
}

static void threads_do_not_change_bits(void **state) {
  (void)state;
  msim_scene *scene = law_net(3000, 20000, 0, 0, 5);
  for (int i = 0; i < METHODS; i += 3) {
    msim_options opt = method_options(methods[i], 1);
    msim_sim *one = make_sim(scene, &opt);
    opt.threads = 2;
    msim_sim *two = make_sim(scene, &opt);
    assert_ok(msim_sim_step(one, 3, err));
    assert_ok(msim_sim_step(two, 3, err));
    states_are_equal(one, two, methods[i]);
    msim_sim_destroy(one), msim_sim_destroy(two);
  }
  msim_scene_destroy(scene);
}

/* A copy of the scene with other springs, in this state */
static msim_scene *scene_like(const msim_scene *from, const msim_state *at, double k_factor) {
  msim_scene_view w = {.size = sizeof w};
  msim_scene *scene;
  assert_ok(msim_scene_get(from, &w));
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, w.nparticles, at->x, at->v, w.mass, err));
  assert_ok(msim_scene_pin(scene, 1, &(int32_t){0}, err));
  add_laws(scene);
  for (int32_t e = 0; e < w.nsprings; e++) {
    const double k = k_factor * w.k[e], rest = 1.1 * w.rest[e];
    assert_ok(msim_scene_add_springs(scene, 1, w.ij + 2 * e, &k, &rest, w.damping + e, err));
    assert_ok(msim_scene_set_law(scene, 1, &e, w.law[e], err));
  }
  return scene;
}

static void new_springs_are_those_of_a_fresh_sim(void **state) {
  (void)state;
  enum { SPRINGS = 140 };
  msim_scene *scene = law_net(30, SPRINGS, 0, 0, 31);
  msim_scene_view w = {.size = sizeof w};
  double k[SPRINGS], rest[SPRINGS];
  assert_ok(msim_scene_get(scene, &w));
  for (int e = 0; e < SPRINGS; e++) k[e] = 1.7 * w.k[e], rest[e] = 1.1 * w.rest[e];
  for (int i = 0; i < METHODS; i++) {
    if (strcmp(methods[i], "verlet") == 0 || strcmp(methods[i], "bdf2") == 0)
      continue; /* they carry the step before */
    const msim_options opt = method_options(methods[i], 1);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 10, err));
    assert_ok(msim_sim_set_springs(sim, k, rest, NULL, err));
    const msim_state at = state_of(sim);
    msim_scene *fresh = scene_like(scene, &at, 1.7);
    msim_sim *other = make_sim(fresh, &opt);
    if (strcmp(methods[i], "dop853") == 0) assert_ok(msim_sim_set_state(sim, &at, err));
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(other, 1, err));
    states_are_equal(sim, other, methods[i]);
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(fresh);
  }
  msim_scene_destroy(scene);
}

/* A law that is given and taken back leaves the bits as they were. */
static void linear_again_is_as_never_changed(void **state) {
  (void)state;
  msim_scene *plain = hanging_cloth(12, 300, 0), *scene = hanging_cloth(12, 300, 0);
  const msim_law law = {.size = sizeof law, .kind = MSIM_LAW_TENSION};
  const int32_t springs[] = {3, 100, 7};
  int32_t index;
  assert_ok(msim_scene_add_law(scene, &law, &index, err));
  assert_ok(msim_scene_set_law(scene, 3, springs, index, err));
  assert_ok(msim_scene_set_law(scene, 3, springs, 0, err));
  for (int i = 0; i < METHODS; i++) {
    const msim_options opt = method_options(methods[i], 1);
    msim_sim *a = make_sim(plain, &opt), *b = make_sim(scene, &opt);
    assert_ok(msim_sim_step(a, 5, err));
    assert_ok(msim_sim_step(b, 5, err));
    states_are_equal(a, b, methods[i]);
    msim_sim_destroy(a), msim_sim_destroy(b);
  }
  msim_scene_destroy(plain), msim_scene_destroy(scene);
}

/*------------------------------------- energy ---------------------------------------------------*/

static double total_energy(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_ok(msim_sim_energy(sim, &e));
  return e.total;
}

static void energy_is_conserved(void **state) {
  (void)state;
  msim_scene *scene = law_net(20, 90, 0, 0, 31);
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-11, opt.steps = -1, opt.t_end = 1;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = total_energy(sim);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_close(total_energy(sim), start, 1e-8 * start);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A force that pushes away from rest: the energy falls below that at the start, legally, and the
 * monitor lets the run go on; beyond its bound in other scenes it does not. */
static void falling_energy_is_no_fault(void **state) {
  (void)state;
  const double stretch[] = {-1, 0, 1, 2}, force[] = {2, 0, -2, 0};
  const msim_law law = {
      .size = sizeof law, .kind = MSIM_LAW_TABLE, .n = 4, .stretch = stretch, .force = force};
  msim_scene *scene = oscillator(&law, 1, 1e-6);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10000, err));
  msim_energy e = {.size = sizeof e};
  assert_ok(msim_sim_energy(sim, &e));
  assert_true(e.elastic < -0.1);
  assert_close(e.total, 0, 1e-5);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The largest slope bounds frequencies: Verlet is stable below 2/w and not above. */
static void the_step_limit_knows_the_slope(void **state) {
  (void)state;
  const double stretch[] = {-1, 0, 1}, force[] = {-400, 0, 400};
  const msim_law law = {
      .size = sizeof law, .kind = MSIM_LAW_TABLE, .n = 3, .stretch = stretch, .force = force};
  msim_scene *scene = oscillator(&law, 1, 0.1);
  msim_options opt = options("velocity-verlet", MSIM_H_AUTO);
  opt.steps = -1, opt.t_end = 1;
  msim_sim *sim = make_sim(scene, &opt);
  const double h = state_of(sim).h;
  assert_true(h < 2 / 20. && h > 0.5 * 2 / 20.);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(duffing_has_its_period),
      cmocka_unit_test(one_sided_springs_let_go),
      cmocka_unit_test(runs_resume_bit_for_bit),
      cmocka_unit_test(threads_do_not_change_bits),
      cmocka_unit_test(new_springs_are_those_of_a_fresh_sim),
      cmocka_unit_test(linear_again_is_as_never_changed),
      cmocka_unit_test(energy_is_conserved),
      cmocka_unit_test(falling_energy_is_no_fault),
      cmocka_unit_test(the_step_limit_knows_the_slope),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
