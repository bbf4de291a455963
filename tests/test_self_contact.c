/* Tests of self-contact as a part of scenes and sims: values that are refused, scene files, starts
 * with surfaces that intersect or touch, what it excludes, the same bits by threads and after a
 * resume, steps from the state alone, pins that force an intersection, edits, want of memory. */
#include "checkpoints.h"
#include "failing_allocator.h"
#include "surfaces.h"

static void expect_error(msim_status status, msim_status expected, const msim_error *err,
                         const char *text) {
  assert_int_equal(status, expected);
  if (!strstr(err->text, text)) fail_msg("\"%s\" lacks \"%s\"", err->text, text);
}

static void expect_refused_sim(const msim_scene *scene, const msim_options *opt,
                               msim_status expected, const char *text) {
  msim_error why;
  msim_sim *sim;
  expect_error(msim_sim_create(scene, opt, &sim, &why), expected, &why, text);
  assert_null(sim);
}

static msim_scene_view view_of(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  return view;
}

/* Two sheets, the upper one of which falls on the lower one, which lies on a plane */
static msim_scene *two_sheets(double friction) {
  msim_scene *scene = surfaces(9.81, friction);
  add_sheet(scene, 8, 200, 0.5, 0, 0, 0, NULL);
  add_sheet(scene, 7, 200, 0.4, 0.02, 0.01, 0.05, (const double[3]){0.1, 0, -1});
  plane(scene, 0, 0, 1, -0.01, 0, 0.5);
  return scene;
}

/*------------------------------------- scenes ---------------------------------------------------*/

static void wrong_values_are_refused(void **state) {
  (void)state;
  msim_error why;
  msim_scene *scene = two_sheets(0.3);
  expect_error(msim_scene_set_self_contact(NULL, 0.1, 0, &why), MSIM_ERR_ARG, &why, "NULL");
  const double wrong[] = {-1, NAN, INFINITY};
  for (int i = 0; i < 3; i++) {
    expect_error(msim_scene_set_self_contact(scene, wrong[i], 0, &why), MSIM_ERR_ARG, &why,
                 "thickness");
    expect_error(msim_scene_set_self_contact(scene, 1, wrong[i], &why), MSIM_ERR_ARG, &why,
                 "friction");
  }
  assert_close(view_of(scene).self_thickness, THICKNESS, 0);
  assert_close(view_of(scene).self_friction, 0.3, 0);
  assert_ok(msim_scene_set_self_contact(scene, 0, 7, err));
  assert_close(view_of(scene).self_friction, 0, 0);
  msim_scene_destroy(scene);
}

static void expect_saved(const msim_scene *scene, const char *path) {
  msim_scene *read;
  assert_ok(msim_scene_save(scene, path, err));
  assert_ok(msim_scene_load(NULL, path, &read, err));
  assert_close(view_of(read).self_thickness, view_of(scene).self_thickness, 0);
  assert_close(view_of(read).self_friction, view_of(scene).self_friction, 0);
  msim_scene_destroy(read);
  remove(path);
}

static void scene_files_keep_it(void **state) {
  (void)state;
  msim_scene *scene = two_sheets(0.1 + 0.2), *without = two_sheets(-1);
  expect_saved(scene, "self_contact_test.json");
  expect_saved(without, "self_contact_test.json");
  if (msim_scene_save(scene, "self_contact_test.h5", NULL) == MSIM_OK) {
    expect_saved(scene, "self_contact_test.h5");
    expect_saved(without, "self_contact_test.h5");
  }
  msim_scene_destroy(scene), msim_scene_destroy(without);
}

static void expect_bad_json(const char *section, const char *text) {
  char json[400];
  msim_scene *scene;
  msim_error why;
  snprintf(json, sizeof json,
           "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0]], \"mass\": 1}, \"self_contact\": %s}",
           section);
  expect_error(msim_scene_parse(NULL, "a", json, strlen(json), &scene, &why), MSIM_ERR_ARG, &why,
               text);
}

static void wrong_keys_are_refused(void **state) {
  (void)state;
  expect_bad_json("3", "self_contact");
  expect_bad_json("{}", "self_contact.thickness");
  expect_bad_json("{\"thickness\": 0}", "self_contact.thickness");
  expect_bad_json("{\"thickness\": 1, \"friction\": -1}", "self_contact.friction");
  expect_bad_json("{\"thickness\": 1, \"radius\": 1}", "self_contact.radius");
}

/*------------------------------------- starts ---------------------------------------------------*/

static void intersecting_starts_are_refused(void **state) {
  (void)state;
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_scene *scene = surfaces(0, 0);
  add_sheet(scene, 3, 100, 1, 0, 0, 0, NULL);
  add_cloth(scene, 2, 100, (const double[3]){0.1, -0.3, -0.2}, (const double[3]){0, 0.2, 0},
            (const double[3]){0, 0, 0.5}, NULL);
  expect_refused_sim(scene, &opt, MSIM_ERR_ARG, "face 2 and face 8 intersect");
  assert_ok(msim_scene_set_self_contact(scene, 0, 0, err));
  msim_sim *sim = make_sim(scene, &opt);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Two sheets with a common border that is not merged; a rope through a sheet */
static void touching_starts_are_refused(void **state) {
  (void)state;
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_scene *scene = surfaces(0, 0);
  add_sheet(scene, 3, 100, 1, 0, 0, 0, NULL);
  add_sheet(scene, 3, 100, 1, 1, 0, 0, NULL);
  expect_refused_sim(scene, &opt, MSIM_ERR_ARG, "touch");
  msim_scene_destroy(scene);
  scene = surfaces(0, 0);
  const msim_rope rope = {.size = sizeof rope,
                          .n = 3,
                          .from = {0.1, 0.2, -0.5},
                          .to = {0.12, 0.21, 1},
                          .mass = 1,
                          .k = 10};
  add_sheet(scene, 3, 100, 1, 0, 0, 0, NULL);
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  expect_refused_sim(scene, &opt, MSIM_ERR_ARG, "spring 26 intersect");
  msim_scene_destroy(scene);
}

/* Flat and tilted sheets, whose triangles lie in a plane up to rounding, are no intersections. */
static void flat_sheets_may_start(void **state) {
  (void)state;
  unsigned seed = 5;
  for (int i = 0; i < 60; i++) {
    msim_scene *scene = surfaces(0, 0);
    double origin[3], row[3], column[3];
    for (int c = 0; c < 3; c++)
      origin[c] = (i % 3 ? 1 : 1000) * (uniform(&seed) - 0.5), row[c] = uniform(&seed) - 0.5,
      column[c] = uniform(&seed) - 0.5;
    add_cloth(scene, 12, 100, origin, row, column, NULL);
    const msim_options opt = options("velocity-verlet", 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 3, err));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void intersecting_states_are_refused(void **state) {
  (void)state;
  msim_scene *scene = two_sheets(0.3);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 5, err));
  msim_state s = state_of(sim);
  double *x = malloc(3 * (size_t)s.n * sizeof *x);
  memcpy(x, s.x, 3 * (size_t)s.n * sizeof *x);
  for (int32_t i = 64; i < s.n; i++) x[3 * i + 2] = i % 2 ? 0.02 : -0.02;
  const msim_state wrong = {.size = sizeof wrong, .n = s.n, .x = x, .v = s.v};
  msim_error why;
  expect_error(msim_sim_set_state(sim, &wrong, &why), MSIM_ERR_ARG, &why, "self_contact");
  assert_int_equal(state_of(sim).step, 5);
  assert_ok(msim_sim_step(sim, 5, err));
  free(x);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void unsupported_options_are_refused(void **state) {
  (void)state;
  msim_scene *scene = two_sheets(0.3);
  msim_options opt = options("auto", MSIM_H_AUTO);
  expect_refused_sim(scene, &opt, MSIM_ERR_UNSUPPORTED, "auto");
  opt = options("velocity-verlet", 1e-3), opt.tol = 1e-4;
  expect_refused_sim(scene, &opt, MSIM_ERR_UNSUPPORTED, "tol");
  opt = options("velocity-verlet", 1e-3), opt.collision = MSIM_COLLISION_EVENT;
  expect_refused_sim(scene, &opt, MSIM_ERR_UNSUPPORTED, "event");
  opt = options("velocity-verlet", 1e-3), opt.precision = MSIM_PRECISION_SINGLE;
  expect_refused_sim(scene, &opt, MSIM_ERR_UNSUPPORTED, "single");
  opt = options("respa", 1e-3);
  expect_refused_sim(scene, &opt, MSIM_ERR_UNSUPPORTED, "respa");
  msim_scene_destroy(scene);
}

/*------------------------------------- runs -----------------------------------------------------*/

static void threads_and_resumes_keep_the_bits(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler",
                                        "implicit-euler"};
  msim_scene *scene = two_sheets(0.3);
  for (int m = 0; m < 3; m++) {
    msim_options opt = options(methods[m], 2e-3), two = opt;
    two.threads = 2;
    msim_sim *whole = make_sim(scene, &opt), *threads = make_sim(scene, &two);
    assert_ok(msim_sim_step(whole, 60, err));
    checkpoint c = save(whole);
    msim_sim *resumed = resume(scene, &opt, &c);
    for (int i = 0; i < 60; i++) assert_ok(msim_sim_step(whole, 1, err));
    assert_ok(msim_sim_step(threads, 120, err));
    assert_true(stats_of(whole).contacts > 1000);
    expect_same(whole, threads, "threads");
    expect_same_end(whole, resumed, 60, "resumed"), msim_sim_destroy(resumed);
    free(c.bytes);
    msim_sim_destroy(whole), msim_sim_destroy(threads);
  }
  msim_scene_destroy(scene);
}

/* After each step that contact changes, a sim that starts from there makes the same next step: with
 * the forces there, not with those that the method has computed before contact. */
static void steps_depend_on_the_state_alone(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "trapezoidal", "dop853",
                                        "implicit-midpoint"};
  const double lower[9] = {1, 0, 0, 0, 1, 0, -1, -1, 0}, rest[3] = {0},
               upper[9] = {0.5, 0.1, 0.025, 0, 0.5, 0.025, -0.5, -0.4, 0.025}, down[3] = {0, 0, -1};
  msim_scene *scene = surfaces(0, 0.3);
  add_triangle(scene, 400, lower, rest);
  add_triangle(scene, 300, upper, down);
  for (int m = 0; m < 4; m++) {
    const msim_options opt = options(methods[m], 2e-3);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    for (int i = 0; i < 40; i++) {
      const msim_state s = state_of(sim);
      assert_ok(msim_sim_set_state(other, &s, err));
      assert_ok(msim_sim_step(sim, 1, err));
      assert_ok(msim_sim_step(other, 1, err));
      const msim_state a = state_of(sim), b = state_of(other);
      assert_memory_equal(a.x, b.x, 18 * sizeof *a.x);
      assert_memory_equal(a.v, b.v, 18 * sizeof *a.v);
    }
    assert_true(stats_of(sim).contacts > 2);
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(scene);
}

static void checkpoints_of_other_scenes_are_refused(void **state) {
  (void)state;
  msim_scene *scene = two_sheets(0.3), *other = two_sheets(0.2), *none = two_sheets(-1);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt), *b = make_sim(other, &opt), *c = make_sim(none, &opt);
  checkpoint with = save(sim), without = save(c);
  msim_error why;
  expect_error(msim_sim_load(b, with.bytes, with.length, &why), MSIM_ERR_ARG, &why, "self_contact");
  expect_error(msim_sim_load(c, with.bytes, with.length, &why), MSIM_ERR_ARG, &why, "self_contact");
  expect_error(msim_sim_load(sim, without.bytes, without.length, &why), MSIM_ERR_ARG, &why,
               "self_contact");
  free(with.bytes), free(without.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(b), msim_sim_destroy(c);
  msim_scene_destroy(scene), msim_scene_destroy(other), msim_scene_destroy(none);
}

/* Surfaces that never come near each other move as without self-contact in one island. */
static void nothing_changes_far_from_contact(void **state) {
  (void)state;
  msim_scene *with = surfaces(9.81, 0.3), *without = surfaces(9.81, -1);
  msim_scene *scenes[2] = {with, without};
  msim_sim *sims[2];
  for (int i = 0; i < 2; i++) {
    msim_options opt = options("velocity-verlet", 1e-3);
    opt.skip_off = MSIM_SKIP_ISLANDS | MSIM_SKIP_TWO_D | MSIM_SKIP_AT_REST;
    add_sheet(scenes[i], 8, 200, 0.5, 0, 0, 0, NULL);
    add_sheet(scenes[i], 7, 200, 0.4, 0.02, 0.01, 0.5, NULL);
    sims[i] = make_sim(scenes[i], &opt);
    assert_ok(msim_sim_step(sims[i], 100, err));
  }
  expect_same(sims[0], sims[1], "far");
  for (int i = 0; i < 2; i++) msim_sim_destroy(sims[i]), msim_scene_destroy(scenes[i]);
}

/* A pinned sheet that moves through another pinned one is refused, with step, time and particle;
 * the state stays. */
static void pins_that_force_an_intersection(void **state) {
  (void)state;
  enum { N = 9 };
  msim_scene *scene = surfaces(0, 0);
  int32_t lower[N], upper[N];
  double x[2 * 3 * N], t[2] = {0, 1};
  for (int32_t i = 0; i < N; i++) lower[i] = i, upper[i] = N + i;
  add_sheet(scene, 3, 100, 1, 0, 0, 0, NULL);
  add_sheet(scene, 3, 100, 0.5, 0.1, 0.05, 0.3, NULL);
  assert_ok(msim_scene_pin(scene, N, lower, err));
  assert_ok(msim_scene_pin(scene, N, upper, err));
  const msim_scene_view view = view_of(scene);
  for (int32_t i = 0; i < 6 * N; i++)
    x[i] = view.x[3 * N + i % (3 * N)] - (i >= 3 * N && i % 3 == 2 ? 0.6 : 0);
  const msim_motion motion = {
      .size = sizeof motion, .n = N, .particles = upper, .nt = 2, .t = t, .x = x};
  assert_ok(msim_scene_add_motion(scene, &motion, err));
  const msim_options opt = options("velocity-verlet", 0.01);
  msim_sim *sim = make_sim(scene, &opt);
  msim_error why;
  msim_status status = MSIM_OK;
  while (!status) status = msim_sim_step(sim, 1, &why);
  expect_error(status, MSIM_NOT_CONVERGED, &why, "pinned particles that move");
  assert_non_null(strstr(why.text, "step 5"));
  assert_int_equal(count_intersections(state_of(sim).x, view.nfaces, view.faces, 0, NULL), 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A sheet falls on the middle of another one, half of whose particles are removed then. */
static void edits_change_the_surface(void **state) {
  (void)state;
  msim_scene *scene = two_sheets(0.3);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 80, err));
  int32_t removed[8];
  for (int32_t i = 0; i < 8; i++) removed[i] = 24 + i;
  const msim_edit edit = {
      .size = sizeof edit, .nremoved_particles = 8, .removed_particles = removed};
  assert_ok(msim_sim_edit(sim, &edit, err));
  assert_ok(msim_scene_edit(scene, &edit, err));
  checkpoint c = save(sim);
  const msim_scene_view view = view_of(scene);
  for (int i = 0; i < 100; i++) {
    assert_ok(msim_sim_step(sim, 1, err));
    assert_int_equal(count_intersections(state_of(sim).x, view.nfaces, view.faces, 0, NULL), 0);
  }
  msim_scene *start = two_sheets(0.3);
  msim_sim *resumed = resume(start, &opt, &c);
  expect_same_end(sim, resumed, 100, "edited");
  msim_sim_destroy(resumed);
  free(c.bytes);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene), msim_scene_destroy(start);
}

static void fail_each_allocation(const char *method) {
  msim_scene *scene = two_sheets(0.3);
  const msim_options opt = options(method, 1e-3);
  for (int64_t which = 0;; which++) {
    msim_error why;
    msim_sim *sim;
    failing_allocator_count(FAILING_BY_MALLOC);
    failing_allocator_arm(which, 0);
    msim_status status = msim_sim_create(scene, &opt, &sim, &why);
    for (int i = 0; i < 60 && !status; i++) status = msim_sim_step(sim, 1, &why);
    const int failed = failing_allocator_has_failed();
    failing_allocator_arm(-1, 0);
    if (failed) {
      assert_true(status == MSIM_ERR_MEMORY || status == MSIM_OK); /* some memory is optional */
      if (sim) assert_ok(msim_sim_step(sim, 60, err));             /* the state was kept */
    }
    msim_sim_destroy(sim);
    assert_int_equal(failing_allocator_count_leaks(), 0);
    failing_allocator_count(FAILING_NONE);
    if (!failed) break;
  }
  msim_scene_destroy(scene);
}

static void want_of_memory(void **state) {
  (void)state;
  if (!FAILING_MALLOC) skip();
  fail_each_allocation("velocity-verlet");
  fail_each_allocation("linearly-implicit-euler");
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(wrong_values_are_refused),
                                     cmocka_unit_test(scene_files_keep_it),
                                     cmocka_unit_test(wrong_keys_are_refused),
                                     cmocka_unit_test(intersecting_starts_are_refused),
                                     cmocka_unit_test(touching_starts_are_refused),
                                     cmocka_unit_test(flat_sheets_may_start),
                                     cmocka_unit_test(intersecting_states_are_refused),
                                     cmocka_unit_test(unsupported_options_are_refused),
                                     cmocka_unit_test(threads_and_resumes_keep_the_bits),
                                     cmocka_unit_test(steps_depend_on_the_state_alone),
                                     cmocka_unit_test(checkpoints_of_other_scenes_are_refused),
                                     cmocka_unit_test(nothing_changes_far_from_contact),
                                     cmocka_unit_test(pins_that_force_an_intersection),
                                     cmocka_unit_test(edits_change_the_surface),
                                     cmocka_unit_test(want_of_memory)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
