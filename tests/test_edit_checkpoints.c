/* Tests of edits of running sims in checkpoints and clones, with open recorders, and of refused
 * edits */
#include <stdio.h>

#include "checkpoints.h"
#include "edits.h"
#include "state_hash.h"

/*------------------------------------- checkpoints ----------------------------------------------*/

static void expect_same_steps(msim_sim *a, msim_sim *b, const char *label) {
  assert_ok(msim_sim_step(a, 9, err));
  assert_ok(msim_sim_step(b, 9, err));
  if (hash_sim(a) != hash_sim(b)) fail_msg("%s: the states differ", label);
  expect_same_save(a, b, label);
}

/* Also back to before the edit, and to after it again */
static void edits_are_in_checkpoints(void **state) {
  (void)state;
  const char *method;
  const double g[3] = {0, 1, -5};
  for (int32_t i = 0; (method = method_or_auto(i)) != NULL; i++) {
    const int kind = takes(method, MOVING, 0) && i % 2 ? MOVING : i % 3 ? LAWS : PLAIN;
    random_edit r;
    msim_scene *scene = make_scene(method, kind);
    const msim_scene_view s = view_of(scene);
    const msim_options opt = run_options(method, kind, 0);
    msim_sim *sim = make_sim(scene, &opt), *copy;
    if (i % 2) assert_ok(msim_sim_set_gravity(sim, g, err));
    assert_ok(msim_sim_step(sim, 5, err));
    const checkpoint before = save(sim);
    fill_edit(&s, !takes_positions_only(method), (unsigned)i, &r);
    assert_ok(msim_sim_edit(sim, &r.is, err));
    if (i % 3) assert_ok(msim_sim_set_gravity(sim, s.gravity, err));
    assert_ok(msim_sim_step(sim, 5, err));
    const checkpoint after = save(sim);
    msim_sim *other = resume(scene, &opt, &after);
    assert_ok(msim_sim_clone(sim, &copy, err));
    expect_same_steps(sim, other, method);
    const int64_t analyses = stats_of(sim).analyses;
    assert_ok(msim_sim_load(sim, after.bytes, after.length, err)); /* the same scene */
    if (!is(method, "auto")) assert_int_equal(stats_of(sim).analyses, analyses);
    expect_same_steps(sim, copy, method);
    assert_ok(msim_sim_load(sim, before.bytes, before.length, err));
    assert_int_equal(state_of(sim).n, N);
    msim_sim_destroy(other), msim_sim_destroy(copy);
    other = resume(scene, &opt, &before);
    expect_same_steps(sim, other, method);
    assert_ok(msim_sim_load(sim, after.bytes, after.length, err));
    assert_ok(msim_sim_load(other, after.bytes, after.length, err));
    expect_same_steps(sim, other, method);
    free(before.bytes), free(after.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- recorders and refusals -----------------------------------*/

static void recorders_refuse_frames(void **state) {
  (void)state;
  msim_recorder *recorder;
  const int32_t spring = 3;
  const msim_edit edit = {.size = sizeof edit, .nremoved_springs = 1, .removed_springs = &spring};
  msim_scene *scene = make_scene("rk4", PLAIN);
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.steps = 20;
  const char *path = "test_edits.csv";
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_recorder_replace(sim, path, &recorder, err));
  assert_ok(msim_recorder_write(recorder, err));
  assert_ok(msim_sim_edit(sim, &edit, err));
  msim_error why;
  assert_int_equal(msim_recorder_write(recorder, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "other particles or springs"));
  assert_ok(msim_recorder_close(recorder, err));
  assert_ok(msim_recorder_replace(sim, path, &recorder, err));
  assert_ok(msim_recorder_write(recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  remove(path);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

static void expect_refused(msim_scene *scene, msim_sim *sim, const msim_edit *edit,
                           const char *text) {
  const uint64_t hash = hash_sim(sim);
  const int32_t n = view_of(scene).nsprings;
  msim_error why;
  assert_int_equal(msim_sim_edit(sim, edit, &why), MSIM_ERR_ARG);
  if (!strstr(why.text, text)) fail_msg("\"%s\" does not contain \"%s\"", why.text, text);
  assert_int_equal(msim_scene_edit(scene, edit, &why), MSIM_ERR_ARG);
  if (!strstr(why.text, text)) fail_msg("\"%s\" does not contain \"%s\"", why.text, text);
  assert_true(hash_sim(sim) == hash && view_of(scene).nsprings == n);
}

static void edits_are_refused(void **state) {
  (void)state;
  const int32_t beyond = N, negative = -1, one = 1, out[2] = {0, N + 1}, to_one[2] = {0, 1};
  const int32_t same[2] = {4, 4}, law = 7;
  const double k = 1, bad = -1, x[3] = {0, 0, NAN}, mass = 1;
  msim_scene *scene = make_scene("rk4", LAWS);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_edit none = {.size = sizeof none};
  msim_edit e = none;
  e.nremoved_particles = 1, e.removed_particles = &beyond;
  expect_refused(scene, sim, &e, "removed_particles[0] is 36; there are 36 particles");
  e.removed_particles = &negative;
  expect_refused(scene, sim, &e, "removed_particles[0] is -1");
  e.removed_particles = NULL;
  expect_refused(scene, sim, &e, "removed_particles is NULL");
  e = none, e.nremoved_springs = 1, e.removed_springs = &negative;
  expect_refused(scene, sim, &e, "removed_springs[0] is -1");
  e = none, e.nsprings = 1, e.k = &k;
  expect_refused(scene, sim, &e, "ij is NULL");
  e.ij = out;
  expect_refused(scene, sim, &e,
                 "springs.ij[0] refers to particle 37; with those to add there are");
  e.ij = same;
  expect_refused(scene, sim, &e, "itself");
  e.ij = to_one, e.nremoved_particles = 1, e.removed_particles = &one;
  expect_refused(scene, sim, &e, "springs.ij[0] refers to particle 1, which is removed");
  e.nremoved_particles = 0, e.k = &bad;
  expect_refused(scene, sim, &e, "springs.k[0] is -1");
  e.k = &k, e.law = &law;
  expect_refused(scene, sim, &e, "law is 7");
  e = none, e.nparticles = 1, e.x = x, e.mass = &mass;
  expect_refused(scene, sim, &e, "particles.x[0] is nan");
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

static void edits_of_sims_are_refused(void **state) {
  (void)state;
  const int32_t to_one[2] = {0, 1};
  const double k = 1;
  msim_scene *scene = make_scene("rk4", LAWS);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_edit none = {.size = sizeof none};
  msim_edit e = {.size = 8};
  msim_error why;
  assert_int_equal(msim_sim_edit(sim, &e, &why), MSIM_ERR_SIZE);
  assert_int_equal(msim_scene_edit(scene, &e, &why), MSIM_ERR_SIZE);
  assert_int_equal(msim_sim_edit(sim, NULL, &why), MSIM_ERR_ARG);
  int32_t all[N];
  for (int32_t p = 0; p < N; p++) all[p] = p;
  e = none, e.nremoved_particles = N, e.removed_particles = all;
  assert_int_equal(msim_sim_edit(sim, &e, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "removes all particles"));
  msim_sim_destroy(sim), msim_scene_destroy(scene);
  /* a damped spring, for a method that cannot have it */
  scene = make_scene("rkn6", PLAIN);
  const msim_options without = options("rkn6", 1e-3);
  sim = make_sim(scene, &without);
  e = none, e.nsprings = 1, e.ij = to_one, e.k = &k, e.damping = &k;
  const uint64_t hash = hash_sim(sim);
  assert_int_equal(msim_sim_edit(sim, &e, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "damped"));
  assert_true(hash_sim(sim) == hash);
  assert_ok(msim_sim_step(sim, 3, err));
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(edits_are_in_checkpoints), cmocka_unit_test(recorders_refuse_frames),
      cmocka_unit_test(edits_are_refused), cmocka_unit_test(edits_of_sims_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
