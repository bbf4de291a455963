/* Tests that a change of a running sim for which memory runs out, at any of its allocations,
 * changes nothing: the sim goes on to the same bits as one that was never touched. */
#include <stdio.h>
#include <string.h>

#include "checkpoints.h"
#include "counting_allocator.h"
#include "sim/sim.h"

enum { SIDE = 5, N = SIDE * SIDE, SPRINGS = 102 };

/* A planar cloth, so that a state out of its plane changes all matrices. */
static msim_scene *planar_cloth(const msim_allocator *alloc, const char *method) {
  const int32_t corners[2] = {0, SIDE - 1};
  const double g[3] = {0, 0, -9.81};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = SIDE,
                            .columns = SIDE,
                            .row = {0, 0.3, -1},
                            .column = {0, 1, 0},
                            .mass = 0.3,
                            .k_structural = 300,
                            .k_shear = 300,
                            .k_bend = 30,
                            .damping = takes_positions_only(method) ? 0 : 0.01,
                            .npinned = 2,
                            .pinned = corners};
  msim_scene *scene;
  msim_scene_view view = {.size = sizeof view};
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  assert_int_equal(view.nsprings, SPRINGS);
  return scene;
}

/* With rest lengths of 0 and without damping the matrix is scalar. */
static msim_status set_springs(msim_sim *sim, msim_error *err) {
  static const double zeros[SPRINGS];
  return msim_sim_set_springs(sim, NULL, zeros, zeros, err);
}

static msim_status set_step(msim_sim *sim, msim_error *err) {
  return msim_sim_set_step(sim, 2e-4, err);
}

static msim_status set_state(msim_sim *sim, msim_error *err) {
  double x[3 * N], v[3 * N] = {0};
  memcpy(x, state_of(sim).x, sizeof x);
  x[3 * (N - 1)] += 0.1;
  const msim_state folded = {.size = sizeof folded, .t = 0.5, .n = N, .x = x, .v = v};
  return msim_sim_set_state(sim, &folded, err);
}

/* Forces out of the plane, which particles did not have */
static msim_status set_forces(msim_sim *sim, msim_error *err) {
  double force[3 * N];
  for (int i = 0; i < 3 * N; i++) force[i] = 0.01 * i;
  return msim_sim_set_forces(sim, force, err);
}

static msim_status pin_middle(msim_sim *sim, msim_error *err) {
  const int32_t middle = N / 2;
  return msim_sim_set_pinned(sim, 1, &middle, 1, err);
}

/* Out of the plane; some methods refuse that. */
static msim_status move_corner(msim_sim *sim, msim_error *err) {
  const int32_t corner = 0;
  const double x[3] = {0.1, 0, 0};
  return msim_sim_move_pinned(sim, 1, &corner, x, 0.1, err);
}

/* A particle is removed, and two are added. */
static msim_status edit(msim_sim *sim, msim_error *err) {
  const int32_t gone = N - 1, ij[4] = {0, N, 3, N + 1};
  const double x[6] = {0, 0.1, 0.2, 0, 0.3, 0.1}, mass[2] = {0.01, 0.01}, k[2] = {10, 20};
  const msim_edit edit = {.size = sizeof edit,
                          .nremoved_particles = 1,
                          .removed_particles = &gone,
                          .nparticles = 2,
                          .x = x,
                          .mass = mass,
                          .nsprings = 2,
                          .ij = ij,
                          .k = k};
  return msim_sim_edit(sim, &edit, err);
}

static checkpoint later, edited; /* of a sim that is some steps ahead; after an edit */

static msim_status load_later(msim_sim *sim, msim_error *err) {
  return msim_sim_load(sim, later.bytes, later.length, err);
}

static msim_status load_edited(msim_sim *sim, msim_error *err) {
  return msim_sim_load(sim, edited.bytes, edited.length, err);
}

static void save_later(const msim_scene *scene, const msim_options *opt) {
  msim_sim *ahead = make_sim(scene, opt);
  assert_ok(msim_sim_step(ahead, 7, err));
  later = save(ahead);
  assert_ok(edit(ahead, err));
  edited = save(ahead);
  msim_sim_destroy(ahead);
}

static void expect_same_states(msim_sim *a, msim_sim *b, const char *label, int64_t failure) {
  const msim_state s = state_of(a), t = state_of(b);
  if (s.step != t.step || s.t != t.t || s.h != t.h || memcmp(s.x, t.x, 3 * N * sizeof *s.x) ||
      memcmp(s.v, t.v, 3 * N * sizeof *s.v) || a->run.spent != b->run.spent)
    fail_msg("%s: allocation %lld failed, and the sim is another one", label, (long long)failure);
}

/* Plan a new run from the present state, by the options. */
static void restart(msim_sim *sim) {
  const msim_state now = state_of(sim);
  assert_ok(msim_sim_set_state(sim, &now, err));
}

/* Returns the number of allocations that failed in turn. */
static int64_t fail_change(const char *method, msim_status (*change)(msim_sim *, msim_error *)) {
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  msim_scene *scene = planar_cloth(&alloc, method);
  msim_options opt = options(method, 1e-3);
  const int is_auto = strcmp(method, "auto") == 0;
  opt.threads = 1, opt.solver = "pcg";
  if (is_auto) opt.t_end = 2, opt.tol = 1e-3;
  else if (strcmp(method, "dop853") == 0) opt.tol = 1e-3, opt.steps = -1;
  else opt.steps = 1000;
  save_later(scene, &opt);
  msim_sim *sim = make_sim(scene, &opt), *twin = make_sim(scene, &opt);
  msim_error why;
  int64_t failure = 0;
  assert_ok(msim_sim_step(sim, 3, err));
  assert_ok(msim_sim_step(twin, 3, err));
  for (;; failure++) {
    b.fail_at = b.calls + failure;
    const msim_status status = change(sim, &why);
    b.fail_at = -1;
    if (!status || status == MSIM_ERR_ARG) break; /* auto takes no step */
    assert_int_equal(status, MSIM_ERR_MEMORY);
    expect_same_states(sim, twin, method, failure);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(twin, 1, err));
    expect_same_states(sim, twin, method, failure);
    restart(sim), restart(twin);
    expect_same_states(sim, twin, method, failure);
  }
  free(later.bytes), free(edited.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(twin);
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
  return failure;
}

static const char *const methods[] = {
    "velocity-verlet",         "respa", "takahashi-imada", "verlet",
    "linearly-implicit-euler", "bdf2",  "dop853",          "auto"};

static void fail_with_all_methods(msim_status (*change)(msim_sim *, msim_error *)) {
  int64_t failures = 0;
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    const int64_t these = fail_change(methods[i], change);
    print_message("  %s: %lld\n", methods[i], (long long)these);
    failures += these;
  }
  assert_true(failures > 0);
}

static void springs_that_cannot_be_set(void **state) {
  (void)state;
  fail_with_all_methods(set_springs);
}

static void forces_that_cannot_be_set(void **state) {
  (void)state;
  fail_with_all_methods(set_forces);
}

static void pins_that_cannot_be_changed(void **state) {
  (void)state;
  fail_with_all_methods(pin_middle);
  fail_with_all_methods(move_corner);
}

static void steps_that_cannot_be_set(void **state) {
  (void)state;
  fail_with_all_methods(set_step);
}

static void states_that_cannot_be_set(void **state) {
  (void)state;
  fail_with_all_methods(set_state);
}

static void checkpoints_that_cannot_be_loaded(void **state) {
  (void)state;
  fail_with_all_methods(load_later);
  fail_with_all_methods(load_edited);
}

static void scenes_that_cannot_be_edited(void **state) {
  (void)state;
  fail_with_all_methods(edit);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(springs_that_cannot_be_set),
                                     cmocka_unit_test(forces_that_cannot_be_set),
                                     cmocka_unit_test(pins_that_cannot_be_changed),
                                     cmocka_unit_test(scenes_that_cannot_be_edited),
                                     cmocka_unit_test(steps_that_cannot_be_set),
                                     cmocka_unit_test(states_that_cannot_be_set),
                                     cmocka_unit_test(checkpoints_that_cannot_be_loaded)};
  return cmocka_run_group_tests_name("failed changes", tests, NULL, NULL);
}
