/* Tests of the front end of recording, with CSV: what is refused, when a file gets its name, what
 * it holds. */
#define _GNU_SOURCE /* mkdtemp */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "scenes.h"

static char folder[] = "/tmp/msim_recorder_XXXXXX";

static const char *in_folder(const char *name) {
  static char path[128];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return path;
}

static msim_sim *flight(int64_t steps, int64_t every, int32_t sync) {
  const double x[3] = {0, 0, 1}, v[3] = {0.1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  msim_options opt = options("verlet", 0.1);
  opt.steps = steps, opt.every = every, opt.sync = sync;
  msim_sim *sim = make_sim(scene, &opt);
  msim_scene_destroy(scene);
  return sim;
}

static int exists(const char *name) { return access(in_folder(name), F_OK) == 0; }

static int record(msim_sim *sim, void *recorder) {
  (void)sim;
  return msim_recorder_write(recorder, NULL) != MSIM_OK;
}

/* The last line of the file holds the bits of the state. */
static void frames_hold_the_state(void **state) {
  (void)state;
  msim_sim *sim = flight(10, 4, MSIM_SYNC_OFF);
  msim_recorder *recorder;
  assert_ok(msim_recorder_open(sim, in_folder("a.csv"), &recorder, err));
  assert_true(exists("a.csv") && !exists("a.csv.part"));
  assert_ok(msim_sim_run(sim, record, recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  assert_ok(msim_recorder_close(NULL, err));
  FILE *file = fopen(in_folder("a.csv"), "r");
  char line[512], last[512] = "";
  int lines = 0;
  for (; fgets(line, sizeof line, file); lines++) strcpy(last, line);
  fclose(file);
  assert_int_equal(lines, 1 + 4); /* header; steps 0, 4, 8, 10 */
  double n[9];
  assert_int_equal(sscanf(last, "%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", n, n + 1, n + 2, n + 3,
                          n + 4, n + 5, n + 6, n + 7, n + 8),
                   9);
  msim_state s = state_of(sim);
  assert_true(n[0] == 10 && n[1] == s.t);
  assert_memory_equal(n + 3, s.x, 3 * sizeof *n);
  assert_memory_equal(n + 6, s.v, 3 * sizeof *n);
  assert_true(stats_of(sim).output_s > 0);
  msim_sim_destroy(sim);
}

/* Each measured time is a part of the time of the run, which is at most that of the clock. */
static void times_are_those_of_the_run(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler", "bdf2"};
  msim_scene *scene = hanging_cloth(8, 100, 0);
  plane(scene, 0, 0, 1, -0.1, 0.5, 0.2);
  for (int m = 0; m < 3; m++) {
    const double start = ms_clock_now();
    msim_options opt = options(methods[m], 0.001);
    opt.steps = 20, opt.solver = "pcg";
    msim_sim *sim = make_sim(scene, &opt);
    msim_recorder *recorder;
    assert_ok(msim_recorder_open(sim, in_folder("times.csv"), &recorder, err));
    assert_ok(msim_sim_run(sim, record, recorder, err));
    assert_ok(msim_recorder_close(recorder, err));
    const msim_stats s = stats_of(sim);
    const double parts[] = {s.force_s,    s.collide_s, s.output_s,
                            s.assemble_s, s.factor_s,  s.solve_s};
    for (int i = 0; i < (m ? 6 : 3); i++) assert_true(parts[i] > 0 && parts[i] < s.total_s);
    assert_true(s.total_s < ms_clock_now() - start);
    remove(in_folder("times.csv"));
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

static void refuse(msim_sim *sim, const char *name, msim_status want, const char *sentence) {
  msim_recorder *recorder = NULL;
  msim_error why;
  msim_status status = msim_recorder_open(sim, in_folder(name), &recorder, &why);
  if (status != want || !strstr(why.text, sentence))
    fail_msg("%s: status %d, \"%s\"", name, (int)status, why.text);
  assert_null(recorder);
  assert_false(exists("a.csv.part"));
}

static void what_cannot_be_written_is_refused(void **state) {
  (void)state;
  msim_sim *sim = flight(10, 1, MSIM_SYNC_OFF), *endless = flight(-1, 1, MSIM_SYNC_OFF);
  msim_sim *many = flight(20000000, 1, MSIM_SYNC_OFF);
  refuse(sim, "a.txt", MSIM_ERR_NAME,
         "a.txt: the file name of a trajectory must end in .html, .vtkhdf, .pvd, .csv or the "
         "extension of a plugin");
  refuse(sim, "a", MSIM_ERR_NAME, "end in .html, .vtkhdf, .pvd, .csv or ");
  refuse(sim, "nowhere/a.csv", MSIM_ERR_IO, "No such file or directory");
  refuse(endless, "a.csv", MSIM_ERR_ARG, "the run has no end");
  refuse(many, "a.csv", MSIM_ERR_ARG, "would have more than 10000000 frames");
  assert_int_equal(mkdir(in_folder("folder.csv"), 0700), 0);
  refuse(sim, "folder.csv", MSIM_ERR_IO, "exists and is not a regular file");
  rmdir(in_folder("folder.csv"));
  assert_int_equal(mkfifo(in_folder("pipe.csv"), 0600), 0);
  refuse(sim, "pipe.csv", MSIM_ERR_IO, "exists and is not a regular file");
  unlink(in_folder("pipe.csv"));
  msim_sim_destroy(sim), msim_sim_destroy(endless), msim_sim_destroy(many);
}

/* The square of a finite speed may overflow. */
static void energies_are_numbers(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {1e160, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 0);
  msim_options opt = options("velocity-verlet", 1e-170);
  opt.steps = 1;
  msim_sim *sim = make_sim(scene, &opt);
  msim_recorder *recorder;
  msim_error why;
  assert_ok(msim_recorder_open(sim, in_folder("a.csv"), &recorder, err));
  assert_int_equal(msim_recorder_write(recorder, &why), MSIM_NOT_FINITE);
  assert_string_equal(
      why.text,
      "step 0, t = 0 s: the energy is not a finite number; use a smaller h or another integrator");
  assert_ok(msim_recorder_close(recorder, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static msim_recorder *opened(msim_sim *sim, const char *name) {
  msim_recorder *recorder;
  assert_ok(msim_recorder_open(sim, in_folder(name), &recorder, err));
  return recorder;
}

/* In any order, and also within one process. */
static void only_one_writes_a_file(void **state) {
  (void)state;
  msim_sim *sim = flight(10, 1, MSIM_SYNC_OFF);
  msim_recorder *first = opened(sim, "a.csv"), *second = NULL;
  refuse(sim, "a.csv", MSIM_ERR_IO, "is in use by another recorder");
  assert_int_equal(msim_recorder_replace(sim, in_folder("a.csv"), &second, NULL), MSIM_ERR_IO);
  assert_null(second);
  assert_ok(msim_recorder_write(first, err));
  assert_ok(msim_recorder_close(first, err));
  assert_ok(msim_recorder_close(opened(sim, "a.csv"), err));
  msim_sim_destroy(sim);
}

static void put_text(const char *name, const char *text) {
  FILE *file = fopen(in_folder(name), "w");
  assert_true(file && fputs(text, file) >= 0 && fclose(file) == 0);
}

/* output_file.c calls this function instead of that of the C library; counted: syncs of the folder
 * once the file has its name */
static int folder_syncs;

int fsync(int fd) {
  struct stat it, there;
  assert_true(fstat(fd, &it) == 0 && stat(folder, &there) == 0);
  folder_syncs += it.st_dev == there.st_dev && it.st_ino == there.st_ino && exists("a.csv") &&
                  !exists("a.csv.part");
  return 0;
}

/* A rename changes the folder, and a power cut may undo it until the folder is synced. */
static void with_sync_a_new_name_outlives_a_power_cut(void **state) {
  (void)state;
  for (int sync = 0; sync < 2; sync++) {
    msim_sim *sim = flight(10, 1, sync);
    unlink(in_folder("a.csv"));
    folder_syncs = 0;
    assert_ok(msim_recorder_close(opened(sim, "a.csv"), err));
    assert_int_equal(folder_syncs, sync);
    msim_sim_destroy(sim);
  }
}

/* Only an empty file or a table of msim is overwritten. */
static void what_is_not_ours_stays(void **state) {
  (void)state;
  static const char *const others[] = {"name,phone\n", "s", "step,t,particle\n"};
  msim_sim *sim = flight(10, 1, MSIM_SYNC_OFF);
  msim_recorder *recorder;
  for (int i = 0; i < 3; i++) {
    put_text("a.csv", others[i]);
    refuse(sim, "a.csv", MSIM_ERR_IO, "exists and is not a trajectory of msim");
    char text[32] = "";
    FILE *file = fopen(in_folder("a.csv"), "r");
    assert_non_null(fgets(text, sizeof text, file));
    fclose(file);
    assert_string_equal(text, others[i]);
  }
  assert_ok(msim_recorder_replace(sim, in_folder("a.csv"), &recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  assert_ok(msim_recorder_close(opened(sim, "a.csv"), err));
  put_text("a.csv", "");
  assert_ok(msim_recorder_close(opened(sim, "a.csv"), err));
  msim_sim_destroy(sim);
}

static void csv_files_cannot_be_resumed(void **state) {
  (void)state;
  msim_sim *sim = flight(10, 1, MSIM_SYNC_OFF);
  msim_recorder *recorder = NULL;
  msim_error why;
  assert_int_equal(msim_recorder_resume(sim, in_folder("a.csv"), &recorder, &why),
                   MSIM_ERR_UNSUPPORTED);
  assert_non_null(strstr(why.text, "a.csv cannot be resumed"));
  assert_null(recorder);
  msim_sim_destroy(sim);
}

/* A file or folder without write permission is refused before anything is created. */
static void read_only_places_are_refused(void **state) {
  (void)state;
  msim_sim *sim = flight(10, 1, MSIM_SYNC_OFF);
  put_text("a.csv", "");
  assert_int_equal(chmod(in_folder("a.csv"), 0444), 0);
  assert_int_equal(chmod(folder, 0555), 0);
  const int is_root = geteuid() == 0;
  if (is_root) assert_int_equal(seteuid(65534), 0);
  refuse(sim, "a.csv", MSIM_ERR_IO, "Permission denied");
  refuse(sim, "b.csv", MSIM_ERR_IO, "Permission denied");
  if (is_root) assert_int_equal(seteuid(0), 0);
  assert_int_equal(chmod(folder, 0755), 0);
  assert_int_equal(unlink(in_folder("a.csv")), 0);
  msim_sim_destroy(sim);
}

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
  (void)state;
  unlink(in_folder("a.csv"));
  return rmdir(folder);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(frames_hold_the_state),
                                     cmocka_unit_test(times_are_those_of_the_run),
                                     cmocka_unit_test(what_cannot_be_written_is_refused),
                                     cmocka_unit_test(energies_are_numbers),
                                     cmocka_unit_test(only_one_writes_a_file),
                                     cmocka_unit_test(with_sync_a_new_name_outlives_a_power_cut),
                                     cmocka_unit_test(what_is_not_ours_stays),
                                     cmocka_unit_test(csv_files_cannot_be_resumed),
                                     cmocka_unit_test(read_only_places_are_refused)};
  return cmocka_run_group_tests_name("recorder", tests, make_folder, remove_folder);
}
