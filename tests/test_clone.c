/* Tests of msim_sim_clone, and of msim_sim_load into a sim in use: trees of clones against plain
 * runs, returns to earlier states, loads that fail, and what a load computes. */
#include <stdio.h>

#include "base/archive.h"
#include "checkpoints.h"
#include "counting_allocator.h"
#include "error_control.h"

static const msim_allocator *allocator; /* of the scenes; NULL: malloc */

/* A cloth with a corner just above a plane, so that contact comes and goes. */
static msim_scene *falling_cloth(int with_plane, double damping) {
  const double g[3] = {0.5, 0, -9.81};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 5,
                            .columns = 5,
                            .row = {0, 1, 0.2},
                            .column = {1, 0, 0.1},
                            .mass = 0.3,
                            .k_structural = 300,
                            .k_shear = 100,
                            .damping = damping,
                            .npinned = !with_plane,
                            .pinned = (int32_t[]){3}};
  msim_scene *scene;
  assert_ok(msim_scene_create(allocator, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  if (with_plane) plane(scene, 0.1, 0, 1, -0.002, 0.4, 0.3);
  return scene;
}

/* Case i of all methods, contacts and kinds of steps; 0: past the last method */
static int choose_case(int i, msim_options *opt, int *with_plane) {
  const char *method = method_at(i / 6);
  if (!method) return 0;
  *with_plane = i % 3 > 0;
  *opt = options(method, 2e-3);
  opt->collision = i % 3 == 2 ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT;
  opt->solver = i % 2 ? "pcg" : "auto";
  opt->newton_rtol = 1e-5;
  if (i % 6 < 3) return 1;
  const int first_order = strstr(method, "euler") != NULL;
  opt->tol = first_order ? 1e-2 : 1e-4, opt->t_end = 0.3, opt->steps = -1;
  return 1;
}

/*------------------------------------- trees of clones ------------------------------------------*/

typedef struct node {
  msim_sim *sim;
  int64_t steps;
} node;

enum { NODES = 5, LENGTH = 24 };

/* At random: a node makes steps, is cloned, destroyed, or takes over the state of another one. */
static void grow_tree(node *nodes, unsigned *seed) {
  node *from = &nodes[(int)(uniform(seed) * NODES)], *to = &nodes[(int)(uniform(seed) * NODES)];
  const double what = uniform(seed);
  if (!from->sim) return;
  if (what < 0.5 || from == to) {
    const int64_t n = (int64_t)(uniform(seed) * 4);
    if (from->steps + n > LENGTH) return;
    assert_ok(msim_sim_step(from->sim, n, err));
    from->steps += n;
  } else if (what < 0.8 || !to->sim) {
    msim_sim_destroy(to->sim);
    assert_ok(msim_sim_clone(from->sim, &to->sim, err));
    to->steps = from->steps;
  } else {
    const checkpoint c = save(from->sim);
    assert_ok(msim_sim_load(to->sim, c.bytes, c.length, err));
    to->steps = from->steps;
    free(c.bytes);
  }
}

/* All leaves end as a plain run of the same number of steps does. */
static void test_tree(const msim_scene *scene, const msim_options *opt, unsigned seed,
                      const char *label) {
  node nodes[NODES] = {{make_sim(scene, opt), 0}};
  msim_sim *plain = make_sim(scene, opt);
  for (int i = 0; i < 16; i++) grow_tree(nodes, &seed);
  assert_ok(msim_sim_step(plain, LENGTH, err));
  for (int i = 0; i < NODES; i++) {
    if (!nodes[i].sim) continue;
    assert_ok(msim_sim_step(nodes[i].sim, LENGTH - nodes[i].steps, err));
    expect_same(plain, nodes[i].sim, label);
    if (i < 2) expect_same_save(plain, nodes[i].sim, label);
    msim_sim_destroy(nodes[i].sim);
  }
  msim_sim_destroy(plain);
}

static void trees_of_clones(void **state) {
  (void)state;
  enum { TREES = 300 };
  int trees = 0;
  for (unsigned round = 0; trees < TREES; round++) {
    msim_options opt;
    int with_plane;
    for (int i = 0; trees < TREES && choose_case(i, &opt, &with_plane); i++) {
      const int smooth = takes_positions_only(opt.integrator);
      char label[120];
      msim_scene *scene = falling_cloth(with_plane, smooth ? 0 : 0.02);
      msim_sim *sim = NULL;
      opt.threads = 1 + (int32_t)(round % 2);
      snprintf(label, sizeof label, "tree %u, case %d, %s", round, i, opt.integrator);
      if (msim_sim_create(scene, &opt, &sim, NULL) == MSIM_OK) {
        test_tree(scene, &opt, 7 * round + (unsigned)i, label);
        trees++;
      }
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
  }
}

/* auto, for which nothing is chosen again, with frames inside steps */
static void clones_of_auto(void **state) {
  (void)state;
  for (int with_plane = 0; with_plane < 2; with_plane++)
    for (int i = 0; i < 3; i++) {
      msim_scene *scene = falling_cloth(with_plane, 0.02);
      msim_options opt = control_options("auto", i == 0 ? 1e-2 : i == 1 ? 1e-4 : 1e-7, 0.1);
      opt.fps = 333;
      msim_sim *sim = make_sim(scene, &opt), *copy;
      for (int k = 0; k < 4; k++) {
        assert_ok(msim_sim_step(sim, 3, err));
        assert_ok(msim_sim_clone(sim, &copy, err));
        expect_same(sim, copy, "auto");
        assert_ok(msim_sim_step(sim, 2, err));
        assert_ok(msim_sim_step(copy, 2, err));
        expect_same(sim, copy, "auto");
        expect_same_save(sim, copy, "auto");
        msim_sim_destroy(copy);
      }
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/*------------------------------------- independence ---------------------------------------------*/

static void count_warning(const char *text, void *user) {
  (void)text;
  ++*(int *)user;
}

/* A clone outlives its sim and scene, has its own springs, step and state, and passes warnings to
 * the callback that it was given. */
static void clones_are_independent(void **state) {
  (void)state;
  int warnings[2] = {0};
  msim_scene *scene = falling_cloth(0, 0);
  msim_options opt = options("velocity-verlet", 2e-3);
  opt.warn = count_warning, opt.warn_user = &warnings[0];
  msim_sim *sim = make_sim(scene, &opt), *copy, *twin;
  double k[100];
  for (int i = 0; i < 100; i++) k[i] = 200;
  assert_ok(msim_sim_step(sim, 5, err));
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  assert_ok(msim_sim_set_step(sim, 1e-3, err));
  assert_ok(msim_sim_step(sim, 5, err));
  assert_ok(msim_sim_clone(sim, &copy, err));
  assert_ok(msim_sim_clone(copy, &twin, err));
  assert_int_equal(warnings[0], 0);
  msim_sim_set_warn(copy, count_warning, &warnings[1]);
  for (int i = 0; i < 100; i++) k[i] = 1e6;
  assert_ok(msim_sim_set_springs(copy, k, NULL, NULL, err)); /* h is too long now */
  assert_int_equal(warnings[0], 0);
  assert_int_equal(warnings[1], 1);
  msim_sim_set_warn(copy, NULL, NULL);
  msim_sim_destroy(copy);
  assert_ok(msim_sim_step(sim, 5, err));
  msim_scene_destroy(scene);
  assert_ok(msim_sim_step(twin, 5, err));
  expect_same(sim, twin, "after changes of the other one");
  msim_sim_destroy(sim);
  assert_ok(msim_sim_step(twin, 5, err));
  msim_sim_destroy(twin);
  msim_error why;
  assert_int_equal(msim_sim_clone(NULL, &copy, &why), MSIM_ERR_ARG);
}

/* Solvers chosen for other springs, and rest lengths of 0: the matrix becomes another one. */
static void clones_after_other_springs(void **state) {
  (void)state;
  static const char *const methods[] = {"linearly-implicit-euler", "bdf2", "respa"};
  for (int m = 0; m < 3; m++)
    for (int kind = 0; kind < 2; kind++) {
      double k[100], rest[100];
      for (int i = 0; i < 100; i++) k[i] = 500 + 1e5 * (i == 7), rest[i] = kind ? 0 : 0.2;
      msim_scene *scene = falling_cloth(0, 0);
      const msim_options opt = options(methods[m], 1e-3);
      msim_sim *sim = make_sim(scene, &opt), *copy;
      assert_ok(msim_sim_step(sim, 4, err));
      const checkpoint early = save(sim);
      assert_ok(msim_sim_set_springs(sim, k, rest, NULL, err));
      assert_ok(msim_sim_step(sim, 4, err));
      assert_int_equal(msim_sim_load(sim, early.bytes, early.length, NULL), MSIM_ERR_ARG);
      assert_ok(msim_sim_clone(sim, &copy, err));
      const checkpoint c = save(sim);
      assert_ok(msim_sim_step(sim, 6, err));
      expect_same_end(sim, copy, 6, methods[m]);
      assert_ok(msim_sim_load(copy, c.bytes, c.length, err));
      expect_same_end(sim, copy, 6, methods[m]);
      free(c.bytes), free(early.bytes);
      msim_sim_destroy(sim), msim_sim_destroy(copy);
      msim_scene_destroy(scene);
    }
}

/* Islands that were built for another step or other springs are not those of the checkpoint: then
 * the next checkpoint agrees only if they are built anew. */
static void other_islands_are_replaced(void **state) {
  (void)state;
  static const char *const methods[] = {"linearly-implicit-euler", "bdf2"};
  double k[100];
  for (int i = 0; i < 100; i++) k[i] = 500;
  for (int m = 0; m < 4; m++) {
    msim_scene *soft = falling_cloth(0, 0), *stiff = falling_cloth(0, 0);
    msim_scene_view view = {.size = sizeof view};
    assert_int_equal(msim_scene_get(soft, &view), MSIM_OK);
    msim_options opt = options(methods[m % 2], 1e-3);
    msim_sim *sim, *other;
    if (m < 2) { /* solvers for h = 1e-3, and for 2e-3 */
      sim = make_sim(soft, &opt);
      assert_ok(msim_sim_set_step(sim, 2e-3, err));
      opt.h = 2e-3;
      other = make_sim(soft, &opt);
    } else { /* solvers for these springs, and for others */
      msim_scene_destroy(stiff);
      assert_ok(msim_scene_create(NULL, &stiff, err));
      assert_ok(msim_scene_add_particles(stiff, view.nparticles, view.x, view.v, view.mass, err));
      assert_ok(
          msim_scene_add_springs(stiff, view.nsprings, view.ij, k, view.rest, view.damping, err));
      assert_ok(msim_scene_pin(stiff, 1, (int32_t[]){3}, err));
      assert_ok(msim_scene_set_gravity(stiff, (double[]){0.5, 0, -9.81}, err));
      sim = make_sim(soft, &opt), other = make_sim(stiff, &opt);
      assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
    }
    assert_ok(msim_sim_step(sim, 3, err));
    assert_ok(msim_sim_step(other, 5, err));
    const checkpoint c = save(other);
    assert_ok(msim_sim_load(sim, c.bytes, c.length, err));
    expect_same_save(other, sim, opt.integrator);
    free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(soft), msim_scene_destroy(stiff);
  }
}

/* respa splits the springs for h, which the time from its start to t_end determines. */
static void other_splits_are_replaced(void **state) {
  (void)state;
  const double k = 1e5;
  msim_scene *scene = falling_cloth(0, 0);
  assert_ok(msim_scene_add_springs(scene, 1, (int32_t[2]){7, 9}, &k, NULL, NULL, err));
  msim_options opt = options("respa", 3e-3);
  opt.t_end = 0.01; /* 4 steps of 2.5e-3 */
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  msim_state start = state_of(other);
  start.t = 4e-3; /* 2 steps of 3e-3 */
  assert_ok(msim_sim_set_state(other, &start, err));
  assert_ok(msim_sim_step(other, 1, err));
  const checkpoint c = save(other);
  assert_ok(msim_sim_load(sim, c.bytes, c.length, err));
  assert_true(state_of(sim).h == 3e-3);
  assert_ok(msim_sim_step(other, 20, err));
  expect_same_end(other, sim, 20, "respa");
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

/*------------------------------------- loads ----------------------------------------------------*/

/* Recompute the hash, in bytes 24 to 31, as the writer does. */
static void hash_again(unsigned char *bytes, size_t length) {
  enum { HASH = 24, HEADER = 40 };
  memset(bytes + HASH, 0, 8);
  const uint64_t hash =
      ms_archive_hash(ms_archive_hash(0, bytes, HEADER), bytes + HEADER, length - HEADER);
  memcpy(bytes + HASH, &hash, sizeof hash);
}

/* Forged bytes fail anywhere in the middle of a load; the sim then goes on as if nothing had been.
 * The last bytes are those of the islands. */
static void a_load_that_fails_changes_nothing(void **state) {
  (void)state;
  msim_options opt;
  int with_plane, failures = 0;
  for (int i = 0; choose_case(i, &opt, &with_plane); i++) {
    msim_scene *scene = falling_cloth(with_plane, takes_positions_only(opt.integrator) ? 0 : 0.02);
    msim_sim *sim = NULL, *twin;
    if (msim_sim_create(scene, &opt, &sim, NULL) != MSIM_OK) {
      msim_scene_destroy(scene);
      continue;
    }
    assert_ok(msim_sim_step(sim, 4, err));
    const checkpoint c = save(sim);
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_clone(sim, &twin, err));
    unsigned seed = (unsigned)i;
    unsigned char *bytes = malloc(c.length);
    for (int k = 0; k < 12; k++) {
      memcpy(bytes, c.bytes, c.length);
      const size_t at = c.length - 8 - (size_t)(uniform(&seed) * 0.8 * (double)c.length);
      memset(bytes + at, 0xff, 8); /* no finite number */
      hash_again(bytes, c.length);
      if (msim_sim_load(sim, bytes, c.length, NULL) == MSIM_OK) {
        assert_ok(msim_sim_load(sim, c.bytes, c.length, err));
        assert_ok(msim_sim_step(sim, 5, err));
      } else failures++;
      expect_same(twin, sim, opt.integrator);
    }
    assert_ok(msim_sim_step(twin, 5, err));
    expect_same_end(twin, sim, 5, opt.integrator);
    free(bytes), free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(twin);
    msim_scene_destroy(scene);
  }
  assert_true(failures > 500); /* otherwise little is tested */
}

/* A return to an earlier state allocates the copy by which a failure is undone, and no more. */
static void a_load_builds_nothing(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "dop853", "linearly-implicit-euler",
                                        "bdf2"};
  counting_allocator count = {.fail_at = -1};
  const msim_allocator counted = {sizeof counted, counting_allocator_alloc, counting_allocator_free,
                                  &count};
  allocator = &counted;
  for (int m = 0; m < 4; m++) {
    msim_scene *scene = falling_cloth(0, 0);
    msim_options opt = options(methods[m], 1e-3);
    opt.solver = "pcg";
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 3, err));
    const checkpoint c = save(sim);
    assert_ok(msim_sim_step(sim, 3, err));
    const int64_t before = count.calls;
    assert_ok(msim_sim_load(sim, c.bytes, c.length, err));
    assert_int_equal(count.calls - before, 1);
    free(c.bytes);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  assert_int_equal(count.live, 0);
  allocator = NULL;
}

/* A clone without memory, at each allocation in turn, leaves the sim and no memory. */
static void a_clone_without_memory(void **state) {
  (void)state;
  static const char *const methods[] = {"verlet", "bdf2"};
  counting_allocator count = {.fail_at = -1};
  const msim_allocator counted = {sizeof counted, counting_allocator_alloc, counting_allocator_free,
                                  &count};
  allocator = &counted;
  for (int m = 0; m < 2; m++) {
    msim_scene *scene = falling_cloth(1, 0);
    msim_options opt = options(methods[m], 1e-3);
    opt.solver = "pcg", opt.plugin_path = "nowhere";
    msim_sim *sim = make_sim(scene, &opt), *copy = NULL;
    assert_ok(msim_sim_step(sim, 3, err));
    const int64_t live = count.live;
    msim_status status = MSIM_ERR_MEMORY;
    for (int64_t i = 0; status; i++) {
      count.fail_at = count.calls + i;
      status = msim_sim_clone(sim, &copy, NULL);
      count.fail_at = -1;
      if (!status) break;
      assert_int_equal(status, MSIM_ERR_MEMORY);
      assert_null(copy);
      assert_int_equal(count.live, live);
    }
    expect_same(sim, copy, methods[m]);
    msim_sim_destroy(sim), msim_sim_destroy(copy);
    msim_scene_destroy(scene);
  }
  assert_int_equal(count.live, 0);
  allocator = NULL;
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(trees_of_clones),
                                     cmocka_unit_test(clones_of_auto),
                                     cmocka_unit_test(clones_are_independent),
                                     cmocka_unit_test(clones_after_other_springs),
                                     cmocka_unit_test(other_islands_are_replaced),
                                     cmocka_unit_test(other_splits_are_replaced),
                                     cmocka_unit_test(a_load_that_fails_changes_nothing),
                                     cmocka_unit_test(a_load_builds_nothing),
                                     cmocka_unit_test(a_clone_without_memory)};
  return cmocka_run_group_tests_name("clone", tests, NULL, NULL);
}
