/* Tests of refused checkpoints: other bytes, damaged ones, and those of another scene or other
 * options. The message names the difference, and the sim is unchanged. */
#include <stdio.h>

#include "base/archive.h"
#include "checkpoints.h"
#include "scene_check.h"
#include "sim/sim.h"

static msim_scene *cloth(void) { return hanging_cloth(5, 300, 0.01); }

static msim_options options_for(const char *method) {
  msim_options opt = options(method, 1e-3);
  opt.solver = "pcg";
  return opt;
}

/* A sim that refuses checkpoints, and its twin, which is never given any: both must stay equal. */
typedef struct refusing_sim {
  msim_sim *sim, *twin;
} refusing_sim;

static refusing_sim make_refusing_sim(const msim_scene *scene, const msim_options *opt) {
  const refusing_sim v = {make_sim(scene, opt), make_sim(scene, opt)};
  assert_ok(msim_sim_step(v.sim, 3, err));
  assert_ok(msim_sim_step(v.twin, 3, err));
  return v;
}

static void free_refusing_sim(refusing_sim *v) {
  assert_ok(msim_sim_step(v->sim, 5, err));
  assert_ok(msim_sim_step(v->twin, 5, err));
  expect_same(v->twin, v->sim, "refused");
  msim_sim_destroy(v->sim), msim_sim_destroy(v->twin);
}

static checkpoint of_run(const msim_scene *scene, const msim_options *opt) {
  msim_sim *sim = make_sim(scene, opt);
  assert_ok(msim_sim_step(sim, 6, err));
  const checkpoint c = save(sim);
  msim_sim_destroy(sim);
  return c;
}

/*------------------------------------- differences ----------------------------------------------*/

/* The message when a checkpoint of one scene and options is loaded into a sim of another. */
static void expect_refusal(const msim_scene *scene, const msim_options *opt,
                           const msim_scene *there, const msim_options *opt_there,
                           const char *sentence) {
  msim_error why = {0, ""};
  const checkpoint c = of_run(there, opt_there);
  refusing_sim v = make_refusing_sim(scene, opt);
  assert_int_equal(msim_sim_load(v.sim, c.bytes, c.length, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, sentence);
  free_refusing_sim(&v);
  free(c.bytes);
}

static void other_options_are_named(void **state) {
  (void)state;
  static const struct {
    const char *name, *value, *sentence;
  } others[] = {{"integrator", "bdf2", "integrator is newmark here and bdf2 in the checkpoint"},
                {"h", "0.002", "h is 0.001 here and 0.002 in the checkpoint"},
                {"solver.rtol", "1e-9", "solver.rtol is 1e-08 here and 1e-09 in the checkpoint"},
                {"solver.max_iterations", "50",
                 "solver.max_iterations is 2000 here and 50 in the checkpoint"},
                {"jacobian", "clamp", "jacobian is exact here and clamp in the checkpoint"},
                {"indefinite", "stop", "indefinite is clamp here and stop in the checkpoint"},
                {"newton.retries", "2", "newton.retries is not given here and 2 in the checkpoint"},
                {"tol", "0.001", "tol is not given here and 0.001 in the checkpoint"},
                {"collision", "event", "collision is reflect here and event in the checkpoint"},
                {"skip.at_rest", "off", "skip.at_rest is on here and off in the checkpoint"}};
  msim_scene *scene = cloth();
  for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
    const msim_options opt = options_for("newmark");
    msim_options other = opt;
    assert_ok(msim_options_set(&other, others[i].name, others[i].value, err));
    expect_refusal(scene, &opt, scene, &other, others[i].sentence);
  }
  const msim_options fixed = options_for("newmark");
  msim_options controlled = fixed;
  controlled.tol = 1e-3;
  expect_refusal(scene, &controlled, scene, &fixed,
                 "tol is 0.001 here and not given in the checkpoint");
  msim_scene_destroy(scene);
}

static void other_scenes_are_named(void **state) {
  (void)state;
  const double g[3] = {0, 0, -9.8};
  const msim_options opt = options_for("newmark");
  msim_scene *scene = cloth(), *other;
  expect_refusal(scene, &opt, other = hanging_cloth(6, 300, 0.01), &opt,
                 "the number of particles is 25 here and 36 in the checkpoint");
  msim_scene_destroy(other);
  expect_refusal(scene, &opt, other = hanging_cloth(5, 301, 0.01), &opt,
                 "springs.k differs from that in the checkpoint");
  msim_scene_destroy(other);
  expect_refusal(scene, &opt, other = hanging_cloth(5, 300, 0.02), &opt,
                 "springs.damping differs from that in the checkpoint");
  msim_scene_destroy(other);
  other = cloth();
  assert_ok(msim_scene_pin(other, 1, (int32_t[1]){7}, err));
  expect_refusal(scene, &opt, other, &opt, "particles.pinned differs from that in the checkpoint");
  msim_scene_destroy(other);
  other = cloth();
  assert_ok(msim_scene_set_gravity(other, g, err));
  expect_refusal(scene, &opt, other, &opt,
                 "gravity is 0 0 -9.81 here and 0 0 -9.8 in the checkpoint");
  assert_ok(msim_scene_set_gravity(other, (double[3]){0, 0, -9.81}, err));
  assert_ok(msim_scene_set_drag(other, 0.5, err));
  expect_refusal(scene, &opt, other, &opt, "drag is 0 here and 0.5 in the checkpoint");
  msim_scene_destroy(other);
  other = cloth();
  plane(other, 0, 0, 1, -5, 0, 0);
  expect_refusal(scene, &opt, other, &opt,
                 "the number of planes is 0 here and 1 in the checkpoint");
  msim_scene *lower = cloth();
  plane(lower, 0, 0, 1, -6, 0, 0);
  expect_refusal(lower, &opt, other, &opt, "planes[0] differs from that in the checkpoint");
  msim_scene_destroy(other);
  other = cloth();
  plane(other, 0, 0, 1, -6, 0, 0);
  assert_ok(msim_scene_set_planes_constrain(other, 1, err));
  expect_refusal(lower, &opt, other, &opt, "planes_constrain is 0 here and 1 in the checkpoint");
  expect_refusal(other, &opt, lower, &opt, "planes_constrain is 1 here and 0 in the checkpoint");
  msim_scene_destroy(lower), msim_scene_destroy(other), msim_scene_destroy(scene);
}

/*------------------------------------- bytes ----------------------------------------------------*/

static void expect_no_checkpoint(msim_sim *sim, const void *bytes, size_t length) {
  msim_error why = {0, ""};
  if (msim_sim_load(sim, bytes, length, &why) != MSIM_ERR_ARG || !*why.text)
    fail_msg("%zu bytes were taken", length);
}

/* Each bit flipped, and each shorter length. */
static void damaged_bytes_are_refused(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  const msim_options opt = options_for("bdf2");
  const checkpoint c = of_run(scene, &opt);
  refusing_sim v = make_refusing_sim(scene, &opt);
  unsigned char *bytes = c.bytes;
  for (size_t i = 0; i < c.length; i++)
    for (int bit = 0; bit < 8; bit++) {
      bytes[i] ^= (unsigned char)(1u << bit);
      expect_no_checkpoint(v.sim, bytes, c.length);
      bytes[i] ^= (unsigned char)(1u << bit);
    }
  for (size_t length = 0; length < c.length; length++) {
    unsigned char *part = malloc(length + 1); /* of the exact length: sanitizers see reads past
                                               * it */
    memcpy(part, bytes, length);
    expect_no_checkpoint(v.sim, part, length);
    free(part);
  }
  free_refusing_sim(&v);
  free(c.bytes);
  msim_scene_destroy(scene);
}

static void what_is_wrong_is_told(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  const msim_options opt = options_for("bdf2");
  const checkpoint c = of_run(scene, &opt);
  msim_sim *sim = make_sim(scene, &opt);
  unsigned char *bytes = c.bytes;
  msim_error why;
  size_t length;
  char wanted[100];
  assert_int_equal(msim_sim_load(sim, "no", 2, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "the 2 bytes are not a checkpoint of msim");
  assert_int_equal(msim_sim_load(sim, bytes, c.length - 1, &why), MSIM_ERR_ARG);
  snprintf(wanted, sizeof wanted,
           "the checkpoint has %zu bytes, but %zu were given; give exactly those that were saved",
           c.length, c.length - 1);
  assert_string_equal(why.text, wanted);
  bytes[c.length / 2] ^= 1;
  assert_int_equal(msim_sim_load(sim, bytes, c.length, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "the checkpoint is damaged: its hash does not match its content");
  assert_int_equal(msim_sim_load(NULL, bytes, c.length, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_save(sim, bytes, c.length, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_save(sim, bytes, 100, &length, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "capacity is 100"));
  free(c.bytes);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Recompute the hash, in bytes 24 to 31, as the writer does. */
static void hash_again(const checkpoint *c) {
  unsigned char *bytes = c->bytes;
  enum { HASH = 24, HEADER = 40 };
  memset(bytes + HASH, 0, 8);
  const uint64_t hash =
      ms_archive_hash(ms_archive_hash(0, bytes, HEADER), bytes + HEADER, c->length - HEADER);
  memcpy(bytes + HASH, &hash, sizeof hash);
}

/* Forged bytes with a correct hash are refused or loaded, and do no harm. */
static void forged_bytes_do_no_harm(void **state) {
  (void)state;
  static const char *const methods[] = {"bdf2", "dop853", "auto"};
  for (size_t m = 0; m < 3; m++) {
    msim_scene *scene = hanging_cloth(3, 100, 0);
    msim_options opt = options_for(methods[m]);
    opt.t_end = 0.05, opt.steps = -1;
    const checkpoint c = of_run(scene, &opt);
    hash_again(&c);
    msim_sim *sim = resume(scene, &opt, &c); /* this checks hash_again() */
    unsigned seed = 1;
    unsigned char *bytes = malloc(c.length);
    checkpoint forged = {bytes, c.length};
    int taken = 0;
    for (size_t i = 40; i < c.length; i++) {
      memcpy(bytes, c.bytes, c.length);
      bytes[i] = (unsigned char)(256 * uniform(&seed));
      hash_again(&forged);
      if (msim_sim_load(sim, bytes, c.length, NULL) != MSIM_OK) continue;
      taken++;
      msim_sim_step(sim, 1, NULL);
    }
    assert_true(taken > 0);
    free(bytes), free(c.bytes);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Replace the first number of this value, and return the message of the refusal. */
static const char *forge(msim_sim *sim, const checkpoint *c, double value, double by) {
  static msim_error why;
  unsigned char *bytes = malloc(c->length);
  const checkpoint forged = {memcpy(bytes, c->bytes, c->length), c->length};
  size_t at = 40;
  while (at + 8 < c->length && memcmp(bytes + at, &value, 8) != 0) at++;
  memcpy(bytes + at, &by, 8);
  hash_again(&forged);
  assert_int_equal(msim_sim_load(sim, bytes, c->length, &why), MSIM_ERR_ARG);
  free(bytes);
  return why.text;
}

/* A rounding error of the time that is none */
static void a_forged_rounding_error_is_refused(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_options opt = options_for("dop853");
  opt.t_end = 0.5, opt.steps = -1, opt.fps = 500;
  msim_sim *sim = make_sim(scene, &opt);
  for (int i = 0; i < 6 || sim->run.t_rounding == 0; i++) assert_ok(msim_sim_step(sim, 1, err));
  const checkpoint c = save(sim);
  assert_non_null(strstr(forge(sim, &c, sim->run.t_rounding, 1e-3), "a time"));
  free(c.bytes);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* msim_sim_save_size() is a bound for the whole run. */
static void the_size_is_known_before(void **state) {
  (void)state;
  const char *method;
  for (int32_t m = 0; (method = method_at(m)) != NULL; m++)
    for (int controlled = 0; controlled < 2; controlled++) {
      msim_scene *scene = hanging_cloth(6, 100, takes_positions_only(method) ? 0 : 0.01);
      msim_options opt = options(method, 0.01);
      msim_sim *sim = NULL;
      opt.solver_max_iterations = 2; /* so that solver = auto replaces its choice */
      if (controlled) opt.tol = 1e-4, opt.t_end = 0.1, opt.steps = -1;
      if (!msim_sim_create(scene, &opt, &sim, NULL)) {
        const size_t size = msim_sim_save_size(sim);
        for (int i = 0; i < 5; i++) {
          assert_int_equal(msim_sim_save_size(sim), size);
          const checkpoint c = save(sim);
          assert_true(c.length <= size);
          free(c.bytes);
          msim_sim_step(sim, 1, NULL);
        }
      }
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/*------------------------------------- memory ---------------------------------------------------*/

/* Saving allocates nothing; a load that runs out of memory changes nothing. */
static void a_load_without_memory_changes_nothing(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "bdf2", "bdf2"};
  for (size_t m = 0; m < 3; m++) {
    limited_allocator memory;
    const msim_allocator alloc = make_limited_allocator(&memory);
    const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, k = 100, g[3] = {0, 0, -9.81};
    const double other = 200;
    const int32_t ij[2] = {0, 1};
    msim_scene *scene;
    assert_ok(msim_scene_create(&alloc, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
    assert_ok(msim_scene_pin(scene, 1, ij, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    const msim_options opt = options_for(methods[m]);
    msim_sim *sim = make_sim(scene, &opt), *twin = make_sim(scene, &opt);
    if (m == 2) {
      assert_ok(msim_sim_set_springs(sim, &other, NULL, NULL, err));
      assert_ok(msim_sim_set_springs(twin, &other, NULL, NULL, err));
    }
    assert_ok(msim_sim_step(sim, 6, err));
    assert_ok(msim_sim_step(twin, 6, err));
    memory.remaining = 0;
    const checkpoint c = save(sim);
    assert_ok(msim_sim_step(sim, 4, err));
    assert_ok(msim_sim_step(twin, 4, err));
    const int live = memory.live;
    msim_status status = MSIM_ERR_MEMORY;
    for (int allowed = 0; status; allowed++) {
      memory.remaining = allowed;
      status = msim_sim_load(sim, c.bytes, c.length, NULL);
      memory.remaining = -1;
      if (!status) break;
      assert_int_equal(memory.live, live);
      assert_int_equal(status, MSIM_ERR_MEMORY);
      assert_ok(msim_sim_step(sim, 1, err));
      assert_ok(msim_sim_step(twin, 1, err));
      expect_same(twin, sim, methods[m]);
    }
    assert_int_equal(state_of(sim).step, 6);
    free(c.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(twin);
    msim_scene_destroy(scene);
    assert_int_equal(memory.live, 0);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(other_options_are_named),
                                     cmocka_unit_test(other_scenes_are_named),
                                     cmocka_unit_test(damaged_bytes_are_refused),
                                     cmocka_unit_test(what_is_wrong_is_told),
                                     cmocka_unit_test(forged_bytes_do_no_harm),
                                     cmocka_unit_test(a_forged_rounding_error_is_refused),
                                     cmocka_unit_test(the_size_is_known_before),
                                     cmocka_unit_test(a_load_without_memory_changes_nothing)};
  return cmocka_run_group_tests_name("checkpoint_refusals", tests, NULL, NULL);
}
