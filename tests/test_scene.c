/* Tests of scenes built by a program: what is refused, what is copied, and out-of-memory
 * handling. */
#include <math.h>

#include "scene_check.h"

static const double x3[9] = {0, 0, 0, 3, 4, 0, 1, 1, 1}, mass3[3] = {1, 2, 3};

/* Three particles and a spring, everything else by default. */
static msim_scene *bare(const msim_allocator *alloc) {
  static const int32_t ij[2] = {0, 1};
  static const double k[1] = {10};
  msim_scene *scene;
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x3, NULL, mass3, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, k, NULL, NULL, err));
  return scene;
}

/* A scene with everything. */
static msim_scene *sample(const msim_allocator *alloc) {
  static const double gravity[3] = {0, 1, -9.81};
  static const int32_t pinned[1] = {1};
  const msim_plane floor = {{0, 0, 1}, -1, 0.5, 0.25};
  msim_scene *scene = bare(alloc);
  assert_ok(msim_scene_set_name(scene, "sample", err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  assert_ok(msim_scene_set_drag(scene, 0.5, err));
  assert_ok(msim_scene_add_plane(scene, &floor, err));
  assert_ok(msim_scene_pin(scene, 1, pinned, err));
  assert_ok(ms_scene_add_run_option(scene, "h", "0.1", err));
  return scene;
}

/*------------------------------------- defaults -------------------------------------------------*/

static void what_is_left_out_has_defaults(void **state) {
  (void)state;
  msim_scene *scene = bare(NULL);
  const msim_scene_view view = view_of(scene);
  assert_string_equal(view.name, "");
  assert_int_equal(view.nparticles, 3);
  assert_memory_equal(view.x, x3, sizeof x3);
  for (int i = 0; i < 9; i++) assert_true(view.v[i] == 0);
  for (int i = 0; i < 3; i++) assert_false(view.pinned[i]);
  assert_true(view.rest[0] == 5 && view.damping[0] == 0 && view.drag == 0);
  assert_true(view.gravity[0] == 0 && view.gravity[1] == 0 && view.gravity[2] == 0);
  msim_scene_destroy(scene);
}

static void an_older_view_gets_what_it_knows(void **state) {
  (void)state;
  msim_scene *scene = sample(NULL);
  msim_scene_view view = {.size = offsetof(msim_scene_view, nsprings), .nsprings = -7};
  msim_scene_get(scene, &view);
  assert_int_equal(view.nparticles, 3);
  assert_int_equal(view.nsprings, -7);
  msim_scene_destroy(scene);
}

static void adding_nothing_is_legal(void **state) {
  (void)state;
  msim_scene *scene = sample(NULL);
  assert_ok(msim_scene_add_particles(scene, 0, NULL, NULL, NULL, err));
  assert_ok(msim_scene_add_springs(scene, 0, NULL, NULL, NULL, NULL, err));
  assert_ok(msim_scene_pin(scene, 0, NULL, err));
  assert_int_equal(view_of(scene).nparticles, 3);
  msim_scene_destroy(scene);
  msim_scene_destroy(NULL);
}

/* A normal of unit length, up to rounding, is stored bit by bit, and so is its offset. */
static void unit_normals_stay(void **state) {
  (void)state;
  msim_scene *scene;
  msim_scene_view view = {.size = sizeof view};
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 200; i++) {
    const msim_plane p = {{cos(0.1 * i), sin(0.1 * i), 0}, 0.1 * i, 1, 0};
    assert_ok(msim_scene_add_plane(scene, &p, err));
    msim_scene_get(scene, &view);
    assert_memory_equal(&view.planes[i], &p, sizeof p);
  }
  msim_scene_destroy(scene);
}

static void normals_are_scaled_once(void **state) {
  (void)state;
  msim_scene *scene = sample(NULL);
  const double third = 1 / sqrt(3);
  const msim_plane planes[] = {
      {{0, 0, 2}, 3, 1, 0}, {{1e-200, 0, 0}, 0, 1, 0}, {{third, third, third}, 0.1, 1, 0}};
  for (int i = 0; i < 3; i++) assert_ok(msim_scene_add_plane(scene, &planes[i], err));
  const msim_plane *got = view_of(scene).planes;
  assert_true(got[1].normal[2] == 1 && got[1].offset == 1.5);
  assert_true(got[2].normal[0] == 1);
  assert_memory_equal(&got[3], &planes[2], sizeof *got);
  msim_scene_destroy(scene);
}

/*------------------------------------- refusals -------------------------------------------------*/

static void bad_particles_are_refused(void **state) {
  (void)state;
  msim_scene *s = sample(NULL);
  const double nan_x[6] = {0, 0, 0, 0, NAN, 0}, inf_v[6] = {0, 0, 0, 0, 0, -INFINITY};
  const double zero[2] = {1, 0}, negative[2] = {-1, 1}, endless[2] = {1, INFINITY};
  assert_refused(s, msim_scene_add_particles(s, -1, x3, NULL, mass3, err), "-1");
  assert_refused(s, msim_scene_add_particles(s, 1, NULL, NULL, mass3, err), "NULL");
  assert_refused(s, msim_scene_add_particles(s, 1, x3, NULL, NULL, err), "NULL");
  assert_refused(s, msim_scene_add_particles(s, 2, nan_x, NULL, mass3, err),
                 "particles.x[1] is nan");
  assert_refused(s, msim_scene_add_particles(s, 2, x3, inf_v, mass3, err),
                 "particles.v[1] is -inf");
  assert_refused(s, msim_scene_add_particles(s, 2, x3, NULL, zero, err), "particles.mass[1] is 0");
  assert_refused(s, msim_scene_add_particles(s, 2, x3, NULL, negative, err), "mass[0] is -1");
  assert_refused(s, msim_scene_add_particles(s, 2, x3, NULL, endless, err), "mass[1] is inf");
  assert_refused(s, msim_scene_add_particles(s, INT32_MAX, x3, NULL, mass3, err),
                 "2147483650 particles exceed the limit of 715827882");
  const int32_t room = INT32_MAX / 3 - 3; /* values are checked only if the count is allowed */
  assert_refused(s, msim_scene_add_particles(s, room + 1, endless, NULL, mass3, err),
                 "715827883 particles exceed the limit of 715827882");
  assert_refused(s, msim_scene_add_particles(s, room, endless + 1, NULL, mass3, err),
                 "particles.x[0] is inf");
  msim_scene_destroy(s);
}

static void bad_springs_are_refused(void **state) {
  (void)state;
  msim_scene *s = sample(NULL);
  const int32_t good[2] = {0, 2}, far[4] = {0, 1, 0, 3}, below[2] = {-1, 0}, self[2] = {2, 2};
  const double k = 1, minus = -1, nan = NAN, two[2] = {1, 1};
  assert_refused(s, msim_scene_add_springs(s, -2, good, &k, NULL, NULL, err), "-2");
  assert_refused(s, msim_scene_add_springs(s, 1, NULL, &k, NULL, NULL, err), "NULL");
  assert_refused(s, msim_scene_add_springs(s, 1, good, NULL, NULL, NULL, err), "NULL");
  assert_refused(s, msim_scene_add_springs(s, 2, far, two, NULL, NULL, err),
                 "springs.ij[1] refers to particle 3; there are 3 particles");
  assert_refused(s, msim_scene_add_springs(s, 1, below, &k, NULL, NULL, err), "particle -1");
  assert_refused(s, msim_scene_add_springs(s, 1, self, &k, NULL, NULL, err), "connects particle 2");
  assert_refused(s, msim_scene_add_springs(s, 1, good, &minus, NULL, NULL, err), "springs.k[0]");
  assert_refused(s, msim_scene_add_springs(s, 1, good, &nan, NULL, NULL, err), "springs.k[0]");
  assert_refused(s, msim_scene_add_springs(s, 1, good, &k, &minus, NULL, err), "springs.rest[0]");
  assert_refused(s, msim_scene_add_springs(s, 1, good, &k, NULL, &nan, err), "springs.damping[0]");
  msim_scene_destroy(s);
}

static void bad_planes_are_refused(void **state) {
  (void)state;
  msim_scene *s = sample(NULL);
  const struct {
    msim_plane plane;
    const char *words;
  } bad[] = {{{{0, 0, 0}, 0, 1, 0}, "normal is 0; it must be a nonzero vector"},
             {{{0, NAN, 1}, 0, 1, 0}, "normal[1] is nan"},
             {{{0, 0, 1}, INFINITY, 1, 0}, "offset is inf"},
             {{{0, 0, 1e-300}, 1e300, 1, 0}, "offset / |normal| is not finite"},
             {{{0, 0, 1}, 0, 1.5, 0}, "restitution is 1.5"},
             {{{0, 0, 1}, 0, NAN, 0}, "restitution is nan"},
             {{{0, 0, 1}, 0, 1, -1}, "friction is -1"},
             {{{0, 0, 1}, 0, 1, INFINITY}, "friction is inf"}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
    assert_refused(s, msim_scene_add_plane(s, &bad[i].plane, err), bad[i].words);
  assert_refused(s, msim_scene_add_plane(s, NULL, err), "NULL");
  msim_scene_destroy(s);
}

static void bad_pins_are_refused(void **state) {
  (void)state;
  msim_scene *s = sample(NULL), *empty;
  const double v[3] = {0, 0, 1e-300};
  const int32_t far[2] = {1, 3}, below[1] = {-1}, moving[2] = {0, 3}, none[1] = {0};
  assert_refused(s, msim_scene_pin(s, 2, far, err), "pinned[1] is 3; there are 3 particles");
  assert_refused(s, msim_scene_pin(s, 1, below, err), "pinned[0] is -1");
  assert_refused(s, msim_scene_pin(s, 1, NULL, err), "NULL");
  assert_ok(msim_scene_add_particles(s, 1, x3, v, mass3, err));
  assert_refused(s, msim_scene_pin(s, 2, moving, err), "pinned[1] is particle 3, whose velocity");
  assert_ok(msim_scene_create(NULL, &empty, err));
  assert_int_equal(msim_scene_pin(empty, 1, none, NULL), MSIM_ERR_ARG);
  msim_scene_destroy(empty);
  msim_scene_destroy(s);
}

static void other_bad_values_are_refused(void **state) {
  (void)state;
  msim_scene *s = sample(NULL);
  const double nan_g[3] = {0, 0, NAN};
  assert_refused(s, msim_scene_set_gravity(s, nan_g, err), "gravity[2] is nan");
  assert_refused(s, msim_scene_set_gravity(s, NULL, err), "NULL");
  assert_refused(s, msim_scene_set_drag(s, -1, err), "drag is -1");
  assert_refused(s, msim_scene_set_drag(s, NAN, err), "drag is nan");
  assert_refused(s, msim_scene_set_name(s, NULL, err), "NULL");
  msim_scene_destroy(s);
}

/*------------------------------------- sharing, memory ------------------------------------------*/

static msim_status change_name(msim_scene *s, msim_error *err) {
  return msim_scene_set_name(s, "new", err);
}

static msim_status change_gravity(msim_scene *s, msim_error *err) {
  return msim_scene_set_gravity(s, x3 + 3, err);
}

static msim_status change_drag(msim_scene *s, msim_error *err) {
  return msim_scene_set_drag(s, 1, err);
}

static msim_status change_particles(msim_scene *s, msim_error *err) {
  return msim_scene_add_particles(s, 3, x3, x3, mass3, err);
}

static msim_status change_springs(msim_scene *s, msim_error *err) {
  const int32_t ij[4] = {1, 2, 0, 2};
  return msim_scene_add_springs(s, 2, ij, mass3, NULL, mass3, err);
}

static msim_status change_planes(msim_scene *s, msim_error *err) {
  const msim_plane wall = {{1, 0, 0}, -9, 1, 0};
  return msim_scene_add_plane(s, &wall, err);
}

static msim_status change_pins(msim_scene *s, msim_error *err) {
  const int32_t pins[2] = {2, 0};
  return msim_scene_pin(s, 2, pins, err);
}

static msim_status change_rope(msim_scene *s, msim_error *err) {
  const int32_t pinned[1] = {0};
  const msim_rope rope = {.size = sizeof rope,
                          .n = 9,
                          .to = {1, 0, 0},
                          .mass = 1,
                          .k = 1,
                          .npinned = 1,
                          .pinned = pinned};
  return msim_scene_add_rope(s, &rope, err);
}

static msim_status change_cloth(msim_scene *s, msim_error *err) {
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 3,
                            .columns = 4,
                            .row = {1, 0, 0},
                            .column = {0, 1, 0},
                            .mass = 1,
                            .k_shear = 1};
  return msim_scene_add_cloth(s, &cloth, err);
}

static msim_status change_lattice(msim_scene *s, msim_error *err) {
  const msim_lattice lattice = {
      .size = sizeof lattice, .n = {2, 3, 2}, .extent = {1, 1, 1}, .mass = 1, .k = 1};
  return msim_scene_add_lattice(s, &lattice, err);
}

static msim_status change_planes_constrain(msim_scene *s, msim_error *err) {
  return msim_scene_set_planes_constrain(s, 1, err);
}

static msim_status change_run(msim_scene *s, msim_error *err) {
  return ms_scene_add_run_option(s, "solver", "pcg", err);
}

static msim_status (*const changes[])(msim_scene *, msim_error *) = {change_name,
                                                                     change_gravity,
                                                                     change_drag,
                                                                     change_particles,
                                                                     change_springs,
                                                                     change_planes,
                                                                     change_pins,
                                                                     change_rope,
                                                                     change_cloth,
                                                                     change_lattice,
                                                                     change_planes_constrain,
                                                                     change_run};
enum { NCHANGES = sizeof changes / sizeof *changes };

/* The text of the sample after the change. */
static char *text_after(int change) {
  msim_scene *scene = sample(NULL);
  assert_ok(changes[change](scene, err));
  char *text = text_of(scene->data);
  msim_scene_destroy(scene);
  return text;
}

static void shared_data_never_changes(void **state) {
  (void)state;
  for (int i = 0; i < NCHANGES; i++) {
    limited_allocator memory;
    const msim_allocator alloc = make_limited_allocator(&memory);
    msim_scene *scene = sample(&alloc);
    ms_scene *shared = ms_scene_retain(scene->data);
    char *before = text_of(shared);
    assert_ok(changes[i](scene, err));
    assert_ptr_not_equal(scene->data, shared);
    char *after = text_of(shared), *changed = text_of(scene->data);
    assert_string_equal(before, after);
    assert_string_not_equal(before, changed);
    ms_scene *own = scene->data;
    assert_ok(changes[i](scene, err));
    assert_ptr_equal(scene->data, own);
    free(before), free(after), free(changed);
    msim_scene_destroy(scene);
    ms_scene_release(shared);
    assert_int_equal(memory.live, 0);
  }
}

/* Fail the change after ever more allocations, until it succeeds. */
static void starve(int change, int shared) {
  char *wanted = text_after(change);
  msim_status status = MSIM_ERR_MEMORY;
  for (int allowed = 0; status; allowed++) {
    limited_allocator memory;
    const msim_allocator alloc = make_limited_allocator(&memory);
    msim_scene *scene = sample(&alloc);
    ms_scene *other = shared ? ms_scene_retain(scene->data) : NULL;
    char *before = text_of(scene->data);
    msim_error err = {0, ""};
    memory.remaining = allowed;
    status = changes[change](scene, &err);
    memory.remaining = -1;
    char *after = text_of(scene->data);
    assert_string_equal(after, status ? before : wanted);
    if (status) {
      assert_int_equal(status, MSIM_ERR_MEMORY);
      assert_int_equal(err.status, MSIM_ERR_MEMORY);
      assert_non_null(strstr(err.text, "memory"));
    }
    free(before), free(after);
    msim_scene_destroy(scene);
    ms_scene_release(other);
    assert_int_equal(memory.live, 0);
  }
  free(wanted);
}

static void want_of_memory_changes_nothing(void **state) {
  (void)state;
  for (int i = 0; i < NCHANGES; i++) starve(i, 0), starve(i, 1);
}

static void no_scene_without_memory(void **state) {
  (void)state;
  limited_allocator memory;
  const msim_allocator alloc = make_limited_allocator(&memory);
  for (int allowed = 0; allowed < 3; allowed++) {
    msim_scene *scene = (msim_scene *)&memory;
    memory.remaining = allowed;
    assert_int_equal(msim_scene_create(&alloc, &scene, NULL), MSIM_ERR_MEMORY);
    assert_null(scene);
    assert_int_equal(memory.live, 0);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_left_out_has_defaults),
                                     cmocka_unit_test(an_older_view_gets_what_it_knows),
                                     cmocka_unit_test(adding_nothing_is_legal),
                                     cmocka_unit_test(normals_are_scaled_once),
                                     cmocka_unit_test(unit_normals_stay),
                                     cmocka_unit_test(bad_particles_are_refused),
                                     cmocka_unit_test(bad_springs_are_refused),
                                     cmocka_unit_test(bad_planes_are_refused),
                                     cmocka_unit_test(bad_pins_are_refused),
                                     cmocka_unit_test(other_bad_values_are_refused),
                                     cmocka_unit_test(shared_data_never_changes),
                                     cmocka_unit_test(want_of_memory_changes_nothing),
                                     cmocka_unit_test(no_scene_without_memory)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
