/* Tests of msim_sim_equilibrium: hanging chains against the exact discrete catenary, random nets
 * whose forces must balance, a column that buckles, a square of angles that folds, bodies that
 * float or fall, contact with a floor, every method and solver, refusals and failing allocations.
 */
#include <math.h>

#include "limited_allocator.h"
#include "scenes.h"

static msim_equilibrium settle(msim_sim *sim, double force) {
  msim_equilibrium e = {.size = sizeof e};
  assert_ok(msim_sim_equilibrium(sim, force, 5000, &e, err));
  assert_true(e.force <= force);
  return e;
}

/* The largest force on a free particle, at rest in the present state. */
static double largest_force(const msim_scene *scene, msim_sim *sim) {
  msim_scene_view view = {.size = sizeof view};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  const msim_state s = state_of(sim);
  double *f = calloc(3 * (size_t)s.n, sizeof *f), largest = 0;
  msim_sim_force(sim, s.x, s.v, f);
  for (int32_t p = 0; p < s.n; p++) {
    for (int c = 0; c < 3; c++) assert_true(s.v[3 * p + c] == 0);
    if (!view.pinned[p])
      largest = fmax(largest, sqrt(f[3 * p] * f[3 * p] + f[3 * p + 1] * f[3 * p + 1] +
                                   f[3 * p + 2] * f[3 * p + 2]));
  }
  free(f);
  return largest;
}

/*------------------------------------- catenary -------------------------------------------------*/

/* A chain of n springs from (0, 0, 0) to (span, 0, rise). With H the horizontal force and V_i =
 * V_0 + i m g the vertical one, spring i has the tension T_i = |(H, V_i)| and the vector
 * (rest + T_i/k) (H, V_i)/T_i. */
typedef struct chain {
  int n;
  double k, rest, weight, span, rise;
} chain;

static void sum_chain(const chain *c, double h, double v0, int n, double end[2]) {
  end[0] = end[1] = 0;
  for (int i = 0; i < n; i++) {
    const double v = v0 + i * c->weight, tension = hypot(h, v);
    end[0] += (c->rest / tension + 1 / c->k) * h;
    end[1] += (c->rest / tension + 1 / c->k) * v;
  }
}

/* H and V_0 by bisection: the rise grows with V_0, the span with H. */
static void solve_chain(const chain *c, double *h, double *v0) {
  const double most = 1e4 * c->weight * c->n;
  double end[2], low = 0, high = most;
  for (int i = 0; i < 200; i++) {
    double down = -most, up = most;
    *h = (low + high) / 2;
    for (int k = 0; k < 200; k++) {
      *v0 = (down + up) / 2;
      sum_chain(c, *h, *v0, c->n, end);
      *(end[1] < c->rise ? &down : &up) = *v0;
    }
    *(end[0] < c->span ? &low : &high) = *h;
  }
}

static void chains_hang_in_a_catenary(void **state) {
  (void)state;
  const chain chains[] = {{40, 1e5, 0.03, 0.02 * 9.81, 1, 0},
                          {41, 2e3, 0.02, 0.05 * 9.81, 0.9, 0.3},
                          {7, 50, 0.2, 0.1 * 9.81, 0.5, -0.8}};
  for (int i = 0; i < 3; i++) {
    const chain *c = &chains[i];
    const double g[3] = {0, 0, -9.81}, mass = c->weight / 9.81;
    const int32_t ends[2] = {0, c->n};
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    for (int32_t p = 0; p <= c->n; p++) { /* on a line that is bent upwards */
      const double s = (double)p / c->n;
      const double x[3] = {s * c->span, 0, s * c->rise + 0.1 * s * (1 - s)};
      const int32_t ij[2] = {p - 1, p};
      assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
      if (p) assert_ok(msim_scene_add_springs(scene, 1, ij, &c->k, &c->rest, NULL, err));
    }
    assert_ok(msim_scene_pin(scene, 2, ends, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    const msim_options opt = options("velocity-verlet", 1e-4);
    msim_sim *sim = make_sim(scene, &opt);
    assert_int_equal(settle(sim, 1e-10 * c->weight).is_minimum, 1);
    double h, v0;
    solve_chain(c, &h, &v0);
    for (int32_t p = 1; p < c->n; p++) {
      double wanted[2];
      sum_chain(c, h, v0, p, wanted);
      assert_close(state_of(sim).x[3 * p], wanted[0], 1e-8 * c->span);
      assert_close(state_of(sim).x[3 * p + 2], wanted[1], 1e-8 * c->span);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- random nets ----------------------------------------------*/

/* n particles in a cube, the first three pinned, each connected to some of those before it by
 * springs that are shorter, longer or of no length at rest; some of one law. */
static msim_scene *random_net(unsigned *seed, int32_t n, int32_t kind) {
  const double g[3] = {0, 0, -9.81};
  const int32_t pins[3] = {0, 1, 2};
  const msim_law tension = {.size = sizeof tension, .kind = kind};
  msim_scene *scene;
  int32_t nsprings = 0;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  for (int32_t p = 0; p < n; p++) {
    const double x[3] = {uniform(seed), uniform(seed), uniform(seed)}, mass = 0.1 + uniform(seed);
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
    for (int32_t i = 0; i < 4 && p >= 3; i++, nsprings++) {
      const int32_t ij[2] = {(int32_t)(uniform(seed) * p), p};
      const double k = 100 + 1000 * uniform(seed), rest = uniform(seed) < 0.2 ? 0 : uniform(seed),
                   damping = uniform(seed);
      assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, err));
    }
  }
  if (kind) {
    int32_t law;
    assert_ok(msim_scene_add_law(scene, &tension, &law, err));
    for (int32_t e = 0; e < nsprings; e++)
      if (uniform(seed) < 0.5) assert_ok(msim_scene_set_law(scene, 1, &e, law, err));
  }
  assert_ok(msim_scene_set_drag(scene, 0.3, err));
  assert_ok(msim_scene_pin(scene, 3, pins, err));
  return scene;
}

static void nets_are_in_balance(void **state) {
  (void)state;
  unsigned seed = 7;
  const char *const solvers[] = {"auto", "pcg", "cholmod"};
  for (int i = 0; i < 60; i++) {
    msim_scene *scene = random_net(&seed, 6 + i, i % 2 ? MSIM_LAW_TENSION : 0);
    msim_options opt = options(i % 4 < 2 ? "rk4" : "implicit-midpoint", 1e-4);
    opt.solver = solvers[i % 3];
    opt.threads = 1 + i % 2;
    if (!is_solver_available(opt.solver) && i % 3 == 2) opt.solver = "auto";
    msim_sim *sim = make_sim(scene, &opt);
    const double force = 1e-8 * 9.81;
    const msim_equilibrium e = settle(sim, force);
    assert_true(e.is_minimum && e.iterations > 0);
    assert_true(largest_force(scene, sim) <= 1.01 * force);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- minima ---------------------------------------------------*/

/* A strut of two springs, compressed exactly along its axis, is in equilibrium when it is straight,
 * but buckles: both springs reach their rest length. */
static void a_strut_buckles(void **state) {
  (void)state;
  msim_scene *scene = compressed_strut(1);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_equilibrium e = settle(sim, 1e-8);
  const double *at = state_of(sim).x + 3;
  assert_int_equal(e.saddles, 1);
  assert_int_equal(e.is_minimum, 1);
  assert_close(at[0], 1, 1e-9);
  assert_close(hypot(at[1], at[2]), 0.75, 1e-9);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Four angles of 80 degrees at rest, without springs: their sum is 360 degrees in a plane, where
 * the square is in equilibrium, and less out of it. */
static void a_square_of_angles_folds(void **state) {
  (void)state;
  const double x[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, mass[4] = {1, 1, 1, 1},
               k[4] = {5, 5, 5, 5}, angle = 4 * atan(1) * 80 / 180;
  const double rest[4] = {angle, angle, angle, angle};
  const int32_t ijk[12] = {0, 1, 2, 1, 2, 3, 2, 3, 0, 3, 0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 4, x, NULL, mass, err));
  assert_ok(msim_scene_add_angles(scene, 4, ijk, k, rest, NULL, err));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_equilibrium e = settle(sim, 1e-9);
  assert_int_equal(e.saddles, 1);
  assert_int_equal(e.is_minimum, 1);
  const double *at = state_of(sim).x;
  for (int a = 0; a < 4; a++) {
    double p[3], q[3];
    for (int c = 0; c < 3; c++) {
      p[c] = at[3 * ijk[3 * a] + c] - at[3 * ijk[3 * a + 1] + c];
      q[c] = at[3 * ijk[3 * a + 2] + c] - at[3 * ijk[3 * a + 1] + c];
    }
    const double cosine =
        (p[0] * q[0] + p[1] * q[1] + p[2] * q[2]) /
        sqrt((p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]));
    assert_close(acos(cosine), angle, 1e-8);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- floating bodies ------------------------------------------*/

static msim_scene *floating_springs(double gravity) {
  const double x[12] = {0, 0, 0, 1.5, 0, 0, 0, 5, 0, 0, 5.5, 0}, mass[4] = {1, 2, 1, 1},
               k[2] = {10, 1000}, rest[2] = {1, 1}, g[3] = {0, 0, -gravity};
  const int32_t ij[4] = {0, 1, 2, 3};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 4, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, rest, NULL, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* Without gravity the springs relax, and the centers of mass stay. */
static void floating_bodies_relax(void **state) {
  (void)state;
  msim_scene *scene = floating_springs(0);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  settle(sim, 1e-9);
  const double *x = state_of(sim).x;
  assert_close(x[3] - x[0], 1, 1e-9);
  assert_close((x[0] + 2 * x[3]) / 3, 1, 1e-9);
  assert_close(x[10] - x[7], 1, 1e-9);
  assert_close((x[10] + x[7]) / 2, 5.25, 1e-9);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The state stays, and the message names the force and a particle. */
static void falling_bodies_have_no_equilibrium(void **state) {
  (void)state;
  msim_error why;
  msim_scene *scene = floating_springs(10);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_equilibrium(sim, 1e-9, 100, NULL, &why), MSIM_NOT_CONVERGED);
  assert_non_null(strstr(why.text, "a force of 30 N moves the body of particle 0"));
  assert_true(state_of(sim).x[3] == 1.5);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* F = -k (x - a) on each particle: a body that nothing else supports hangs m g/k below a. */
static int32_t attract(void *data, const msim_force_batch *b) {
  (void)data;
  for (size_t i = 0; i < 3 * (size_t)b->n; i++) {
    b->f[i] = -50 * (b->x[i] - 2);
    for (size_t c = 0; c < 3 && b->dfdx; c++) b->dfdx[3 * i + c] = i % 3 == c ? -50 : 0;
  }
  return 0;
}

static void forces_of_the_program_support_bodies(void **state) {
  (void)state;
  msim_error why;
  const double x[3] = {0, 0, 0}, v[3] = {0, 0, 0};
  msim_force_function force = {.size = sizeof force,
                               .flags = MSIM_FORCE_JACOBIAN,
                               .name = "attract",
                               .evaluate = attract,
                               .largest_stiffness = 50};
  msim_scene *scene = make_single_particle(x, v, 10);
  assert_ok(msim_scene_set_force_function(scene, &force, err));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  settle(sim, 1e-9);
  assert_close(state_of(sim).x[0], 2, 1e-10);
  assert_close(state_of(sim).x[2], 2 - 10. / 50, 1e-10);
  msim_sim_destroy(sim);
  force.flags |= MSIM_FORCE_TIME;
  assert_ok(msim_scene_set_force_function(scene, &force, err));
  sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_equilibrium(sim, 1e-9, 100, NULL, &why), MSIM_ERR_UNSUPPORTED);
  assert_non_null(strstr(why.text, "forces that depend on time"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- contact --------------------------------------------------*/

/* A falling pair of particles, one above the other, comes to rest on the floor: the spring between
 * them is shorter by m g/k. Forces are in newtons, whatever the masses. */
static void assert_pair_rests(double scale) {
  const double x[6] = {0, 0, 0.5, 0, 0, 1.5}, mass[2] = {scale, 2 * scale}, k = 500 * scale,
               rest = 1, g[3] = {0, 0, -9.81};
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0.2);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(settle(sim, 1e-7 * scale).is_minimum, 0);
  assert_close(state_of(sim).x[2], 0, 1e-9);
  assert_close(state_of(sim).x[5], 1 - 2 * 9.81 / 500, 1e-8);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void bodies_rest_on_the_floor(void **state) {
  (void)state;
  for (double scale = 1e-6; scale < 1e7; scale *= 1e6) assert_pair_rests(scale);
}

/*------------------------------------- calls ----------------------------------------------------*/

static void the_run_goes_on_from_rest(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(6, 500, 0.1);
  const msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 100, err));
  settle(sim, 1e-11);
  const msim_state rest = state_of(sim);
  assert_close(rest.t, 0.01, 1e-15);
  const double low = rest.x[3 * 35 + 2];
  assert_ok(msim_sim_step(sim, 1000, err));
  assert_close(state_of(sim).x[3 * 35 + 2], low, 1e-9);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void wrong_calls(void **state) {
  (void)state;
  msim_error why;
  msim_equilibrium e = {.size = 0};
  msim_scene *scene = hanging_cloth(4, 500, 0);
  const msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_equilibrium(NULL, 1, 1, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_equilibrium(sim, 0, 10, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_equilibrium(sim, NAN, 10, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_equilibrium(sim, 1e-8, 0, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_equilibrium(sim, 1e-8, 100, &e, &why), MSIM_ERR_SIZE);
  assert_true(state_of(sim).x[5] == 0);
  assert_int_equal(msim_sim_equilibrium(sim, 1e-12, 2, NULL, &why), MSIM_NOT_CONVERGED);
  assert_non_null(strstr(why.text, "in 2 iterations"));
  assert_true(state_of(sim).x[5] == 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static msim_status hang(const msim_allocator *alloc, void *data) {
  (void)data;
  const msim_options opt = options("velocity-verlet", 1e-4);
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, k = 100, g[3] = {0, 0, -9.81};
  const int32_t ij[2] = {0, 1}, pin = 0;
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_status status = msim_scene_create(alloc, &scene, NULL);
  if (!status) status = msim_scene_add_particles(scene, 2, x, NULL, mass, NULL);
  if (!status) status = msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, NULL);
  if (!status) status = msim_scene_pin(scene, 1, &pin, NULL);
  if (!status) status = msim_scene_set_gravity(scene, g, NULL);
  if (!status) status = msim_sim_create(scene, &opt, &sim, NULL);
  if (!status) status = msim_sim_equilibrium(sim, 1e-8, 1000, NULL, NULL);
  if (sim && status) assert_true(state_of(sim).x[5] == 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return status;
}

static void every_allocation_may_fail(void **state) {
  (void)state;
  assert_true(expect_memory_errors(hang, NULL) > 50);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(chains_hang_in_a_catenary),
      cmocka_unit_test(nets_are_in_balance),
      cmocka_unit_test(a_strut_buckles),
      cmocka_unit_test(a_square_of_angles_folds),
      cmocka_unit_test(floating_bodies_relax),
      cmocka_unit_test(falling_bodies_have_no_equilibrium),
      cmocka_unit_test(forces_of_the_program_support_bodies),
      cmocka_unit_test(bodies_rest_on_the_floor),
      cmocka_unit_test(the_run_goes_on_from_rest),
      cmocka_unit_test(wrong_calls),
      cmocka_unit_test(every_allocation_may_fail),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
