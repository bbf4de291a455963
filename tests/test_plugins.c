/* Plugins from outside: a correct one is used, and every kind of broken one is refused or caught
 * in the act with the sentence that names it. FAKES is the folder of what fake_backend.c became. */
#define _GNU_SOURCE /* mkdtemp, realpath, chdir */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "scenes.h"

static void expect(const char *solver, const char *path, msim_status want, const char *sentence) {
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_options opt = options("linearly-implicit-euler", 0.01);
  msim_sim *sim = NULL;
  msim_error why = {0, ""};
  opt.solver = solver, opt.plugin_path = path;
  msim_status status = msim_sim_create(scene, &opt, &sim, &why);
  if (!status) {
    status = msim_sim_step(sim, 3, &why);
    if (status) assert_true(state_of(sim).step < 3 && isfinite(state_of(sim).v[10]));
  }
  if (status != want || !strstr(why.text, sentence))
    fail_msg("%s: status %d, \"%s\"; wanted %d, \"%s\"", solver, (int)status, why.text, (int)want,
             sentence);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void strangers_solve_as(const char *solver, int factorises) {
  msim_scene *scene = hanging_cloth(4, 100, 0.1);
  msim_options opt = options("linearly-implicit-euler", 0.01);
  opt.solver = solver, opt.plugin_path = FAKES, opt.solver_rtol = 1e-12;
  msim_sim *a = make_sim(scene, &opt);
  opt.solver = "pcg";
  msim_sim *b = make_sim(scene, &opt);
  assert_ok(msim_sim_step(a, 20, err));
  assert_ok(msim_sim_step(b, 20, err));
  for (int i = 0; i < 48; i++) assert_close(state_of(a).x[i], state_of(b).x[i], 1e-11);
  assert_int_equal(stats_of(a).factorizations, factorises ? 20 : 0);
  assert_int_equal(stats_of(a).iterations > 20, !factorises);
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene);
}

static void strangers_solve(void **state) {
  (void)state;
  strangers_solve_as("good", 1);
  strangers_solve_as("matrix_free", 0);
}

static void broken_tables_are_refused(void **state) {
  (void)state;
  expect("wrong_abi", FAKES, MSIM_ERR_ABI, "was built for backend ABI 99; this is msim");
  expect("short_table", FAKES, MSIM_ERR_ABI, "has a table of 16 bytes; the least is ");
  expect("other_name", FAKES, MSIM_ERR_PLUGIN, "calls itself 'somebody-else', not 'other_name'");
  expect("no_table", FAKES, MSIM_ERR_PLUGIN, "gave no table of functions");
  expect("no_entry", FAKES, MSIM_ERR_PLUGIN, "is no msim plugin: it has no msim_backend_entry");
}

static void lies_are_caught(void **state) {
  (void)state;
  expect("liar", FAKES, MSIM_NOT_CONVERGED, "solver liar left a residual of");
  expect("nan_answer", FAKES, MSIM_NOT_CONVERGED, "solver nan_answer left a residual of");
  expect("fails", FAKES, MSIM_ERR_BACKEND, "fails: the moon is in the wrong house for 21 unknowns");
  expect("silent", FAKES, MSIM_ERR_BACKEND, "silent: the library behind a plugin failed");
}

static void files_that_are_no_libraries(void **state) {
  (void)state;
  char folder[] = "/tmp/msim_plugins_XXXXXX", path[256];
  assert_non_null(mkdtemp(folder));
  snprintf(path, sizeof path, "%s/msim_backend_garbage.so", folder);
  FILE *file = fopen(path, "w");
  fputs("this is not a shared library\n", file);
  fclose(file);
  expect("garbage", folder, MSIM_ERR_PLUGIN, "msim_backend_garbage.so could not be loaded: ");
  remove(path);
  snprintf(path, sizeof path, "%s/msim_backend_folder.so", folder);
  assert_int_equal(mkdir(path, 0700), 0);
  expect("folder", folder, MSIM_ERR_PLUGIN, "msim_backend_folder.so could not be loaded: ");
  rmdir(path);
  rmdir(folder);
}

static void names_and_folders(void **state) {
  (void)state;
  expect("../" FAKES "/good", FAKES, MSIM_ERR_NAME, "is no backend's name");
  expect("Good", FAKES, MSIM_ERR_NAME, "is no backend's name");
  expect("goood", "/nowhere:" FAKES, MSIM_ERR_NAME,
         "not built in, and no msim_backend_goood.so in /nowhere, ");
  expect("good", "::/nowhere::" FAKES ":", MSIM_OK, "");
}

/* An empty folder in a path is not the current directory. */
static void the_current_directory_is_not_searched(void **state) {
  (void)state;
  char *before = realpath(".", NULL);
  assert_int_equal(chdir(FAKES), 0);
  unsetenv("MSIM_PLUGIN_PATH");
  expect("good", "", MSIM_ERR_NAME, "there is no solver 'good'");
  expect("good", ":", MSIM_ERR_NAME, "there is no solver 'good'");
  assert_int_equal(chdir(before), 0);
  free(before);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(strangers_solve),   cmocka_unit_test(broken_tables_are_refused),
      cmocka_unit_test(lies_are_caught),   cmocka_unit_test(files_that_are_no_libraries),
      cmocka_unit_test(names_and_folders), cmocka_unit_test(the_current_directory_is_not_searched)};
  return cmocka_run_group_tests_name("plugins", tests, NULL, NULL);
}
