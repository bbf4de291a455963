/* Tests that the bounds by which impacts are located, and stages of rkc counted, follow each change
 * of springs and forces, also in a sim that resumes a run. */
#include "breaking.h"
#include "checkpoints.h"
#include "sim/sim.h"

static void assert_bounds(const msim_sim *sim) {
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    const ms_bounds bounds = ms_bounds_compute_island(&m->model), *used = &m->stepper.bounds;
    assert_true(used->omega == bounds.omega && used->rate == bounds.rate);
    assert_true(used->least_rate == bounds.least_rate);
  }
}

/* A chain of four particles above a plane, whose last spring breaks soon */
static msim_scene *make_chain(void) {
  const double x[12] = {0, 0, 0.1, 1, 0, 0.1, 2, 0, 0.1, 3, 0, 0.1}, v[12] = {[9] = 3};
  const double mass[4] = {1, 1, 1, 1}, k[3] = {100, 200, 300}, rest[3] = {1, 1, 1};
  const double damping[3] = {0.1, 0.2, 0.3}, g[3] = {0, 0, -9.81};
  const int32_t ij[6] = {0, 1, 1, 2, 2, 3}, last = 2;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 4, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 3, ij, k, rest, damping, err));
  assert_ok(msim_scene_set_law(scene, 1, &last, add_linear(scene, 0.02, 0), err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0.1);
  return scene;
}

static msim_options options_of(const char *method, double tol) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.tol = tol, opt.t_end = 20, opt.h = 0.005;
  opt.collision = MSIM_COLLISION_EVENT;
  return opt;
}

/* Makes steps until the last spring has broken, and once more by hand. */
static void break_springs(msim_sim *sim) {
  const int32_t first = 0;
  const double omega = sim->islands->stepper.bounds.omega;
  while (!is_broken(sim, 2)) assert_ok(msim_sim_step(sim, 1, err));
  assert_bounds(sim);
  assert_true(sim->islands->stepper.bounds.omega < omega);
  assert_ok(msim_sim_break(sim, 1, &first, err));
  assert_bounds(sim);
}

static void change_everything(msim_sim *sim) {
  const double k[3] = {300, 200, 100}, rest[3] = {1, 1, 1}, damping[3] = {0.5, 0.4, 0.3};
  const int32_t removed = 0, pinned = 1;
  const msim_edit edit = {.size = sizeof edit, .nremoved_springs = 1, .removed_springs = &removed};
  assert_ok(msim_sim_set_springs(sim, k, rest, damping, err));
  assert_bounds(sim);
  assert_ok(msim_sim_set_drag(sim, 0.7, err));
  assert_bounds(sim);
  assert_ok(msim_sim_set_pinned(sim, 1, &pinned, 1, err));
  assert_bounds(sim);
  assert_ok(msim_sim_edit(sim, &edit, err));
  assert_bounds(sim);
}

static void bounds_follow_changes(void **state) {
  (void)state;
  static const char *const methods[] = {"rk4", "dop853", "velocity-verlet", "rkc"};
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++)
    for (int control = 0; control < 2; control++) {
      msim_scene *scene = make_chain();
      const msim_options opt = options_of(methods[i], control ? 1e-4 : 0);
      msim_sim *sim = make_sim(scene, &opt), *copy;
      assert_bounds(sim);
      break_springs(sim);
      const checkpoint c = save(sim);
      msim_sim *resumed = resume(scene, &opt, &c);
      assert_bounds(resumed);
      assert_ok(msim_sim_clone(sim, &copy, err));
      assert_bounds(copy);
      assert_ok(msim_sim_load(copy, c.bytes, c.length, err));
      assert_bounds(copy);
      assert_ok(msim_sim_step(resumed, 3, err));
      assert_ok(msim_sim_step(copy, 3, err));
      assert_ok(msim_sim_step(sim, 3, err));
      expect_same(sim, resumed, methods[i]), expect_same(sim, copy, methods[i]);
      change_everything(sim);
      assert_ok(msim_sim_run(sim, NULL, NULL, err));
      free(c.bytes);
      msim_sim_destroy(sim), msim_sim_destroy(copy), msim_sim_destroy(resumed);
      msim_scene_destroy(scene);
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(bounds_follow_changes)};
  return cmocka_run_group_tests_name("impact_bounds", tests, NULL, NULL);
}
