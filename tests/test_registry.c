/* Tests of the search for recorders and importers by the extension of a file, and of recorders that
 * the program brings itself. */
#define _GNU_SOURCE /* mkdtemp */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msim/recorder.h"
#include "scenes.h"

static char folder[] = "/tmp/msim_registry_XXXXXX";

static const char *in_folder(const char *name) {
  static char path[128];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return path;
}

/*------------------------------------- a recorder of the program --------------------------------*/

static int opened, frames, closed;

static msim_status count_open(const msim_host *host, const msim_recording *what, void **self) {
  (void)host, (void)what;
  *self = &opened;
  opened++;
  return MSIM_OK;
}

static msim_status count_frame(void *self, const msim_frame *frame) {
  (void)self, (void)frame;
  frames++;
  return MSIM_OK;
}

static msim_status count_close(void *self) {
  (void)self;
  closed++;
  return MSIM_OK;
}

static msim_recorder_type counter(const char *extension) {
  opened = frames = closed = 0;
  return (msim_recorder_type){.abi = MSIM_RECORDER_ABI,
                              .size = sizeof(msim_recorder_type),
                              .name = "counter",
                              .extension = extension,
                              .library = "none",
                              .license = "MIT",
                              .open = count_open,
                              .write = count_frame,
                              .close = count_close,
                              .open_ended = 1};
}

static int record(msim_sim *sim, void *recorder) {
  (void)sim;
  return msim_recorder_write(recorder, NULL) != MSIM_OK;
}

/* Five frames of a flight, by the recorder that the extension selects; tol: of error control. */
static msim_status record_flight(const msim_recorder_type *own, const char *name, double tol,
                                 msim_error *why) {
  const msim_recorder_type *const recorders[] = {own, NULL};
  const double x[3] = {0, 0, 1}, v[3] = {0.1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  msim_options opt = options(tol > 0 ? "dop853" : "verlet", 0.1);
  opt.recorders = recorders, opt.tol = tol, opt.every = 1, opt.plugin_path = "/nowhere";
  opt.t_end = tol > 0 ? 0.4 : -1, opt.steps = tol > 0 ? -1 : 4;
  msim_sim *sim = make_sim(scene, &opt);
  msim_recorder *recorder;
  const msim_status status = msim_recorder_open(sim, in_folder(name), &recorder, why);
  if (!status) {
    assert_ok(msim_sim_run(sim, record, recorder, err));
    assert_ok(msim_recorder_close(recorder, err));
  }
  remove(in_folder(name));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return status;
}

static void a_program_brings_recorders(void **state) {
  (void)state;
  static const char *const extensions[] = {".frames", ".csv", ".html", ".vtkhdf", ".Q&A"};
  for (int i = 0; i < 5; i++) {
    char name[32];
    const msim_recorder_type own = counter(extensions[i]);
    snprintf(name, sizeof name, "a.b%s", extensions[i]);
    assert_ok(record_flight(&own, name, 0, err));
    assert_int_equal(opened, 1);
    assert_int_equal(frames, 5);
    assert_int_equal(closed, 1);
  }
  const msim_recorder_type other = counter(".frames");
  assert_ok(record_flight(&other, "a.csv", 0, err));
  assert_int_equal(opened, 0);
}

/* Without that member the number of frames must be known. */
static void an_open_ended_recorder_takes_all_steps_of_error_control(void **state) {
  (void)state;
  msim_error why;
  msim_recorder_type own = counter(".frames");
  assert_ok(record_flight(&own, "a.frames", 1e-6, err));
  assert_true(frames > 1);
  own.open_ended = 0;
  assert_int_equal(record_flight(&own, "a.frames", 1e-6, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "use fps in place of every"));
  own.open_ended = 1, own.size = offsetof(msim_recorder_type, open_ended);
  assert_int_equal(record_flight(&own, "a.frames", 1e-6, &why), MSIM_ERR_ARG);
}

static void refuse(msim_recorder_type own, msim_status want, const char *sentence) {
  msim_error why;
  const msim_status status = record_flight(&own, "a.frames", 0, &why);
  if (status != want || !strstr(why.text, sentence))
    fail_msg("status %d, \"%s\"; wanted %d, \"%s\"", (int)status, why.text, (int)want, sentence);
  assert_int_equal(opened, 0);
}

static void tables_are_checked(void **state) {
  (void)state;
  const msim_recorder_type good = counter(".frames");
  msim_recorder_type bad[10];
  for (int i = 0; i < 10; i++) bad[i] = good;
  bad[0].abi = 99, bad[1].size = 16;
  bad[2].name = bad[3].library = bad[4].license = NULL;
  bad[5].open = NULL, bad[6].write = NULL, bad[7].close = NULL, bad[8].extension = NULL;
  bad[9].abi = 0;
  refuse(bad[0], MSIM_ERR_ABI,
         "a.frames: the recorder in this program was built for recorder ABI 99, but msim ");
  refuse(bad[1], MSIM_ERR_ABI,
         "the recorder in this program has a function table of 16 bytes, but at least ");
  static const char *const names[] = {"name", "library", "license", "open", "write", "close"};
  for (int i = 0; i < 6; i++) {
    char sentence[64];
    snprintf(sentence, sizeof sentence,
             "the function table of the recorder in this program lacks `%s`", names[i]);
    refuse(bad[2 + i], MSIM_ERR_PLUGIN, sentence);
  }
  refuse(bad[8], MSIM_ERR_NAME, "unknown recorder 'frames'");
  refuse(bad[9], MSIM_ERR_ABI, "was built for recorder ABI 0, but msim ");
}

static void what_was_looked_for_is_told(void **state) {
  (void)state;
  static const char *const cases[][2] = {
      {"a.txt",
       "/a.txt: the file name of a trajectory must end in .html, .vtkhdf, .pvd, .csv or the "
       "extension of a plugin: unknown recorder 'txt': msim_recorder_txt.so was not found in "
       "/nowhere, "},
      {"a.csw",
       "unknown recorder 'csw' (did you mean 'csv'?): msim_recorder_csw.so was not found in "},
      {"a.TXT", "'TXT' is not a valid name of a recorder; names consist of a-z, 0-9, '_' and '-'"},
      {"txt", "or the extension of a plugin: the name has no extension"},
      {"a.csv/b", "or the extension of a plugin: the name has no extension"},
      {"a.hdf5", /* the plugin of that name has another extension */
       "/a.hdf5: the file name of a trajectory must end in .html, .vtkhdf, .pvd, .csv or the "
       "extension of a plugin: "}};
  for (int i = 0; i < 6; i++) {
    msim_error why;
    const msim_recorder_type own = counter(".frames");
    assert_int_equal(record_flight(&own, cases[i][0], 0, &why), MSIM_ERR_NAME);
    if (!strstr(why.text, cases[i][1])) fail_msg("\"%s\"; wanted \"%s\"", why.text, cases[i][1]);
  }
}

/* The name is that of a known plugin, whose file is missing. */
static void a_missing_plugin_is_named(void **state) {
  (void)state;
  msim_error why;
  const msim_recorder_type own = counter(".frames");
  setenv("MSIM_PLUGIN_PATH", "/nowhere", 1);
  assert_int_equal(record_flight(&own, "a.vtkhdf", 0, &why), MSIM_ERR_NAME);
  assert_non_null(
      strstr(why.text, "/a.vtkhdf: recorder 'hdf5': msim_recorder_hdf5.so was not found in "));
}

/*------------------------------------- lists ----------------------------------------------------*/

/* What lies beyond the size that the caller gives is not touched. */
static void lists_fill_as_much_as_the_caller_has(void **state) {
  (void)state;
  int32_t (*const lists[])(int32_t, const char *, msim_plugin_entry *, msim_error *) = {
      msim_solver_info, msim_recorder_info, msim_importer_info, msim_comm_info};
  static const char *const first[] = {"auto", "csv", "hdf5", "mpi"};
  static const int32_t lengths[] = {10, 4, 2, 1};
  for (int i = 0; i < 4; i++) {
    msim_error why;
    msim_plugin_entry entry = {.available = -5};
    assert_int_equal(lists[i](0, NULL, &entry, &why), 0);
    assert_int_equal(why.status, MSIM_ERR_SIZE);
    assert_string_equal(why.text, "entry->size is 0; set it to sizeof(msim_plugin_entry)");
    assert_int_equal(lists[i](0, NULL, &entry, NULL), 0);
    entry.size = offsetof(msim_plugin_entry, available);
    assert_int_equal(lists[i](0, NULL, &entry, &why), 1);
    assert_string_equal(entry.name, first[i]);
    assert_int_equal(entry.available, -5);
    entry.size = sizeof entry;
    assert_int_equal(lists[i](lengths[i] - 1, NULL, &entry, &why), 1);
    assert_in_range(entry.available, 0, 1);
    if (entry.available && (i == 1 || i == 2)) {
      assert_ptr_equal(strstr(entry.library, i == 1 ? "HDF5 " : "Assimp "), entry.library);
      assert_string_equal(entry.license, "BSD-3-Clause");
    }
    assert_int_equal(lists[i](lengths[i], NULL, &entry, &why), 0);
    assert_int_equal(why.status, MSIM_OK);
    assert_int_equal(lists[i](-1, NULL, &entry, &why), 0);
    assert_int_equal(lists[i](INT32_MAX, NULL, &entry, &why), 0);
  }
}

/*------------------------------------- importers ------------------------------------------------*/

static msim_status load_text(const char *name, const char *text, msim_error *why) {
  msim_scene *scene;
  FILE *file = fopen(in_folder(name), "w");
  fputs(text, file);
  fclose(file);
  const msim_status status = msim_scene_load(NULL, in_folder(name), &scene, why);
  msim_scene_destroy(scene);
  remove(in_folder(name));
  return status;
}

/* JSON is read whatever the name, if no importer takes it. */
static void scenes_are_json_by_default(void **state) {
  (void)state;
  static const char *const names[] = {"a", "a.json", "a.txt", "a.JSON", "json.a b", "a.hdf5"};
  for (int i = 0; i < 6; i++)
    assert_ok(load_text(names[i],
                        " \n{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0]], "
                        "\"mass\": 1}}",
                        err));
  msim_error why;
  assert_int_equal(load_text("a.net", "point 0 0 0\n", &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text,
                         "/a.net is not a JSON scene; unknown importer 'net': "
                         "msim_importer_net.so was not found in "));
  assert_int_equal(load_text("a.json", "point 0 0 0\n", &why), MSIM_ERR_ARG);
  assert_null(strstr(why.text, "importer"));
  assert_int_equal(load_text("a.net", "{\"msim\": 2}", &why), MSIM_ERR_ARG);
  assert_null(strstr(why.text, "importer"));
}

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
  (void)state;
  return rmdir(folder);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_program_brings_recorders),
      cmocka_unit_test(an_open_ended_recorder_takes_all_steps_of_error_control),
      cmocka_unit_test(tables_are_checked),
      cmocka_unit_test(what_was_looked_for_is_told),
      cmocka_unit_test(lists_fill_as_much_as_the_caller_has),
      cmocka_unit_test(scenes_are_json_by_default),
      cmocka_unit_test(a_missing_plugin_is_named), /* the last one, as it hides the plugins */
  };
  return cmocka_run_group_tests_name("registry", tests, make_folder, remove_folder);
}
