/* Tests of integrator = auto where respa gets into resonance after the trial that chose it. */
#include <math.h>
#include <string.h>

#include "checkpoints.h"
#include "choose/rejection_reasons.h"
#include "counting_allocator.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 12, N = SIDE * SIDE, ROW = 6 };
#define T_END 0.22
#define TOL   1e-2

/* A cloth of 56 g, 23 cm wide, that hangs from one corner, with a cord of k = 1.5e6, not damped,
 * along one of its rows, and no springs that bend. While the cloth falls, its springs slacken and
 * stretch. */
static msim_scene *cloth_with_cord(const msim_allocator *alloc, double damping) {
  const double k = 1.469e6, size = 0.229863;
  const int32_t corner = 0;
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = SIDE,
                            .columns = SIDE,
                            .origin = {0, 0, 1},
                            .row = {size, 0, 0},
                            .column = {0, size, 0},
                            .mass = 0.0555,
                            .k_structural = 6782,
                            .k_shear = 4076,
                            .damping = damping,
                            .npinned = 1,
                            .pinned = &corner};
  const double rest = size / (SIDE - 1), gravity[3] = {0, 0, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  for (int32_t i = 0; i < SIDE - 1; i++) {
    const int32_t ij[2] = {ROW * SIDE + i, ROW * SIDE + i + 1};
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  }
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  return scene;
}

static msim_options chosen(double tol) {
  msim_options opt = options("auto", 1e-3);
  opt.tol = tol, opt.t_end = T_END;
  return opt;
}

static int is_respa(const msim_sim *sim) { return sim->config.integrator->is_multirate; }

/* To the step before which the method changes */
static void run_to_resonance(msim_sim *sim) {
  assert_true(is_respa(sim));
  for (int64_t left = sim->config.plan.steps; left > 0; left--) {
    const checkpoint before = save(sim);
    assert_ok(msim_sim_step(sim, 1, err));
    const int changed = !is_respa(sim);
    if (changed) assert_ok(msim_sim_load(sim, before.bytes, before.length, err));
    free(before.bytes);
    if (changed) return;
  }
  fail_msg("the run ends by respa");
}

static void keep_text(const char *text, void *user) {
  char *said = user;
  snprintf(said, 512, "%.511s", text);
}

/* The run continues by velocity Verlet, and keeps tol. */
static void expect_end_of_respa(double damping) {
  static double exact[3 * N];
  char said[512] = "";
  msim_scene *scene = cloth_with_cord(NULL, damping);
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-8, opt.t_end = T_END, opt.steps = -1;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  memcpy(exact, state_of(sim).x, sizeof exact);
  msim_sim_destroy(sim);
  opt = chosen(TOL);
  opt.warn = keep_text, opt.warn_user = said;
  sim = make_sim(scene, &opt);
  const int respa = sim->config.choice.best;
  assert_ok(msim_sim_step(sim, 1000, err));
  assert_true(is_respa(sim));
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_string_equal(sim->config.integrator->entry.name, "velocity-verlet");
  assert_int_equal(sim->config.choice.candidates[respa].rejection, MS_REASON_RESONANCE);
  assert_non_null(strstr(said, "a resonance of respa has added"));
  const double error = largest_difference(state_of(sim).x, exact, 3 * N) / 0.23;
  print_message("  %s\n  error: %.2g of the extent\n", said, error);
  assert_true(error < TOL);
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "rejected: a resonance has added energy during the run"));
  assert_non_null(strstr(text, "substeps per step, since respa was left"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void a_resonance_ends_respa(void **state) {
  (void)state;
  expect_end_of_respa(0);
}

/* The energy that damping takes away does not hide what a resonance adds. */
static void damping_hides_no_resonance(void **state) {
  (void)state;
  expect_end_of_respa(1e-3);
}

/* Runs in pieces, by two threads and from checkpoints before and after the change */
static void the_change_is_the_same_in_pieces(void **state) {
  (void)state;
  msim_scene *scene = cloth_with_cord(NULL, 0);
  msim_options opt = chosen(TOL), of_two = chosen(TOL);
  of_two.threads = 2;
  msim_sim *whole = make_sim(scene, &opt), *parts = make_sim(scene, &of_two);
  assert_ok(msim_sim_run(whole, NULL, NULL, err));
  run_to_resonance(parts);
  const checkpoint before = save(parts);
  assert_ok(msim_sim_step(parts, 5, err));
  assert_false(is_respa(parts));
  const checkpoint after = save(parts);
  msim_sim *resumed[] = {resume(scene, &opt, &before), resume(scene, &of_two, &after), parts};
  for (int i = 0; i < 3; i++) {
    assert_ok(msim_sim_run(resumed[i], NULL, NULL, err));
    const msim_state s = state_of(whole), t = state_of(resumed[i]);
    assert_int_equal(s.step, t.step);
    assert_memory_equal(s.x, t.x, 3 * N * sizeof *s.x);
    assert_memory_equal(s.v, t.v, 3 * N * sizeof *s.v);
    msim_sim_destroy(resumed[i]);
  }
  free(before.bytes), free(after.bytes);
  msim_sim_destroy(whole);
  msim_scene_destroy(scene);
}

/* Without memory for it nothing changes, and the next attempt succeeds. */
static void the_change_may_fail(void **state) {
  (void)state;
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  msim_scene *scene = cloth_with_cord(&alloc, 0);
  const msim_options opt = chosen(TOL);
  msim_sim *sim = make_sim(scene, &opt);
  run_to_resonance(sim);
  const checkpoint before = save(sim);
  int64_t failures = 0;
  for (;; failures++) {
    msim_error why;
    b.calls = 0, b.fail_at = failures;
    const msim_status status = msim_sim_step(sim, 1, &why);
    b.fail_at = -1;
    if (!status) break;
    assert_int_equal(status, MSIM_ERR_MEMORY);
    assert_true(is_respa(sim));
  }
  assert_true(failures > 5);
  msim_sim *same = resume(scene, &opt, &before);
  assert_ok(msim_sim_run(same, NULL, NULL, err));
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_memory_equal(state_of(sim).x, state_of(same).x, 3 * N * sizeof(double));
  free(before.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(same);
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_resonance_ends_respa), cmocka_unit_test(damping_hides_no_resonance),
      cmocka_unit_test(the_change_is_the_same_in_pieces), cmocka_unit_test(the_change_may_fail)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
