/* Tests of springs that break: closed forms, runs of every method against new sims whose springs
 * have k = 0, energy, checkpoints and clones, allocations, scene files, refusals. */
#include <math.h>
#include <stdio.h>

#include "breaking.h"
#include "checkpoints.h"
#include "counting_allocator.h"
#include "laws.h"
#include "state_hash.h"

enum { SIDE = 5, N = SIDE * SIDE };

/*------------------------------------- new sims -------------------------------------------------*/

enum { PLAIN, LAWS, EVENT, KINDS };

/* A cloth some of whose springs break. breaks 0: thresholds that none exceeds; broken: their k and
 * damping are 0, and their law is linear if it does not scale with k. Nullable: broken. */
static msim_scene *breaking_cloth(const msim_allocator *alloc, const char *method, int kind,
                                  int breaks, const uint8_t *broken) {
  msim_scene *like = hanging_cloth(SIDE, 300, takes_positions_only(method) ? 0 : 0.01), *scene;
  msim_scene_view s = view_of(like);
  const int32_t corners[2] = {0, SIDE - 1};
  double k[MOST], damping[MOST], v[3 * N];
  for (int32_t e = 0; e < s.nsprings; e++) {
    k[e] = broken && broken[e] ? 0 : s.k[e];
    damping[e] = broken && broken[e] ? 0 : s.damping[e];
  }
  for (int i = 0; i < 3 * N; i++) v[i] = s.pinned[i / 3] ? 0 : 0.8 * sin(i);
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, s.x, v, s.mass, err));
  assert_ok(msim_scene_add_springs(scene, s.nsprings, s.ij, k, s.rest, damping, err));
  assert_ok(msim_scene_pin(scene, 2, corners, err));
  assert_ok(msim_scene_set_gravity(scene, s.gravity, err));
  if (kind == EVENT) plane(scene, 0, 0, 1, -0.02, 0.5, 0.2);
  const int kinds = kind == LAWS ? 1 + LAW_KINDS : 1;
  for (int i = 0; i < kinds; i++) {
    const msim_law linear = {.size = sizeof linear, .kind = MSIM_LAW_LINEAR};
    add_law(scene, i ? make_law(i - 1) : linear,
            breaks ? (kind == EVENT ? 0.008 : 0.02 + 0.002 * i) : never, 0);
  }
  for (int32_t e = 0; e < s.nsprings; e++) {
    const int32_t law = 1 + e % kinds;
    const int scales = law < MSIM_LAW_TABLE + 1;
    if (e % 3 == 0 && (scales || !broken || !broken[e]))
      assert_ok(msim_scene_set_law(scene, 1, &e, law, err));
  }
  msim_scene_destroy(like);
  return scene;
}

static int takes_breaking(const char *method) {
  return strcmp(method, "respa") != 0 && strcmp(method, "takahashi-imada") != 0;
}

static msim_options run_options(const char *method, int kind, int controlled) {
  msim_options opt = options(method, 1.0 / 1024);
  if (controlled) opt.tol = 1e-2, opt.steps = -1;
  if (kind == EVENT) opt.collision = MSIM_COLLISION_EVENT;
  opt.solver = "pcg";
  return opt;
}

/* The times of sums of steps may differ by rounding. */
static int have_same_vectors(msim_sim *a, msim_sim *b) {
  const msim_state s = state_of(a), t = state_of(b);
  const size_t bytes = 3 * (size_t)s.n * sizeof *s.x;
  return memcmp(s.x, t.x, bytes) == 0 && memcmp(s.v, t.v, bytes) == 0;
}

static void expect_fresh(const char *method, int kind, int controlled, int32_t threads) {
  uint8_t broken[MOST], later[MOST];
  msim_options opt = run_options(method, kind, controlled);
  opt.threads = threads;
  msim_scene *scene = breaking_cloth(NULL, method, kind, 1, NULL);
  msim_scene *whole = breaking_cloth(NULL, method, kind, 0, NULL);
  msim_sim *sim = make_sim(scene, &opt), *twin = make_sim(whole, &opt);
  int steps = 0;
  for (; !stats_of(sim).broken && state_of(sim).t < 0.6; steps++) {
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(twin, 1, err));
  }
  if (steps < 2 || !stats_of(sim).broken) fail_msg("%s: %d steps", method, steps);
  msim_state now = state_of(twin);
  now.v_half = NULL;
  assert_memory_equal(now.x, state_of(sim).x, 3 * N * sizeof *now.x);
  assert_int_equal(msim_sim_broken(sim, broken), MSIM_OK);
  msim_scene *rest = breaking_cloth(NULL, method, kind, 0, broken);
  msim_sim *fresh = make_sim(rest, &opt);
  assert_ok(msim_sim_set_state(fresh, &now, err));
  if (controlled) assert_ok(msim_sim_set_step(fresh, state_of(sim).h, err));
  for (int i = 0; i < 12; i++) {
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(fresh, 1, err));
    assert_int_equal(msim_sim_broken(sim, later), MSIM_OK);
    const int is_same = memcmp(later, broken, (size_t)view_of(scene).nsprings) == 0;
    if (is_same && !have_same_vectors(sim, fresh))
      fail_msg("%s%s, scene %d: differs from a new sim %d steps after springs broke", method,
               controlled ? ", tol" : "", kind, i + 1);
    if (!is_same) break;
  }
  msim_sim_destroy(sim), msim_sim_destroy(twin), msim_sim_destroy(fresh);
  msim_scene_destroy(scene), msim_scene_destroy(whole), msim_scene_destroy(rest);
}

static void runs_continue_as_new_sims(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++)
    for (int kind = 0; kind < KINDS && takes_breaking(method); kind++) {
      const int no_sync = strcmp(method, "verlet") != 0;
      if (kind == EVENT && !no_sync) continue;
      expect_fresh(method, kind, 0, 1 + i % 2);
      if (no_sync) expect_fresh(method, kind, 1, 1);
    }
}

enum { FRAMES = 400 };

typedef struct frame_states {
  int n;
  int64_t step[FRAMES]; /* the steps made when the frame is observed */
  double x[FRAMES][3 * N], v[FRAMES][3 * N];
} frame_states;

static int keep_frame(msim_sim *sim, void *data) {
  frame_states *frames = data;
  const msim_state s = state_of(sim);
  memcpy(frames->x[frames->n], s.x, sizeof frames->x[0]);
  memcpy(frames->v[frames->n], s.v, sizeof frames->v[0]);
  frames->step[frames->n] = s.step;
  return ++frames->n == FRAMES || stats_of(sim).broken > 0;
}

static int64_t count_steps_to_break(const msim_scene *scene, const msim_options *opt) {
  msim_sim *sim = make_sim(scene, opt);
  while (stats_of(sim).broken == 0) assert_ok(msim_sim_step(sim, 1, err));
  const int64_t steps = state_of(sim).step;
  msim_sim_destroy(sim);
  return steps;
}

/* Frames inside the step in which springs break are those of springs that are still whole. */
static void frames_inside_steps_have_whole_springs(void **state) {
  (void)state;
  const char *method;
  static frame_states frames, expected;
  int tested = 0;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    msim_options opt = run_options(method, PLAIN, 1);
    if (!takes_breaking(method) || strcmp(method, "verlet") == 0) continue;
    opt.t_end = 1, opt.fps = 8000;
    msim_scene *scene = breaking_cloth(NULL, method, PLAIN, 1, NULL);
    msim_scene *whole = breaking_cloth(NULL, method, PLAIN, 0, NULL);
    const int64_t last = count_steps_to_break(scene, &opt);
    msim_sim *sim = make_sim(scene, &opt), *twin = make_sim(whole, &opt);
    frames.n = expected.n = 0;
    assert_int_equal(msim_sim_run(sim, keep_frame, &frames, NULL), MSIM_STOPPED);
    assert_int_equal(msim_sim_run(twin, keep_frame, &expected, NULL), MSIM_STOPPED);
    int inside = 0;
    for (int k = 0; k < frames.n && frames.step[k] <= last; k++) {
      assert_memory_equal(frames.x[k], expected.x[k], sizeof frames.x[k]);
      assert_memory_equal(frames.v[k], expected.v[k], sizeof frames.v[k]);
      inside += frames.step[k] == last;
    }
    tested += inside > 0; /* steps of some methods are shorter than the time between frames */
    msim_sim_destroy(sim), msim_sim_destroy(twin);
    msim_scene_destroy(scene), msim_scene_destroy(whole);
  }
  assert_true(tested >= 10);
}

/*------------------------------------- energy ---------------------------------------------------*/

/* The total falls by the energy of the springs that break, and never rises. */
static void energy_only_falls(void **state) {
  (void)state;
  msim_scene *scene = breaking_cloth(NULL, "rkn6", PLAIN, 1, NULL);
  const int32_t n = view_of(scene).nsprings;
  msim_options opt = run_options("dop853", PLAIN, 1);
  opt.tol = 1e-11;
  msim_sim *sim = make_sim(scene, &opt);
  double before = energy_of(sim).total;
  const double start = before;
  int64_t broken = 0;
  while (state_of(sim).t < 0.3) {
    double strain[MOST], lost = 0;
    uint8_t was[MOST], is[MOST];
    assert_int_equal(msim_sim_broken(sim, was), MSIM_OK);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_int_equal(msim_sim_broken(sim, is), MSIM_OK);
    assert_int_equal(msim_sim_springs(sim, NULL, NULL, strain), MSIM_OK);
    const msim_scene_view s = view_of(scene);
    for (int32_t e = 0; e < n; e++) {
      const double stretch = strain[e] * s.rest[e];
      if (is[e] && !was[e]) lost += s.k[e] * stretch * stretch / 2;
      if (is[e] && !was[e]) assert_true(strain[e] > 0.02);
      if (!is[e] && e % 3 == 0) assert_true(strain[e] <= 0.02);
      assert_true(is[e] >= was[e] && (!is[e] || e % 3 == 0));
      broken += is[e] && !was[e];
    }
    assert_close(energy_of(sim).total, before - lost, 1e-9);
    before = energy_of(sim).total;
    assert_true(energy_of(sim).work == 0);
  }
  assert_in_range(broken, 5, n);
  assert_int_equal(stats_of(sim).broken, broken);
  assert_true(before < start - 1e-3);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/*------------------------------------- checkpoints ----------------------------------------------*/

static void broken_springs_are_in_checkpoints(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!takes_breaking(method)) continue;
    const int dissipates = strstr(method, "implicit-euler") != NULL; /* no plain spring breaks */
    const int kind = i % 2 || dissipates ? LAWS : PLAIN;
    msim_scene *scene = breaking_cloth(NULL, method, kind, 1, NULL);
    msim_options opt = run_options(method, kind, 0);
    if (is_implicit(method)) opt.solver = "auto";
    const int64_t at[] = {3, 40, 70};
    const msim_stats s = expect_resumable(scene, &opt, 90, 3, at, method);
    assert_true(s.broken > 1);
    msim_scene_destroy(scene);
  }
}

/* Edits, other springs and pins of a sim with broken springs, which stay broken */
static void springs_stay_broken(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler", "bdf2"};
  for (int i = 0; i < 3; i++) {
    msim_scene *scene = breaking_cloth(NULL, methods[i], LAWS, 1, NULL);
    const msim_options opt = run_options(methods[i], LAWS, 0);
    const int32_t first[3] = {0, 1, 2}, middle = 7, n = view_of(scene).nsprings;
    const msim_edit edit = {.size = sizeof edit, .nremoved_springs = 3, .removed_springs = first};
    double k[MOST];
    uint8_t broken[MOST], after[MOST];
    msim_sim *sim = make_sim(scene, &opt), *copy;
    assert_ok(msim_sim_step(sim, 60, err));
    assert_int_equal(msim_sim_broken(sim, broken), MSIM_OK);
    for (int32_t e = 0; e < n; e++) k[e] = 200;
    assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
    assert_ok(msim_sim_set_pinned(sim, 1, &middle, 1, err));
    const msim_state now = state_of(sim);
    assert_ok(msim_sim_set_state(sim, &now, err));
    assert_int_equal(msim_sim_broken(sim, after), MSIM_OK);
    assert_memory_equal(after, broken, (size_t)n);
    assert_ok(msim_sim_edit(sim, &edit, err));
    assert_int_equal(msim_sim_broken(sim, after), MSIM_OK);
    assert_memory_equal(after, broken + 3, (size_t)n - 3);
    assert_ok(msim_sim_step(sim, 20, err));
    const checkpoint c = save(sim);
    msim_sim *other = make_sim(scene, &opt);
    assert_ok(msim_sim_set_springs(other, k, NULL, NULL, err));
    assert_ok(msim_sim_load(other, c.bytes, c.length, err));
    assert_ok(msim_sim_clone(sim, &copy, err));
    for (int round = 0; round < 2; round++) {
      assert_ok(msim_sim_step(sim, 20, err));
      assert_ok(msim_sim_step(other, 20, err));
      assert_ok(msim_sim_step(copy, 20, err));
      assert_true(hash_sim(sim) == hash_sim(other) && hash_sim(sim) == hash_sim(copy));
      expect_same_save(sim, other, methods[i]);
    }
    assert_ok(msim_sim_load(sim, c.bytes, c.length, err));
    assert_ok(msim_sim_step(sim, 40, err));
    assert_true(hash_sim(sim) == hash_sim(other));
    free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other), msim_sim_destroy(copy);
    msim_scene_destroy(scene);
  }
}

static int count_frame(msim_sim *sim, void *count) {
  ++*(int *)count;
  return msim_sim_state(sim, &(msim_state){.size = sizeof(msim_state)}) != MSIM_OK;
}

/* Times and frames go on where springs break, also inside steps, and change no bit. */
static void frames_go_on(void **state) {
  (void)state;
  const char *const methods[] = {"dop853", "rkn6", "tr-bdf2"};
  for (int i = 0; i < 3; i++) {
    msim_scene *scene = breaking_cloth(NULL, methods[i], PLAIN, 1, NULL);
    msim_options opt = run_options(methods[i], PLAIN, 1);
    opt.t_end = 0.25, opt.fps = 400;
    msim_sim *watched = make_sim(scene, &opt), *plain = make_sim(scene, &opt);
    int frames = 0;
    assert_ok(msim_sim_run(watched, count_frame, &frames, err));
    assert_ok(msim_sim_run(plain, NULL, NULL, err));
    assert_int_equal(frames, 101);
    assert_true(stats_of(plain).broken > 2);
    assert_true(hash_sim(watched) == hash_sim(plain));
    msim_sim_destroy(watched), msim_sim_destroy(plain);
    msim_scene_destroy(scene);
  }
}

/* Steps in which springs break allocate nothing; sims that cannot be made leave nothing. */
static void breaking_allocates_nothing(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "verlet", "implicit-midpoint", "dop853"};
  for (int i = 0; i < 4; i++) {
    counting_allocator b = {.fail_at = -1};
    const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                  &b};
    msim_scene *scene = breaking_cloth(&alloc, methods[i], LAWS, 1, NULL);
    const msim_options opt = run_options(methods[i], LAWS, strcmp(methods[i], "dop853") == 0);
    msim_sim *sim = NULL;
    msim_error why;
    for (int64_t failure = 0;; failure++) {
      b.fail_at = b.calls + failure;
      const msim_status status = msim_sim_create(scene, &opt, &sim, &why);
      b.fail_at = -1;
      if (!status) break;
      assert_int_equal(status, MSIM_ERR_MEMORY);
    }
    const int64_t calls = b.calls;
    assert_ok(msim_sim_step(sim, 100, err));
    assert_true(stats_of(sim).broken > 1);
    assert_int_equal(b.calls, calls);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
    assert_int_equal(b.live, 0);
  }
}

/*------------------------------------- refusals -------------------------------------------------*/

static void thresholds_are_refused(void **state) {
  (void)state;
  const char *const refused[] = {"auto", "respa", "takahashi-imada"};
  msim_error why;
  msim_sim *sim;
  msim_scene *scene = breaking_cloth(NULL, "rkn6", PLAIN, 1, NULL);
  for (int i = 0; i < 3; i++) {
    msim_options opt = options(refused[i], 1e-3);
    opt.t_end = 1;
    assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
    assert_non_null(strstr(why.text, refused[i]));
    assert_non_null(strstr(why.text, "does not support springs that break"));
  }
  msim_law law = {.size = sizeof law, .kind = MSIM_LAW_LINEAR};
  assert_int_equal(msim_scene_add_law(scene, &law, NULL, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "set break_strain or break_force"));
  law.break_strain = -1;
  assert_int_equal(msim_scene_add_law(scene, &law, NULL, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "break_strain is -1"));
  law.break_strain = 0, law.break_force = NAN;
  assert_int_equal(msim_scene_add_law(scene, &law, NULL, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "break_force is nan"));
  assert_int_equal(msim_sim_broken(NULL, NULL), MSIM_ERR_ARG);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(runs_continue_as_new_sims),
                                     cmocka_unit_test(frames_inside_steps_have_whole_springs),
                                     cmocka_unit_test(energy_only_falls),
                                     cmocka_unit_test(broken_springs_are_in_checkpoints),
                                     cmocka_unit_test(springs_stay_broken),
                                     cmocka_unit_test(frames_go_on),
                                     cmocka_unit_test(breaking_allocates_nothing),
                                     cmocka_unit_test(thresholds_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
