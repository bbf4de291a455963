/* Tests of pins that are moved, set and let go in a running sim: steps afterwards against a new
 * sim, energy less work, checkpoints, and refused input. */
#include <math.h>

#include "checkpoints.h"
#include "state_hash.h"

enum { SIDE = 5, N = SIDE * SIDE };

static const int32_t corner = 0, others[2] = {SIDE - 1, N - 1};
static const double target[3] = {0.1, -0.2, 0.3};

static int supports_motions(const char *method) {
  return strcmp(method, "respa") != 0 && strcmp(method, "takahashi-imada") != 0;
}

static msim_scene *cloth_for(const char *method) {
  return hanging_cloth(SIDE, 300, takes_positions_only(method) ? 0 : 0.01);
}

static msim_options run_options(const char *method, int controlled) {
  msim_options opt = options(method, 1.0 / 1024);
  if (controlled) opt.tol = 1e-4, opt.steps = -1, opt.t_end = 1;
  else opt.steps = 1024;
  return opt;
}

/* The second corner is let go, and the last one pinned; then the first one moves, if it can. */
static void change_pins(msim_sim *sim, int moves) {
  assert_ok(msim_sim_set_pinned(sim, 1, &others[0], 0, err));
  assert_ok(msim_sim_set_pinned(sim, 1, &others[1], 1, err));
  if (moves) assert_ok(msim_sim_move_pinned(sim, 1, &corner, target, 0.25, err));
}

/* The scene that a sim of `scene` has after change_pins() in this state */
static msim_scene *changed_scene(const msim_scene *scene, const msim_state *now, int moves) {
  msim_scene_view s = {.size = sizeof s};
  double x[3 * N], points[6];
  const int32_t pins[2] = {corner, others[1]};
  const double t[2] = {now->t, now->t + 0.25};
  msim_scene *changed;
  assert_int_equal(msim_scene_get(scene, &s), MSIM_OK);
  memcpy(x, s.x, sizeof x);
  for (int i = 0; i < 2; i++) memcpy(x + 3 * pins[i], now->x + 3 * pins[i], 3 * sizeof *x);
  assert_ok(msim_scene_create(NULL, &changed, err));
  assert_ok(msim_scene_add_particles(changed, N, x, NULL, s.mass, err));
  assert_ok(msim_scene_add_springs(changed, s.nsprings, s.ij, s.k, s.rest, s.damping, err));
  assert_ok(msim_scene_set_gravity(changed, s.gravity, err));
  assert_ok(msim_scene_pin(changed, 2, pins, err));
  memcpy(points, now->x, 3 * sizeof *points), memcpy(points + 3, target, sizeof target);
  const msim_motion m = {
      .size = sizeof m, .n = 1, .particles = &corner, .nt = 2, .t = t, .x = points};
  if (moves) assert_ok(msim_scene_add_motion(changed, &m, err));
  return changed;
}

static void expect_fresh(const char *method, int controlled, int32_t threads) {
  msim_scene *scene = cloth_for(method);
  msim_options opt = run_options(method, controlled);
  opt.threads = threads;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 20, err));
  change_pins(sim, supports_motions(method));
  msim_state now = state_of(sim);
  now.v_half = NULL;
  msim_scene *changed = changed_scene(scene, &now, supports_motions(method));
  if (opt.steps >= 0) opt.steps -= 20;
  msim_sim *fresh = make_sim(changed, &opt);
  assert_ok(msim_sim_set_state(fresh, &now, err));
  for (int k = 0; k < 5; k++) {
    assert_ok(msim_sim_step(sim, 8, err));
    assert_ok(msim_sim_step(fresh, 8, err));
    if (hash_sim(sim) != hash_sim(fresh))
      fail_msg("%s: differs from a new sim after %d steps", method, 8 * k + 8);
  }
  msim_sim_destroy(sim), msim_sim_destroy(fresh);
  msim_scene_destroy(scene), msim_scene_destroy(changed);
}

static void changes_continue_as_new_sims(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    expect_fresh(method, 0, 1 + i % 2);
    if (supports_motions(method) && strcmp(method, "verlet") != 0) expect_fresh(method, 1, 1);
  }
}

static msim_scene *hanging_rope(void) {
  const double g[3] = {0, 0, -9.81};
  const msim_rope rope = {.size = sizeof rope,
                          .n = 6,
                          .to = {1, 0, 0},
                          .mass = 0.1,
                          .k = 100,
                          .npinned = 1,
                          .pinned = &corner};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* A rope in the plane y = 0, whose first particle leaves it: the model gets a third component. */
static void handles_leave_the_plane(void **state) {
  (void)state;
  const double out[3] = {0, 0.3, 0};
  const double t[2] = {0, 0.1}, points[6] = {0, 0, 0, 0, 0.3, 0};
  msim_scene *scene = hanging_rope(), *moved = hanging_rope();
  const msim_motion m = {
      .size = sizeof m, .n = 1, .particles = &corner, .nt = 2, .t = t, .x = points};
  const msim_options opt = options("velocity-verlet", 1e-3);
  assert_ok(msim_scene_add_motion(moved, &m, err));
  msim_sim *sim = make_sim(scene, &opt), *fresh = make_sim(moved, &opt);
  assert_ok(msim_sim_move_pinned(sim, 1, &corner, out, 0.1, err));
  assert_ok(msim_sim_step(sim, 50, err));
  assert_ok(msim_sim_step(fresh, 50, err));
  assert_true(fabs(state_of(sim).x[4]) > 1e-3);
  assert_true(hash_sim(sim) == hash_sim(fresh));
  msim_sim_destroy(sim), msim_sim_destroy(fresh);
  msim_scene_destroy(scene), msim_scene_destroy(moved);
}

/* Moves keep all islands: nothing is analyzed anew. */
static void moves_analyze_nothing(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 300, 0.01);
  const msim_options opt = options("linearly-implicit-euler", 1e-2);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  const int64_t analyses = stats_of(sim).analyses;
  for (int i = 0; i < 5; i++) {
    assert_ok(msim_sim_move_pinned(sim, 1, &corner, target, 0.25, err));
    assert_ok(msim_sim_step(sim, 3, err));
  }
  assert_int_equal(stats_of(sim).analyses, analyses);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void energy_is_balanced(void **state) {
  (void)state;
  const double up[3] = {0.1, 0, 0.3}, down[3] = {-0.1, 0.1, 0};
  msim_scene *scene = hanging_cloth(SIDE, 50, 0);
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-12, opt.steps = -1, opt.t_end = 100;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energy_less_work(sim);
  for (int i = 0; i < 8; i++) {
    assert_ok(msim_sim_move_pinned(sim, 1, &corner, i % 2 ? up : down, 0.1, err));
    assert_ok(msim_sim_step(sim, 30, err));
    assert_close(energy_less_work(sim), start, 2e-11);
    assert_ok(msim_sim_set_pinned(sim, 1, &others[i % 2], i % 3 == 0, err));
    assert_ok(msim_sim_step(sim, 30, err));
    assert_close(energy_less_work(sim), start, 2e-11);
  }
  assert_true(fabs(state_of(sim).work) > 0.1);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void handles_arrive_and_rest(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 50, 0);
  const msim_options opt = options("velocity-verlet", 1.0 / 1024);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_move_pinned(sim, 1, &corner, target, 0.25, err));
  assert_close(state_of(sim).v[2], target[2] / 0.25, 1e-15);
  assert_ok(msim_sim_step(sim, 128, err));
  for (int c = 0; c < 3; c++) assert_close(state_of(sim).x[c], target[c] / 2, 1e-15);
  assert_ok(msim_sim_step(sim, 200, err));
  for (int c = 0; c < 3; c++) assert_true(state_of(sim).x[c] == target[c]);
  for (int c = 0; c < 3; c++) assert_true(state_of(sim).v[c] == 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void changes_are_in_checkpoints(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    msim_scene *scene = cloth_for(method);
    const msim_options opt = run_options(method, 0);
    expect_change_is_saved(scene, &opt, change_pins, supports_motions(method), method);
    msim_scene_destroy(scene);
  }
}

static void bad_handles_are_refused(void **state) {
  (void)state;
  const int32_t free_one = 7, outside = N;
  const double bad[3] = {0, NAN, 0};
  msim_error why;
  msim_scene *scene = hanging_cloth(SIDE, 300, 0);
  const msim_options opt = options("rk4", 1e-3);
  msim_sim *sim = make_sim(scene, &opt), *twin = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  assert_int_equal(msim_sim_move_pinned(sim, 1, &free_one, target, 1, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text,
                      "particles[0] is particle 7, which is not pinned; pin it to move it");
  assert_int_equal(msim_sim_move_pinned(sim, 1, &outside, target, 1, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "particles[0] is 25; there are 25 particles, counted from 0");
  assert_int_equal(msim_sim_move_pinned(sim, 1, &corner, target, 0, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "duration is 0; it must be a finite number > 0");
  assert_int_equal(msim_sim_move_pinned(sim, 1, &corner, bad, 1, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "x[0] is nan; it must be finite");
  assert_int_equal(msim_sim_set_pinned(sim, 1, &corner, 2, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "pinned is 2; it must be 1, or 0 to let go");
  assert_int_equal(msim_sim_set_pinned(sim, 1, &outside, 1, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_set_pinned(sim, -1, &corner, 1, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_set_pinned(NULL, 1, &corner, 1, &why), MSIM_ERR_ARG);
  const int32_t twice[2] = {corner, corner};
  const double both[6] = {0};
  assert_int_equal(msim_sim_move_pinned(sim, 2, twice, both, 1, &why), MSIM_ERR_ARG);
  assert_ok(msim_sim_step(sim, 3, err));
  assert_ok(msim_sim_step(twin, 6, err));
  expect_same(sim, twin, "after refused handles");
  expect_same_save(sim, twin, "after refused handles");
  msim_sim_destroy(sim), msim_sim_destroy(twin);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(changes_continue_as_new_sims), cmocka_unit_test(handles_leave_the_plane),
      cmocka_unit_test(moves_analyze_nothing),        cmocka_unit_test(energy_is_balanced),
      cmocka_unit_test(handles_arrive_and_rest),      cmocka_unit_test(changes_are_in_checkpoints),
      cmocka_unit_test(bad_handles_are_refused)};
  return cmocka_run_group_tests_name("handles", tests, NULL, NULL);
}
