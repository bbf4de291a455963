/* Tests of loading solver plugins: where they are searched for, which ones are refused, and the
 * message with the reason. */
#define _GNU_SOURCE /* mkdtemp, realpath, chdir, symlink, RTLD_NOLOAD */
#include <dlfcn.h>
#include <sys/stat.h>

#include "checkpoints.h"
#include "faulty_plugins.h"
#include "msim/backend.h"

#define TEXT_(x) #x
#define TEXT(x)  TEXT_(x)
#define VERSION  TEXT(MSIM_VERSION_MAJOR) "." TEXT(MSIM_VERSION_MINOR) "." TEXT(MSIM_VERSION_PATCH)
#define LEAST    "88" /* MSIM_BACKEND_SIZE_1 where pointers have 8 bytes */

/*------------------------------------- correct plugins ------------------------------------------*/

static void strangers_solve_as(const char *solver, int factorizes) {
  msim_scene *scene = hanging_cloth(4, 100, 0.1);
  msim_options opt = options("linearly-implicit-euler", 0.01);
  opt.solver = solver, opt.plugin_path = FAKES, opt.solver_rtol = 1e-12;
  msim_sim *a = make_sim(scene, &opt);
  opt.solver = "pcg";
  msim_sim *b = make_sim(scene, &opt);
  assert_ok(msim_sim_step(a, 20, err));
  assert_ok(msim_sim_step(b, 20, err));
  for (int i = 0; i < 48; i++) assert_close(state_of(a).x[i], state_of(b).x[i], 1e-11);
  assert_int_equal(stats_of(a).factorizations, factorizes ? 20 : 0);
  assert_int_equal(stats_of(a).iterations > 20, !factorizes);
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene);
}

static void third_party_plugins_solve(void **state) {
  (void)state;
  strangers_solve_as("good", 1);
  strangers_solve_as("matrix_free", 0);
}

/* Coarse factors depend on the matrix alone, so that a resumed run has the same bits. */
static void two_levels_depend_on_the_state_alone(void **state) {
  (void)state;
  msim_scene *scene = pinned_block(8, 1, 3000, 7);
  msim_options opt = options("linearly-implicit-euler", 0.01);
  opt.solver = "matrix_free", opt.plugin_path = FAKES;
  msim_sim *a = make_sim(scene, &opt);
  assert_ok(msim_sim_step(a, 5, err));
  const checkpoint c = save(a);
  msim_sim *b = resume(scene, &opt, &c);
  assert_ok(msim_sim_step(a, 5, err));
  assert_ok(msim_sim_step(b, 5, err));
  expect_same(a, b, "resumed");
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene);
  free(c.bytes);
}

/* Threads of BLAS and OpenMP run inside a plugin: it stays loaded when the last sim is
 * destroyed. */
static void plugins_stay_loaded(void **state) {
  (void)state;
  copy_plugin("stays_loaded");
  assert_null(dlopen(plugin_file("stays_loaded"), RTLD_NOW | RTLD_NOLOAD));
  expect_message("stays_loaded", plugin_folder, MSIM_OK, "");
  assert_non_null(dlopen(plugin_file("stays_loaded"), RTLD_NOW | RTLD_NOLOAD));
}

/*------------------------------------- tables ---------------------------------------------------*/

static void tables_are_checked(void **state) {
  (void)state;
  const plugin_case attempts[] = {
      {"long_table", MSIM_OK, ""}, /* of a later msim: the new members are not used */
      {"no_order", MSIM_OK, ""},
      {"wrong_abi", MSIM_ERR_ABI,
       "@/msim_backend_wrong_abi.so was built for backend ABI 99, but msim " VERSION
       " has ABI 1; rebuild it"},
      {"short_table", MSIM_ERR_ABI,
       "@/msim_backend_short_table.so has a function table of 16 bytes, but at least " LEAST
       " are required; rebuild it"},
      {"shorter_by_one", MSIM_ERR_ABI,
       "@/msim_backend_shorter_by_one.so has a function table of ..."},
      {"no_name", MSIM_ERR_PLUGIN,
       "@/msim_backend_no_name.so contains plugin '', not 'no_name'; ..."},
      {"other_name", MSIM_ERR_PLUGIN,
       "@/msim_backend_other_name.so contains plugin 'somebody-else', not 'other_name'; ..."},
      {"no_library", MSIM_ERR_PLUGIN,
       "the function table of @/msim_backend_no_library.so lacks `library`"},
      {"no_license", MSIM_ERR_PLUGIN,
       "the function table of @/msim_backend_no_license.so lacks `license`"},
      {"no_create", MSIM_ERR_PLUGIN,
       "the function table of @/msim_backend_no_create.so lacks `create`"},
      {"no_analyze", MSIM_ERR_PLUGIN,
       "the function table of @/msim_backend_no_analyze.so lacks `analyze`"},
      {"no_factor", MSIM_ERR_PLUGIN,
       "the function table of @/msim_backend_no_factor.so lacks `factor`"},
      {"no_solve", MSIM_ERR_PLUGIN,
       "the function table of @/msim_backend_no_solve.so lacks `solve`"},
      {"no_destroy", MSIM_ERR_PLUGIN,
       "the function table of @/msim_backend_no_destroy.so lacks `destroy`"},
      {"format_3", MSIM_ERR_PLUGIN,
       "@/msim_backend_format_3.so requests the unknown matrix format 3; rebuild it for this "
       "version of msim"},
      {"format_minus_1", MSIM_ERR_PLUGIN,
       "@/msim_backend_format_minus_1.so requests the unknown matrix format -1; ..."},
      {"no_table", MSIM_ERR_PLUGIN,
       "@/msim_backend_no_table.so: msim_backend_entry() returned NULL; ..."},
  };
  EXPECT_PLUGINS(attempts);
}

/*------------------------------------- files ----------------------------------------------------*/

static void put_text(const char *name, const char *text) {
  FILE *file = fopen(plugin_file(name), "w");
  fputs(text, file);
  fclose(file);
}

/* The message ends with that of the dynamic linker. */
static void files_that_are_no_plugins(void **state) {
  (void)state;
  put_text("garbage", "this is not a shared library\n");
  put_text("nothing", "");
  assert_int_equal(mkdir(plugin_file("folder"), 0700), 0);
  assert_int_equal(symlink("/nowhere/at/all", plugin_file("dangling")), 0);
  assert_int_equal(symlink(FAKES "/msim_backend_no_entry.so", plugin_file("no_entry")), 0);
  const plugin_case attempts[] = {
      {"garbage", MSIM_ERR_PLUGIN,
       "solver 'garbage': @/msim_backend_garbage.so cannot be loaded: ..."},
      {"nothing", MSIM_ERR_PLUGIN,
       "solver 'nothing': @/msim_backend_nothing.so cannot be loaded: ..."},
      {"folder", MSIM_ERR_PLUGIN,
       "solver 'folder': @/msim_backend_folder.so cannot be loaded: ..."},
      {"dangling", MSIM_ERR_NAME,
       "unknown solver 'dangling': msim_backend_dangling.so was not found in @, ..."},
      {"no_entry", MSIM_ERR_PLUGIN,
       "solver 'no_entry': @/msim_backend_no_entry.so is not a plugin of this kind for msim: it "
       "does not export msim_backend_entry"},
  };
  for (size_t i = 0; i < sizeof attempts / sizeof *attempts; i++)
    expect_message(attempts[i].name, plugin_folder, attempts[i].status, attempts[i].sentence);
}

static void unreadable_files(void **state) {
  (void)state;
  if (geteuid() == 0) skip(); /* root may read everything */
  copy_plugin("secret");
  assert_int_equal(chmod(plugin_file("secret"), 0), 0);
  expect_message("secret", plugin_folder, MSIM_ERR_PLUGIN,
                 "solver 'secret': @/msim_backend_secret.so cannot be loaded: ...");
}

/*------------------------------------- names and folders ----------------------------------------*/

/* A name is part of a file name, and must not lead out of the folders. */
static void names_are_checked(void **state) {
  (void)state;
  static const char *const names[] = {"../good", "/tmp/good", FAKES "/good", "a/b",    "Good",
                                      "",        "go od",     "good.so",     "good\n", "g\xc3\xb6"};
  char sentence[1024];
  for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
    snprintf(sentence, sizeof sentence,
             "unknown solver '%s': '%s' is not a valid name of a backend; names consist of a-z, "
             "0-9, '_' and '-'",
             names[i], names[i]);
    for (char *c = sentence; *c; c++)
      if (*c == '\n') *c = ' '; /* messages contain no line breaks */
    expect_message(names[i], FAKES, MSIM_ERR_NAME, sentence);
  }
}

static void long_names_fit_in_no_folder(void **state) {
  (void)state;
  static char name[8192];
  memset(name, 'a', sizeof name - 1);
  expect_message(name, FAKES, MSIM_ERR_NAME, "unknown solver 'aaaaaaaa...");
}

static void folders_are_searched_in_order(void **state) {
  (void)state;
  char path[1024];
  put_text("good", "this is not a shared library\n");
  snprintf(path, sizeof path, FAKES ":%s", plugin_folder);
  expect_message("good", path, MSIM_OK, "");
  snprintf(path, sizeof path, "%s:" FAKES, plugin_folder); /* the search ends at a broken plugin */
  expect_message("good", path, MSIM_ERR_PLUGIN,
                 "solver 'good': @/msim_backend_good.so cannot be loaded: ...");
  setenv("MSIM_PLUGIN_PATH", FAKES, 1);
  expect_message("good", NULL, MSIM_OK, "");
  expect_message("good", "/nowhere", MSIM_OK, "");
  expect_message("good", plugin_folder, MSIM_ERR_PLUGIN,
                 "solver 'good': @/msim_backend_good.so cannot be loaded: ...");
  setenv("MSIM_PLUGIN_PATH", plugin_folder, 1);
  expect_message("good", FAKES, MSIM_OK, "");
  unsetenv("MSIM_PLUGIN_PATH");
  expect_message("goood", "/nowhere:" FAKES, MSIM_ERR_NAME,
                 "unknown solver 'goood': msim_backend_goood.so was not found in /nowhere, " FAKES
                 ", ...");
}

/* A folder may be relative to the working directory, but an empty one does not mean that. */
static void relative_and_empty_folders(void **state) {
  (void)state;
  const char *slash = strrchr(FAKES, '/') + 1;
  char *before = realpath(".", NULL);
  assert_int_equal(chdir(FAKES "/.."), 0);
  expect_message("good", slash, MSIM_OK, "");
  assert_int_equal(chdir(FAKES), 0);
  expect_message("good", ".", MSIM_OK, "");
  expect_message("good", "::/nowhere::.:", MSIM_OK, "");
  static const char *const empty[] = {"", ":", "::", "/nowhere::"};
  for (size_t i = 0; i < sizeof empty / sizeof *empty; i++) {
    expect_message("good", empty[i], MSIM_ERR_NAME,
                   "unknown solver 'good': msim_backend_good.so was not found in ...");
    setenv("MSIM_PLUGIN_PATH", empty[i], 1);
    expect_message("good", NULL, MSIM_ERR_NAME,
                   "unknown solver 'good': msim_backend_good.so was not found in ...");
    unsetenv("MSIM_PLUGIN_PATH");
  }
  assert_int_equal(chdir(before), 0);
  free(before);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(third_party_plugins_solve),
      cmocka_unit_test(two_levels_depend_on_the_state_alone),
      cmocka_unit_test(plugins_stay_loaded),
      cmocka_unit_test(tables_are_checked),
      cmocka_unit_test(files_that_are_no_plugins),
      cmocka_unit_test(unreadable_files),
      cmocka_unit_test(names_are_checked),
      cmocka_unit_test(long_names_fit_in_no_folder),
      cmocka_unit_test(folders_are_searched_in_order),
      cmocka_unit_test(relative_and_empty_folders),
  };
  return cmocka_run_group_tests_name("plugins", tests, make_folder, remove_folder);
}
