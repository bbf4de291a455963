/* Tests of scene files in JSON: what they may contain, how they are written, and that a scene which
 * is written and read back agrees bit by bit. */
#define _POSIX_C_SOURCE 200809L
#include <locale.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "scene_check.h"
#include "scenes.h"

static msim_scene *parse(const msim_allocator *alloc, const char *text) {
  msim_scene *scene;
  assert_ok(msim_scene_parse(alloc, "test", text, strlen(text), &scene, err));
  return scene;
}

/* Every section, every key. */
static const char full[] =
    "{\"msim\": 1, \"name\": \"\\u00e4 \\\"b\\\" \\n\", \"gravity\": [0, 1e-3, -9.81], \"drag\": "
    "0.5,"
    " \"particles\": {\"x\": [[0, 0, 0], [3, 4, 0], [-0.0, 5e-324, 1e300]],"
    "   \"v\": [[0, 0, 0], [1, 2, 3], [0.1, -0.0, 1e-308]], \"mass\": [1, 2, 0.3], \"pinned\": "
    "[0]},"
    " \"springs\": {\"ij\": [[1, 0], [0, 5]], \"k\": [0, 7], \"rest\": [0, 0.1], \"damping\": 2},"
    " \"planes\": [{\"normal\": [0, 0, 2], \"offset\": 1}, {\"normal\": [1, 2, 3],"
    "   \"offset\": -0.7, \"restitution\": 0.3, \"friction\": 0.4}], \"planes_constrain\": true,"
    " \"objects\": [{\"type\": \"rope\", \"n\": 3, \"from\": [0, 0, 0], \"to\": [0, 0, 1],"
    "   \"mass\": 1, \"k\": 5, \"damping\": 0.1, \"pinned\": [2]}],"
    " \"run\": {\"integrator\": \"heun\", \"h\": 0.1, \"steps\": 12345678901234, \"t_end\": 1e-7,"
    "   \"heun.collision\": \"literal\", \"skip.drag\": \"off\"}}";

/*------------------------------------- reading --------------------------------------------------*/

static void a_small_file_has_defaults(void **state) {
  (void)state;
  msim_scene *scene = parse(NULL,
                            "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0], [3, 4, 0]], "
                            "\"mass\": 2}, \"springs\": {\"ij\": [[0, 1]], \"k\": 9}, \"planes\": "
                            "[{\"normal\": [0, 0, 1], \"offset\": 0}]}");
  const msim_scene_view view = view_of(scene);
  const double zero[6] = {0};
  assert_string_equal(view.name, "");
  assert_memory_equal(view.gravity, zero, sizeof view.gravity);
  assert_memory_equal(view.v, zero, sizeof zero);
  assert_true(view.drag == 0 && view.mass[0] == 2 && view.mass[1] == 2 && !view.pinned[0]);
  assert_true(view.k[0] == 9 && view.rest[0] == 5 && view.damping[0] == 0);
  assert_true(view.planes[0].restitution == 1 && view.planes[0].friction == 0);
  assert_int_equal(scene->data->nrun, 0);
  msim_scene_destroy(scene);
}

static void a_full_file_is_read(void **state) {
  (void)state;
  msim_scene *scene = parse(NULL, full);
  const msim_scene_view view = view_of(scene);
  const double x[9] = {0, 0, 0, 3, 4, 0, -0.0, 5e-324, 1e300};
  const double v[9] = {0, 0, 0, 1, 2, 3, 0.1, -0.0, 1e-308};
  const double gravity[3] = {0, 1e-3, -9.81};
  const uint8_t pinned[6] = {1, 0, 0, 0, 0, 1};
  assert_string_equal(view.name, "\xc3\xa4 \"b\" \n");
  assert_memory_equal(view.gravity, gravity, sizeof gravity);
  assert_true(view.drag == 0.5);
  assert_int_equal(view.nparticles, 6);
  assert_memory_equal(view.x, x, sizeof x);
  assert_memory_equal(view.v, v, sizeof v);
  assert_true(view.mass[1] == 2 && view.mass[2] == 0.3 && view.mass[3] == 1.0 / 3);
  assert_memory_equal(view.pinned, pinned, sizeof pinned);
  assert_int_equal(view.nplanes, 2);
  assert_true(view.planes[0].normal[2] == 1 && view.planes[0].offset == 0.5);
  assert_close(view.planes[1].offset, -0.7 / sqrt(14), 1e-16);
  assert_true(view.planes[1].restitution == 0.3 && view.planes[1].friction == 0.4);
  assert_int_equal(view.planes_constrain, 1);
  msim_scene_destroy(scene);
}

/* The springs of the file itself come first, and may end at particles of objects. */
static void springs_come_before_those_of_objects(void **state) {
  (void)state;
  msim_scene *scene = parse(NULL, full);
  const msim_scene_view view = view_of(scene);
  const int32_t ij[8] = {1, 0, 0, 5, 3, 4, 4, 5};
  const double k[4] = {0, 7, 5, 5}, rest[4] = {0, 0.1, 0.5, 0.5}, damping[4] = {2, 2, 0.1, 0.1};
  assert_int_equal(view.nsprings, 4);
  assert_memory_equal(view.ij, ij, sizeof ij);
  assert_memory_equal(view.k, k, sizeof k);
  assert_memory_equal(view.rest, rest, sizeof rest);
  assert_memory_equal(view.damping, damping, sizeof damping);
  msim_scene_destroy(scene);
}

#define CLOTH                                                                                \
  "{\"msim\": 1, \"objects\": [{\"type\": \"cloth\", \"n\": [3, 4], \"origin\": [1, 2, 3], " \
  "\"row\": [0, 0, -1], \"column\": [2, 0, 0], \"mass\": 3, "

/* An object in a file gives the same scene as the same object added by the API. */
static void objects_are_those_of_the_api(void **state) {
  (void)state;
  msim_scene *api;
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 3,
                            .columns = 4,
                            .origin = {1, 2, 3},
                            .row = {0, 0, -1},
                            .column = {2, 0, 0},
                            .mass = 3,
                            .k_structural = 10,
                            .k_bend = 1,
                            .damping = 0.5};
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {2, 3, 4},
                                .origin = {0, 0, 1},
                                .extent = {1, 2, 3},
                                .mass = 1,
                                .k = 4};
  msim_scene *file = parse(
      NULL, CLOTH
      "\"k\": {\"structural\": 10, \"bend\": 1}, \"damping\": 0.5}, {\"type\": \"lattice\","
      "\"n\": [2, 3, 4], \"origin\": [0, 0, 1], \"size\": [1, 2, 3], \"mass\": 1, \"k\": 4}]}");
  assert_ok(msim_scene_create(NULL, &api, err));
  assert_ok(msim_scene_add_cloth(api, &cloth, err));
  assert_ok(msim_scene_add_lattice(api, &lattice, err));
  assert_non_null(ms_scene_make_writable(file, NULL));
  char *a = text_of(api->data), *b = text_of(file->data);
  assert_string_equal(a, b);
  free(a), free(b);
  msim_scene_destroy(api);
  msim_scene_destroy(file);
}

static void one_k_is_for_all_springs_of_a_cloth(void **state) {
  (void)state;
  msim_scene *scene = parse(NULL, CLOTH "\"k\": 8}]}");
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nsprings, 17 + 12 + 10);
  for (int e = 0; e < view.nsprings; e++) assert_true(view.k[e] == 8);
  msim_scene_destroy(scene);
}

static void particles_of_a_cloth_have_names(void **state) {
  (void)state;
  const struct {
    const char *text, *held;
  } cases[] = {{"[\"corners\"]", "100100001001"},
               {"[\"first_row\"]", "111100000000"},
               {"[\"first_corners\"]", "100100000000"},
               {"\"corners\"", "100100001001"},
               {"[5, \"first_corners\", 5]", "100101000000"},
               {"[]", "000000000000"}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    char text[512];
    snprintf(text, sizeof text, CLOTH "\"k\": 1, \"pinned\": %s}]}", cases[i].text);
    msim_scene *scene = parse(NULL, text);
    const msim_scene_view view = view_of(scene);
    for (int p = 0; p < 12; p++) assert_int_equal(view.pinned[p], cases[i].held[p] == '1');
    msim_scene_destroy(scene);
  }
}

static void run_sets_options(void **state) {
  (void)state;
  msim_scene *scene = parse(NULL, full);
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  assert_ok(msim_options_from_scene(&opt, scene, err));
  assert_string_equal(opt.integrator, "heun");
  assert_true(opt.h == 0.1 && opt.t_end == 1e-7);
  assert_int_equal(opt.steps, 12345678901234);
  assert_int_equal(opt.heun_collision, MSIM_HEUN_LITERAL);
  assert_int_equal(opt.skip_off, MSIM_SKIP_DRAG);
  msim_scene_destroy(scene);
}

/*------------------------------------- writing --------------------------------------------------*/

static void assert_same(const msim_scene *a, const msim_scene *b) {
  const msim_scene_view u = view_of(a), v = view_of(b);
  const size_t n = (size_t)u.nparticles * sizeof(double), m = (size_t)u.nsprings * sizeof(double);
  assert_int_equal(u.nparticles, v.nparticles);
  assert_int_equal(u.nsprings, v.nsprings);
  assert_int_equal(u.nplanes, v.nplanes);
  assert_string_equal(u.name, v.name);
  assert_memory_equal(u.gravity, v.gravity, sizeof u.gravity);
  assert_memory_equal(&u.drag, &v.drag, sizeof u.drag);
  assert_memory_equal(u.x, v.x, 3 * n);
  assert_memory_equal(u.v, v.v, 3 * n);
  assert_memory_equal(u.mass, v.mass, n);
  assert_memory_equal(u.pinned, v.pinned, (size_t)u.nparticles);
  assert_memory_equal(u.ij, v.ij, m);
  assert_memory_equal(u.k, v.k, m);
  assert_memory_equal(u.rest, v.rest, m);
  assert_memory_equal(u.damping, v.damping, m);
  assert_int_equal(u.planes_constrain, v.planes_constrain);
  assert_memory_equal(u.planes, v.planes, (size_t)u.nplanes * sizeof *u.planes);
  assert_int_equal(a->data->nrun, b->data->nrun);
  for (int32_t i = 0; i < a->data->nrun; i++) {
    assert_string_equal(a->data->run[i].name, b->data->run[i].name);
    assert_string_equal(a->data->run[i].value, b->data->run[i].value);
  }
}

/* Numbers of many magnitudes, with all digits of the mantissa. */
static msim_scene *awkward(void) {
  enum { N = 50 };
  msim_scene *scene = parse(NULL, full);
  double x[3 * N], v[3 * N], mass[N], k[N - 1], rest[N - 1];
  int32_t ij[2 * (N - 1)];
  for (int i = 0; i < 3 * N; i++) {
    x[i] = sin(i) * pow(10, i % 37 - 18);
    v[i] = i % 5 ? 1.0 / (i + 1) : -0.0;
  }
  for (int i = 0; i < N; i++) mass[i] = exp(i - 20.0);
  for (int i = 0; i < N - 1; i++) {
    ij[2 * i] = i, ij[2 * i + 1] = i + 1;
    k[i] = 1e17 + 1e3 * i;
    rest[i] = ldexp(1 + i, -1074);
  }
  assert_ok(msim_scene_add_particles(scene, N, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, N - 1, ij, k, rest, NULL, err));
  return scene;
}

static void what_is_written_is_read_back_to_the_bit(void **state) {
  (void)state;
  msim_scene *scene = awkward();
  char *text = text_of(scene->data);
  msim_scene *again = parse(NULL, text);
  assert_same(scene, again);
  assert_non_null(strstr(text, "\"h\": 0.1,"));
  assert_non_null(strstr(text, "\"heun.collision\": \"literal\""));
  free(text);
  msim_scene_destroy(again);
  msim_scene_destroy(scene);
}

/* Where values are omitted or written once for all, 0 and -0 are distinguished. */
static void zeros_keep_their_signs(void **state) {
  (void)state;
  const double x[6] = {1, 2, 3, 4, 5, 6}, v[6] = {0, 0, -0.0, 0, 0, 0}, mass[2] = {1, 1};
  const int32_t ij[4] = {0, 1, 1, 0};
  const double k[2] = {1, 1}, rest[2] = {0, -0.0}, damping[2] = {-0.0, -0.0};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, rest, damping, err));
  char *text = text_of(scene->data);
  msim_scene *again = parse(NULL, text);
  assert_same(scene, again);
  free(text);
  msim_scene_destroy(again);
  msim_scene_destroy(scene);
}

static void a_scene_not_changed_is_its_file(void **state) {
  (void)state;
  msim_scene *scene = parse(NULL, full);
  char *text = text_of(scene->data);
  assert_string_equal(text, full);
  free(text);
  assert_ok(msim_scene_set_drag(scene, 0.5, err));
  text = text_of(scene->data);
  assert_string_not_equal(text, full);
  msim_scene *again = parse(NULL, text);
  assert_same(scene, again);
  free(text);
  msim_scene_destroy(again);
  msim_scene_destroy(scene);
}

/* A comma as the decimal separator must neither be written to files nor change what is read. */
static void the_locale_does_not_matter(void **state) {
  (void)state;
  require(setlocale(LC_NUMERIC, "de_DE.UTF-8") != NULL, "the locale de_DE.UTF-8");
  char number[16];
  snprintf(number, sizeof number, "%.1f", 0.5);
  msim_scene *scene = awkward();
  char *text = text_of(scene->data);
  msim_scene *again = parse(NULL, text);
  setlocale(LC_NUMERIC, "C");
  assert_string_equal(number, "0,5");
  assert_same(scene, again);
  free(text);
  msim_scene_destroy(again);
  msim_scene_destroy(scene);
}

static void some_scenes_cannot_be_written(void **state) {
  (void)state;
  msim_scene *scene;
  msim_error err;
  assert_int_equal(msim_scene_create(NULL, &scene, &err), MSIM_OK);
  assert_int_equal(msim_scene_save(scene, "nothing.json", &err), MSIM_ERR_ARG);
  assert_non_null(strstr(err.text, "the scene has no particles"));
  msim_scene_destroy(scene);
  scene = parse(NULL, full);
  assert_int_equal(msim_scene_set_name(scene, "\xff", &err), MSIM_OK);
  assert_int_equal(msim_scene_save(scene, "nothing.json", &err), MSIM_ERR_ARG);
  assert_non_null(strstr(err.text, "UTF-8"));
  assert_int_equal(access("nothing.json", F_OK), -1);
  msim_scene_destroy(scene);
}

/*------------------------------------- files ----------------------------------------------------*/

static char folder[] = "/tmp/msim_test_XXXXXX";

static int enter(void **state) {
  (void)state;
  return mkdtemp(folder) && chdir(folder) == 0 ? 0 : -1;
}

static int leave(void **state) {
  (void)state;
  return chdir("/") == 0 && rmdir(folder) == 0 ? 0 : -1;
}

static void a_saved_scene_can_be_loaded(void **state) {
  (void)state;
  msim_scene *scene = awkward(), *again;
  assert_ok(msim_scene_save(scene, "a.json", err));
  assert_ok(msim_scene_save(scene, "a.json", err));
  assert_ok(msim_scene_load(NULL, "a.json", &again, err));
  assert_same(scene, again);
  assert_int_equal(access("a.json.part", F_OK), -1);
  remove("a.json");
  msim_scene_destroy(again);
  msim_scene_destroy(scene);
}

static void assert_load_fails(const char *path, msim_status status, const char *words) {
  msim_error err;
  msim_scene *scene = (msim_scene *)&err;
  assert_int_equal(msim_scene_load(NULL, path, &scene, &err), status);
  assert_null(scene);
  assert_non_null(strstr(err.text, path));
  assert_non_null(strstr(err.text, words));
}

static void files_that_cannot_be_read_are_named(void **state) {
  (void)state;
  assert_load_fails("nowhere.json", MSIM_ERR_IO, "No such file or directory");
  assert_load_fails("/tmp", MSIM_ERR_IO, "Is a directory");
  assert_load_fails("/dev/null", MSIM_ERR_ARG, "it is empty");
  assert_load_fails("scene.h5", MSIM_ERR_IO, "No such file or directory");
}

static void assert_save_fails(const char *path, msim_status status, const char *words) {
  msim_error err;
  msim_scene *scene = parse(NULL, full);
  assert_int_equal(msim_scene_save(scene, path, &err), status);
  assert_non_null(strstr(err.text, path));
  assert_non_null(strstr(err.text, words));
  msim_scene_destroy(scene);
}

static void files_that_cannot_be_written_are_named(void **state) {
  (void)state;
  assert_save_fails("nowhere/a.json", MSIM_ERR_IO, "No such file or directory");
  assert_int_equal(mkdir("taken", 0700), 0);
  assert_save_fails("taken", MSIM_ERR_IO, "directory");
  assert_int_equal(access("taken.part", F_OK), -1);
  rmdir("taken");
}

/* If the disk is full while a scene is written, the old file stays. */
static void a_write_cut_short_leaves_the_old_file(void **state) {
  (void)state;
  msim_scene *scene = parse(NULL, full), *again;
  assert_ok(msim_scene_save(scene, "a.json", err));
  struct rlimit limit, small;
  assert_int_equal(getrlimit(RLIMIT_FSIZE, &limit), 0);
  small = limit;
  small.rlim_cur = 100;
  signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  msim_error err;
  msim_status status = msim_scene_save(scene, "a.json", &err);
  setrlimit(RLIMIT_FSIZE, &limit);
  assert_int_equal(status, MSIM_ERR_IO);
  assert_non_null(strstr(err.text, "a.json: cannot be written: File too large"));
  assert_int_equal(access("a.json.part", F_OK), -1);
  assert_int_equal(msim_scene_load(NULL, "a.json", &again, &err), MSIM_OK);
  remove("a.json");
  msim_scene_destroy(again);
  msim_scene_destroy(scene);
}

/*------------------------------------- memory and arguments -------------------------------------*/

static msim_status parse_all(const msim_allocator *alloc, void *data) {
  msim_scene *scene = data;
  msim_error err;
  const msim_status status = msim_scene_parse(alloc, "test", full, sizeof full - 1, &scene, &err);
  if (status) {
    assert_null(scene);
    assert_non_null(strstr(err.text, "test: out of memory"));
  }
  msim_scene_destroy(scene);
  return status;
}

static void want_of_memory_leaves_nothing(void **state) {
  char any;
  (void)state;
  assert_true(expect_memory_errors(parse_all, &any) > 20);
}

static void null_is_refused(void **state) {
  (void)state;
  msim_scene *scene;
  assert_int_equal(msim_scene_parse(NULL, "test", full, 9, NULL, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_scene_parse(NULL, NULL, full, 9, &scene, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_scene_parse(NULL, "test", NULL, 9, &scene, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_scene_parse(NULL, "test", full, 0, &scene, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_scene_load(NULL, NULL, &scene, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_scene_save(NULL, "a.json", NULL), MSIM_ERR_ARG);
}

static void scenes_that_ship_can_be_run(void **state) {
  (void)state;
  msim_scene *scene;
  for (size_t i = 0; (scene = load_shipped_scene(i)) != NULL; i++) {
    msim_options opt;
    msim_options_init(&opt, sizeof opt);
    assert_ok(msim_options_from_scene(&opt, scene, err));
    assert_non_null(opt.integrator);
    assert_true(opt.t_end > 0 && *view_of(scene).name);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_small_file_has_defaults),
                                     cmocka_unit_test(a_full_file_is_read),
                                     cmocka_unit_test(springs_come_before_those_of_objects),
                                     cmocka_unit_test(objects_are_those_of_the_api),
                                     cmocka_unit_test(one_k_is_for_all_springs_of_a_cloth),
                                     cmocka_unit_test(particles_of_a_cloth_have_names),
                                     cmocka_unit_test(run_sets_options),
                                     cmocka_unit_test(what_is_written_is_read_back_to_the_bit),
                                     cmocka_unit_test(zeros_keep_their_signs),
                                     cmocka_unit_test(a_scene_not_changed_is_its_file),
                                     cmocka_unit_test(the_locale_does_not_matter),
                                     cmocka_unit_test(some_scenes_cannot_be_written),
                                     cmocka_unit_test(a_saved_scene_can_be_loaded),
                                     cmocka_unit_test(files_that_cannot_be_read_are_named),
                                     cmocka_unit_test(files_that_cannot_be_written_are_named),
                                     cmocka_unit_test(a_write_cut_short_leaves_the_old_file),
                                     cmocka_unit_test(want_of_memory_leaves_nothing),
                                     cmocka_unit_test(null_is_refused),
                                     cmocka_unit_test(scenes_that_ship_can_be_run)};
  return cmocka_run_group_tests(tests, enter, leave);
}
