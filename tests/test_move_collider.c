/* Tests of motions of colliders that are set in a running sim, or in scenes: runs after
 * msim_sim_move_collider, checkpoints, clones, scene files and refusals. */
#include <stdio.h>

#include "checkpoints.h"
#include "moving_colliders.h"
#include "state_hash.h"

/*------------------------------------- changes in a run -----------------------------------------*/

/* A sphere is dragged through a cloth at 60 Hz. */
static const double frame = 1. / 60;

static msim_scene *cloth_and_sphere(void) {
  msim_scene *scene = hanging_cloth(9, 100, 0.05);
  add(scene, sphere(0.5, 0.5, 2, 0.2, 0.1, 0.2), 0);
  add(scene, box(0, 0, -3, 2, 0.1, 0.2), 0);
  return scene;
}

static void drag(msim_sim *sim, int i) {
  const double x[3] = {0.5 + 0.1 * sin(0.1 * i), 1.2 - 0.03 * i, -0.3}, w[3] = {0, 0.1 * i, 0};
  assert_ok(msim_sim_move_collider(sim, 0, x, i % 2 ? w : NULL, frame, err));
  assert_ok(msim_sim_step(sim, 16, err));
}

/* After a change the run is that of a new sim with this motion, which starts in the same state. */
static void changes_continue_as_new_sims(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (refuses_planes(method_at(m))) continue;
    msim_scene *scene = cloth_and_sphere(), *other = cloth_and_sphere();
    msim_options opt = options(method_at(m), frame / 16);
    if (takes_positions_only(method_at(m))) {
      msim_scene_destroy(scene), msim_scene_destroy(other);
      continue;
    }
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 10, err));
    msim_state now = state_of(sim);
    now.v_half = NULL;
    const double t[2] = {now.t, now.t + frame}, points[6] = {0.5, 0.5, 2, 0.5, 0.5, 0.1};
    set_motion(other, 0, 2, t, points, NULL, 0);
    msim_sim *fresh = make_sim(other, &opt);
    assert_ok(msim_sim_set_state(fresh, &now, err));
    assert_ok(msim_sim_move_collider(sim, 0, points + 3, NULL, frame, err));
    assert_ok(msim_sim_step(sim, 30, err));
    assert_ok(msim_sim_step(fresh, 30, err));
    assert_true(stats_of(sim).contacts > 0);
    if (hash_sim(sim) != hash_sim(fresh)) fail_msg("%s: differs from a new sim", method_at(m));
    msim_sim_destroy(sim), msim_sim_destroy(fresh);
    msim_scene_destroy(scene), msim_scene_destroy(other);
  }
}

static void a_dragged_sphere_stays_outside_and_resumes(void **state) {
  (void)state;
  msim_scene *scene = cloth_and_sphere();
  const msim_options opt = options("velocity-verlet", frame / 16);
  msim_sim *sim = make_sim(scene, &opt), *copy = NULL;
  checkpoint c = {0};
  for (int i = 0; i < 60; i++) {
    if (i == 40) {
      c = save(sim);
      assert_ok(msim_sim_clone(sim, &copy, err));
    }
    drag(sim, i);
    if (!(least_distance(sim) >= -1e-12)) fail_msg("%d: %g m inside", i, -least_distance(sim));
  }
  msim_sim *other = resume(scene, &opt, &c);
  for (int i = 40; i < 60; i++) drag(other, i), drag(copy, i);
  expect_same(sim, other, "resumed"), expect_same(sim, copy, "cloned");
  expect_same_save(sim, other, "resumed"), expect_same_save(sim, copy, "cloned");
  print_message("  %lld contacts, work %g J\n", (long long)stats_of(sim).contacts,
                energies_of(sim).work);
  assert_true(stats_of(sim).contacts > 100);
  assert_true(energies_of(sim).work > 0.01);
  /* the same sim returns to the checkpoint, and to the start */
  assert_ok(msim_sim_load(other, c.bytes, c.length, err));
  for (int i = 40; i < 60; i++) drag(other, i);
  expect_same(sim, other, "returned");
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other), msim_sim_destroy(copy);
  msim_scene_destroy(scene);
}

/* A checkpoint of a sim before its collider was moved, loaded after it */
static void loads_take_changes_back(void **state) {
  (void)state;
  msim_scene *scene = cloth_and_sphere();
  const msim_options opt = options("velocity-verlet", frame / 16);
  msim_sim *sim = make_sim(scene, &opt), *plain = make_sim(scene, &opt);
  const checkpoint c = save(sim);
  for (int i = 0; i < 30; i++) drag(sim, i);
  assert_ok(msim_sim_load(sim, c.bytes, c.length, err));
  assert_ok(msim_sim_step(sim, 480, err));
  assert_ok(msim_sim_step(plain, 480, err));
  assert_true(hash_sim(sim) == hash_sim(plain));
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(plain);
  msim_scene_destroy(scene);
}

/*------------------------------------- scenes ---------------------------------------------------*/

static const char text[] =
    "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 1]], \"mass\": 1}, \"colliders\": [\n"
    "{\"type\": \"sphere\", \"center\": [0, 0, 0], \"radius\": 0.5},\n"
    "{\"type\": \"box\", \"center\": [0, 0, 0], \"size\": [1, 1, 1], \"inside\": true,\n"
    " \"motion\": {\"t\": [0, 0.1, 2], \"x\": [[0, 0, 0], [0.25, 0, 0], [0, 1e-3, 0]],\n"
    "  \"rotation\": [[0, 0, 0], [0.7, 0, 0], [0, 0.1, 0]], \"interpolation\": \"cubic\"}},\n"
    "{\"type\": \"sphere\", \"center\": [0, 0, 0], \"radius\": 0.5,\n"
    " \"motion\": {\"t\": [1], \"x\": [[0, 0, 7]]}}]}";

static void expect_motions(const msim_scene *scene) {
  msim_collider_motion m = {.size = sizeof m};
  assert_int_equal(msim_scene_get_collider_motion(scene, 0, &m), MSIM_OK);
  assert_int_equal(m.nt, 0);
  assert_int_equal(msim_scene_get_collider_motion(scene, 1, &m), MSIM_OK);
  assert_int_equal(m.nt, 3);
  assert_int_equal(m.collider, 1);
  assert_int_equal(m.interpolation, MSIM_MOTION_CUBIC);
  assert_true(m.t[1] == 0.1 && m.x[3] == 0.25 && m.x[7] == 1e-3 && m.rotation[3] == 0.7);
  assert_int_equal(msim_scene_get_collider_motion(scene, 2, &m), MSIM_OK);
  assert_true(m.nt == 1 && m.x[2] == 7 && !m.rotation && m.interpolation == MSIM_MOTION_LINEAR);
  assert_int_equal(msim_scene_get_collider_motion(scene, 3, &m), MSIM_ERR_ARG);
}

static void scene_files_keep_motions(void **state) {
  (void)state;
  msim_scene *scene, *again;
  ms_text written = {.alloc = NULL};
  const msim_allocator alloc = ms_memory_allocator(NULL);
  written.alloc = &alloc;
  assert_ok(msim_scene_parse(NULL, "text", text, strlen(text), &scene, err));
  expect_motions(scene);
  assert_ok(msim_scene_set_name(scene, "changed", err)); /* the text is written anew */
  assert_ok(ms_scene_write_json(scene->data, &written, err));
  assert_ok(msim_scene_parse(NULL, "again", written.data, written.length, &again, err));
  expect_motions(again);
  msim_scene_destroy(again);
  const msim_status status = msim_scene_save(scene, "test_move_collider.h5", NULL);
  require(status != MSIM_ERR_NAME, "the importer hdf5");
  assert_int_equal(status, MSIM_OK);
  assert_ok(msim_scene_load(NULL, "test_move_collider.h5", &again, err));
  remove("test_move_collider.h5");
  expect_motions(again);
  ms_text_free(&written);
  msim_scene_destroy(scene), msim_scene_destroy(again);
}

static void checkpoints_name_another_motion(void **state) {
  (void)state;
  const double u[3] = {0, 0, 1}, x[3] = {0}, other[3] = {0, 0, 1.5};
  msim_scene *scenes[3] = {cloth_and_sphere(), cloth_and_sphere(), cloth_and_sphere()};
  set_uniform(scenes[0], x, u, NULL), set_uniform(scenes[1], x, other, NULL);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sims[3];
  msim_error error, *err = &error;
  for (int i = 0; i < 3; i++) sims[i] = make_sim(scenes[i], &opt);
  const checkpoint c = save(sims[0]);
  for (int i = 1; i < 3; i++) {
    assert_int_equal(msim_sim_load(sims[i], c.bytes, c.length, err), MSIM_ERR_ARG);
    if (i == 1) assert_non_null(strstr(err->text, "colliders[1].motion"));
  }
  free(c.bytes);
  for (int i = 0; i < 3; i++) msim_sim_destroy(sims[i]), msim_scene_destroy(scenes[i]);
}

static void wrong_motions_are_refused(void **state) {
  (void)state;
  const double t[2] = {0, 1}, back[2] = {1, 1}, x[6] = {0}, bad[6] = {0, 0, 0, NAN, 0, 0};
  const msim_collider_motion good = {.size = sizeof good, .nt = 2, .t = t, .x = x};
  msim_collider_motion m[8];
  msim_error error, *err = &error;
  const char *const says[] = {"collider is 2", "collider is -1", "at least 1",     "t or x is NULL",
                              "t[1] is 1",     "x[1] is",        "rotation[1] is", "interpolation"};
  for (int i = 0; i < 8; i++) m[i] = good;
  m[0].collider = 2, m[1].collider = -1, m[2].nt = 0, m[3].x = NULL, m[4].t = back, m[5].x = bad;
  m[6].rotation = bad, m[7].interpolation = 2;
  msim_scene *scene = cloth_and_sphere();
  for (int i = 0; i < 8; i++) {
    assert_int_equal(msim_scene_set_collider_motion(scene, &m[i], err), MSIM_ERR_ARG);
    if (!strstr(err->text, says[i])) fail_msg("%d: %s", i, err->text);
  }
  assert_false(ms_collider_motion_is_there(scene->data));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_move_collider(NULL, 0, x, NULL, 1, err), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_move_collider(sim, 2, x, NULL, 1, err), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_move_collider(sim, 0, NULL, NULL, 1, err), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_move_collider(sim, 0, x, NULL, 0, err), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_move_collider(sim, 0, bad + 1, NULL, 1, err), MSIM_ERR_ARG);
  assert_false(ms_collider_motion_is_there(sim->scene));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(changes_continue_as_new_sims),
                                     cmocka_unit_test(a_dragged_sphere_stays_outside_and_resumes),
                                     cmocka_unit_test(loads_take_changes_back),
                                     cmocka_unit_test(scene_files_keep_motions),
                                     cmocka_unit_test(checkpoints_name_another_motion),
                                     cmocka_unit_test(wrong_motions_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
