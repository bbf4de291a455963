/* Tests of the example plugins recorder_example and importer_example, which the extension of a file
 * finds: what they write and read, and what they refuse. */
#define _GNU_SOURCE /* mkdtemp */
#include <locale.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "scene_check.h"
#include "scenes.h"

static char folder[] = "/tmp/msim_examples_XXXXXX";

static void write_file(const char *name, const char *text) {
  FILE *file = fopen(name, "w");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
}

/*------------------------------------- a recorder -----------------------------------------------*/

static msim_sim *swing(void) {
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_options opt = options("velocity-verlet", 0.01);
  opt.steps = 4, opt.every = 1, opt.plugin_path = FAKES;
  msim_sim *sim = make_sim(scene, &opt);
  msim_scene_destroy(scene);
  return sim;
}

static int record(msim_sim *sim, void *recorder) {
  (void)sim;
  return msim_recorder_write(recorder, NULL) != MSIM_OK;
}

static void frames_hold_the_positions(void **state) {
  (void)state;
  msim_sim *sim = swing();
  msim_recorder *recorder;
  assert_ok(msim_recorder_open(sim, "a.xyz", &recorder, err));
  assert_ok(msim_sim_run(sim, record, recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  FILE *file = fopen("a.xyz", "r");
  double x[27] = {0};
  for (int frame = 0; frame <= 4; frame++) {
    int n = 0, step = -1;
    double t;
    assert_int_equal(fscanf(file, "%d msim step %d, t = %lf s", &n, &step, &t), 3);
    assert_int_equal(n, 9);
    assert_int_equal(step, frame);
    for (int i = 0; i < 9; i++)
      assert_int_equal(fscanf(file, " P %lf %lf %lf", x + 3 * i, x + 3 * i + 1, x + 3 * i + 2), 3);
  }
  assert_int_equal(fscanf(file, " %*c"), EOF);
  fclose(file);
  assert_memory_equal(x, state_of(sim).x, sizeof x);
  msim_sim_destroy(sim);
}

/* It replaces its own files only, and does not continue them. */
static void other_files_are_kept(void **state) {
  (void)state;
  msim_sim *sim = swing();
  msim_recorder *recorder;
  assert_ok(msim_recorder_open(sim, "b.xyz", &recorder, err));
  assert_ok(msim_recorder_write(recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  assert_ok(msim_recorder_open(sim, "b.xyz", &recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  write_file("b.xyz", "1\nwater\nO 0 0 0\n");
  assert_int_equal(msim_recorder_open(sim, "b.xyz", &recorder, NULL), MSIM_ERR_IO);
  assert_int_equal(msim_recorder_resume(sim, "b.xyz", &recorder, NULL), MSIM_ERR_UNSUPPORTED);
  msim_sim_destroy(sim);
}

static void a_full_disk_is_reported(void **state) {
  (void)state;
  msim_sim *sim = swing();
  msim_recorder *recorder;
  msim_error why;
  struct rlimit before, limit;
  assert_ok(msim_recorder_open(sim, "c.xyz", &recorder, err));
  assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
  limit = before, limit.rlim_cur = 100;
  signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &limit);
  const msim_status status = msim_recorder_write(recorder, &why);
  msim_recorder_close(recorder, NULL);
  setrlimit(RLIMIT_FSIZE, &before);
  assert_int_equal(status, MSIM_ERR_IO);
  assert_string_equal(why.text, "xyz: c.xyz: cannot be written: File too large");
  msim_sim_destroy(sim);
}

/* A plugin has the name that its file says. */
static void a_renamed_plugin_is_refused(void **state) {
  (void)state;
  msim_sim *sim = swing();
  msim_recorder *recorder;
  msim_error why;
  assert_int_equal(symlink(FAKES "/msim_recorder_xyz.so", "msim_recorder_abc.so"), 0);
  setenv("MSIM_PLUGIN_PATH", folder, 1);
  assert_int_equal(msim_recorder_open(sim, "a.abc", &recorder, &why), MSIM_ERR_PLUGIN);
  setenv("MSIM_PLUGIN_PATH", FAKES, 1);
  assert_non_null(strstr(why.text, "/msim_recorder_abc.so contains plugin 'xyz', not 'abc'"));
  msim_sim_destroy(sim);
}

/*------------------------------------- an importer ----------------------------------------------*/

static const char net[] =
    "# two particles on a hook\n"
    "gravity 0 0 -9.81\n"
    "\n"
    "particle 0 0 2 1   # the hook\n"
    "particle 0.1 0 1.3333333333333333 0.2\n"
    "particle 1e-3 0 1 0.2\n"
    "pinned 0\n"
    "spring 0 1 500 0.7\n"
    "\tspring 1 2 400 0.25\n";

static const char json[] =
    "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"particles\": {\"x\": [[0, 0, 2], [0.1, 0, "
    "1.3333333333333333], [1e-3, 0, 1]], \"mass\": [1, 0.2, 0.2], \"pinned\": [0]}, \"springs\": "
    "{\"ij\": [[0, 1], [1, 2]], \"k\": [500, 400], \"rest\": [0.7, 0.25]}}";

static msim_scene *load(const char *name) {
  msim_scene *scene = NULL;
  assert_ok(msim_scene_load(NULL, name, &scene, err));
  return scene;
}

static void assert_same_scene(const msim_scene *a, const msim_scene *b) {
  char *left = text_of(a->data), *right = text_of(b->data);
  assert_string_equal(left, right);
  free(left), free(right);
}

static void a_net_is_read_and_written(void **state) {
  (void)state;
  msim_scene *wanted = NULL;
  write_file("a.net", net);
  assert_ok(msim_scene_parse(NULL, "text", json, sizeof json - 1, &wanted, err));
  assert_ok(msim_scene_pin(wanted, 1, &(int32_t){0}, err)); /* now its own text is not kept */
  msim_scene *read = load("a.net");
  assert_same_scene(read, wanted);
  if (!setlocale(LC_ALL, "de_DE.UTF-8")) print_message("no locale with a decimal comma\n");
  assert_ok(msim_scene_save(read, "b.net", err));
  msim_scene *again = load("b.net");
  setlocale(LC_ALL, "C");
  assert_same_scene(again, wanted);
  msim_scene_destroy(wanted), msim_scene_destroy(read), msim_scene_destroy(again);
}

static void defects_are_named(void **state) {
  (void)state;
  static const char *const cases[][2] = {
      {"particle 0 0 0 1\nspring 0 1\n", "a.net: line 2 is none of `gravity X Y Z`, "},
      {"point 0 0 0\n", "a.net: line 1 is none of "},
      {"particle 0 0 0 1 1\n", "a.net: line 1 is none of "},
      {"particle 0 0 0 1\npinned 0.5\n", "a.net: line 2 is none of "},
      {"particle 0 0 0 1\npinned nan\n", "a.net: line 2 is none of "},
      {"particle 0 0 0 0\n", "a.net: particles.mass[0] is 0"}, /* the host's check */
      {"particle 0 0 0 nan\n", "a.net: particles.mass[0] is nan"},
      {"particle 0 0 0 1\nspring 0 7 1 1\n", "a.net: springs.ij[0][1] is 7"},
      {"pinned 0\n", "a.net: particles.pinned belongs to no group"}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    msim_error why;
    msim_scene *scene;
    write_file("a.net", cases[i][0]);
    assert_int_equal(msim_scene_load(NULL, "a.net", &scene, &why), MSIM_ERR_ARG);
    if (strncmp(why.text, cases[i][1], strlen(cases[i][1])) != 0)
      fail_msg("\"%s\"; wanted \"%s\"", why.text, cases[i][1]);
  }
}

static void what_the_format_lacks_is_not_dropped(void **state) {
  (void)state;
  msim_error why;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  plane(scene, 0, 0, 1, -1, 0.5, 0);
  assert_int_equal(msim_scene_save(scene, "c.net", &why), MSIM_ERR_UNSUPPORTED);
  assert_string_equal(why.text,
                      "c.net: the format has no planes/0/normal; save the scene as *.json");
  assert_int_equal(access("c.net", F_OK), -1);
  assert_int_equal(access("c.net.part", F_OK), -1);
  msim_scene_destroy(scene);
}

static msim_status load_net(const msim_allocator *alloc, void *data) {
  (void)data;
  msim_scene *scene;
  const msim_status status = msim_scene_load(alloc, "a.net", &scene, NULL);
  msim_scene_destroy(scene);
  return status;
}

static void failed_allocations_leave_nothing(void **state) {
  (void)state;
  write_file("a.net", net);
  assert_true(expect_memory_errors(load_net, NULL) > 5);
}

static int enter_folder(void **state) {
  (void)state;
  setenv("MSIM_PLUGIN_PATH", FAKES, 1);
  return mkdtemp(folder) ? chdir(folder) : -1;
}

static int remove_folder(void **state) {
  char command[64];
  (void)state;
  snprintf(command, sizeof command, "rm -r %s", folder);
  return system(command);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(frames_hold_the_positions),
      cmocka_unit_test(other_files_are_kept),
      cmocka_unit_test(a_full_disk_is_reported),
      cmocka_unit_test(a_renamed_plugin_is_refused),
      cmocka_unit_test(a_net_is_read_and_written),
      cmocka_unit_test(defects_are_named),
      cmocka_unit_test(what_the_format_lacks_is_not_dropped),
      cmocka_unit_test(failed_allocations_leave_nothing),
  };
  return cmocka_run_group_tests_name("examples", tests, enter_folder, remove_folder);
}
