/* Tests of random nets of springs with all laws: bodies that land with collision = event, by the
 * balance of momentum and energy and the depth; and `auto` against dop853 with a small tolerance.
 */
#include <math.h>

#include "base/vec3.h"
#include "laws.h"

enum { N = 18, SEEDS = 25 };

/* A lattice of 3 x 3 x 2 particles in motion, each spring with a law of its own */
static msim_scene *random_net(unsigned seed) {
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {3, 3, 2},
                                .origin = {0, 0, 0.05},
                                .extent = {0.4, 0.4, 0.3},
                                .mass = 2,
                                .k = 150};
  msim_scene *body, *scene;
  msim_scene_view s = {.size = sizeof s};
  double v[3 * N];
  assert_ok(msim_scene_create(NULL, &body, err));
  assert_ok(msim_scene_add_lattice(body, &lattice, err));
  assert_int_equal(msim_scene_get(body, &s), MSIM_OK);
  assert_int_equal(s.nparticles, N);
  for (int i = 0; i < 3 * N; i++) v[i] = 0.4 * (uniform(&seed) - 0.5) - 0.5 * (i % 3 == 2);
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, s.x, v, s.mass, err));
  assert_ok(msim_scene_add_springs(scene, s.nsprings, s.ij, s.k, s.rest, NULL, err));
  assert_ok(msim_scene_set_gravity(scene, (double[]){0, 0, -9.81}, err));
  add_laws(scene);
  for (int32_t e = 0; e < s.nsprings; e++) {
    const int32_t law = (int32_t)(uniform(&seed) * (LAW_KINDS + 1));
    assert_ok(msim_scene_set_law(scene, 1, &e, law, err));
  }
  msim_scene_destroy(body);
  return scene;
}

static msim_energy energy_of(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  return e;
}

/* One step: m dv = m g h + the impulses; x stays above the plane. */
static void expect_step(msim_sim *sim, const msim_plane *p, double h, unsigned seed) {
  const msim_energy before = energy_of(sim);
  assert_ok(msim_sim_step(sim, 1, err));
  const msim_energy after = energy_of(sim);
  const msim_contact *all;
  double sum[3] = {0, 0, -2 * 9.81 * h};
  int32_t n;
  assert_int_equal(msim_sim_contacts(sim, &n, &all), MSIM_OK);
  for (int32_t i = 0; i < n; i++) ms_vec3_axpy(1, all[i].impulse, sum);
  for (int c = 0; c < 3; c++) {
    const double off = after.momentum[c] - before.momentum[c] - sum[c];
    if (!(fabs(off) <= 1e-11)) fail_msg("seed %u: %g N s are missing", seed, off);
  }
  for (int i = 0; i < N; i++)
    if (!(ms_vec3_dot(p->normal, state_of(sim).x + 3 * i) >= -1e-10))
      fail_msg("seed %u: particle %d is inside", seed, i);
}

/* Undamped, both methods keep the energy to (h omega)^2/4, omega = 240/s, in elastic impacts, in
 * units of the kinetic energy at the start. */
static void bodies_land(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "trapezoidal"};
  const double h = 5e-4;
  for (unsigned seed = 1; seed <= SEEDS; seed++) {
    msim_scene *scene = random_net(seed);
    const int elastic = seed % 3 == 0;
    const double length = sqrt(1.01);
    const msim_plane floor = {
        {0.1 / length, 0, 1 / length}, 0, elastic ? 1 : 0.5, elastic ? 0 : 0.3};
    assert_ok(msim_scene_add_plane(scene, &floor, err));
    msim_options opt = options(methods[seed % 2], h);
    opt.collision = MSIM_COLLISION_EVENT, opt.contacts = MSIM_CONTACTS_ON;
    opt.newton_rtol = opt.solver_rtol = 1e-13, opt.threads = 1 + (int32_t)(seed % 2);
    msim_sim *sim = make_sim(scene, &opt);
    const msim_energy start = energy_of(sim);
    double most = 0;
    for (int i = 0; i < 400; i++) {
      expect_step(sim, &floor, h, seed);
      const double off = (energy_of(sim).total - start.total) / start.kinetic;
      most = fmax(most, elastic ? fabs(off) : off);
    }
    if (!(most <= (elastic ? 5e-3 : 1e-4))) fail_msg("seed %u: energy is off by %g", seed, most);
    assert_true(stats_of(sim).contacts > 3);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

static double distance(const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < 3 * N; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sqrt(sum / N);
}

static void auto_keeps_the_tolerance(void **state) {
  (void)state;
  const double tol = 1e-5, extent = 0.5;
  for (unsigned seed = 1; seed <= SEEDS; seed++) {
    msim_scene *scene = random_net(seed);
    msim_options opt = options("auto", 1e-3);
    opt.tol = tol, opt.t_end = 0.3, opt.threads = 1 + (int32_t)(seed % 2);
    msim_sim *sim = make_sim(scene, &opt);
    opt.integrator = "dop853", opt.tol = 1e-10;
    msim_sim *exact = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_ok(msim_sim_run(exact, NULL, NULL, err));
    const double off = distance(state_of(sim).x, state_of(exact).x);
    if (!(off <= 3 * tol * extent)) fail_msg("seed %u: off by %g m", seed, off);
    msim_sim_destroy(sim), msim_sim_destroy(exact), msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(bodies_land),
                                     cmocka_unit_test(auto_keeps_the_tolerance)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
