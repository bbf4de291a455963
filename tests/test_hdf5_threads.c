/* Test of the two HDF5 plugins in two threads: while the importer is inside libhdf5, which is often
 * not thread-safe, the recorder waits. */
#define _GNU_SOURCE /* mkdtemp, RTLD_NEXT */
#include <dlfcn.h>
#include <hdf5.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "scenes.h"

static atomic_int reads, uses, is_reading, overlaps;

/* The plugins call these functions, which are visible, instead of those of libhdf5. */
#define SEEN __attribute__((visibility("default")))

static void *next_symbol(const char *name) { return dlsym(RTLD_NEXT, name); }

/* The first read stays inside for half a second, or until another use begins, which must not. */
SEEN herr_t H5Dread(hid_t set, hid_t type, hid_t to, hid_t from, hid_t how, void *data) {
  void *symbol = next_symbol("H5Dread");
  herr_t (*read)(hid_t, hid_t, hid_t, hid_t, hid_t, void *);
  memcpy(&read, &symbol, sizeof read);
  is_reading = 1;
  if (reads++ == 0)
    for (int i = 0; i < 500 && !overlaps; i++) usleep(1000);
  const herr_t result = read(set, type, to, from, how, data);
  is_reading = 0;
  return result;
}

/* The first call of each use of libhdf5, before a lock that libhdf5 itself may have. */
SEEN herr_t H5dont_atexit(void) {
  void *symbol = next_symbol("H5dont_atexit");
  herr_t (*dont_atexit)(void);
  memcpy(&dont_atexit, &symbol, sizeof dont_atexit);
  uses++;
  if (is_reading) overlaps++;
  return dont_atexit();
}

static void *load(void *status) {
  msim_scene *scene = NULL;
  *(msim_status *)status = msim_scene_load(NULL, "a.h5", &scene, NULL);
  msim_scene_destroy(scene);
  return NULL;
}

static void importer_and_recorder_take_turns(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_options opt = options("velocity-verlet", 0.01);
  opt.steps = 4, opt.every = 1;
  msim_sim *sim = make_sim(scene, &opt);
  msim_recorder *recorder;
  msim_status loaded = MSIM_ERR_ARG;
  pthread_t thread;
  assert_ok(msim_scene_save(scene, "a.h5", err));
  assert_ok(msim_recorder_open(sim, "a.vtkhdf", &recorder, err));
  uses = 0;
  assert_int_equal(pthread_create(&thread, NULL, load, &loaded), 0);
  for (int i = 0; i < 10000 && !is_reading; i++) usleep(1000);
  assert_ok(msim_recorder_write(recorder, err));
  assert_int_equal(pthread_join(thread, NULL), 0);
  assert_ok(msim_recorder_close(recorder, err));
  assert_int_equal(loaded, MSIM_OK);
  assert_true(reads > 0 && uses >= 3); /* load, write, close */
  assert_int_equal(overlaps, 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static char folder[] = "/tmp/msim_test_XXXXXX";

static int enter(void **state) {
  (void)state;
  H5open(); /* else this program would not be linked to libhdf5, and next_symbol() find nothing */
  return mkdtemp(folder) ? chdir(folder) : -1;
}

static int leave(void **state) {
  (void)state;
  remove("a.h5"), remove("a.vtkhdf");
  return chdir("/") == 0 && rmdir(folder) == 0 ? 0 : -1;
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(importer_and_recorder_take_turns)};
  return cmocka_run_group_tests_name("hdf5_threads", tests, enter, leave);
}
