/* Test of recorders of several ranks that have read a scene in parts: each allocation and each call
 * of one rank that fails while a file is opened and a frame is written is a failure on all. */
#define _GNU_SOURCE /* mkdtemp */
#include <dirent.h>
#include <stdio.h>
#include <unistd.h>

#include "drawn_scenes.h"
#include "rank_failures.h"
#include "scene_part_file.h"

static msim_scene *load_part(const msim_comm *comm, const msim_allocator *alloc, const void *from) {
  msim_scene *part = NULL;
  (void)from;
  msim_scene_load_part(alloc, path, comm->rank, comm->nranks, &part, NULL);
  return part;
}

static msim_status record(const msim_scene *scene, const msim_options *opt, msim_sim **sim,
                          msim_error *why) {
  msim_recorder *recorder = NULL;
  msim_status status = msim_sim_create(scene, opt, sim, why);
  if (!status) status = msim_recorder_replace(*sim, "out.vtkhdf", &recorder, why);
  if (!status) status = msim_recorder_write(recorder, why);
  const msim_status closed = recorder ? msim_recorder_close(recorder, NULL) : MSIM_OK;
  return status ? status : closed;
}

static int count_files(void) {
  DIR *folder = opendir(".");
  int n = -2; /* . and .. */
  while (folder && readdir(folder)) n++;
  closedir(folder);
  return n;
}

static void failures_of_one_rank_are_those_of_all(void **state) {
  (void)state;
  msim_options opt = options("velocity-verlet", 1e-4);
  opt.steps = 4, opt.every = 2;
  msim_scene *scene = draw_scene(NULL, 5);
  save(scene);
  check_rank_failures(
      &(rank_failures){.load = load_part, .use = record, .opt = opt, .least = {150, 60}});
  msim_scene_destroy(scene);
  assert_int_equal(count_files(), 2); /* the scene and the trajectory */
}

int main(void) {
  char folder[] = "/tmp/msim_rank_recorder_failures_XXXXXX";
  if (!mkdtemp(folder) || chdir(folder)) return 1;
  const struct CMUnitTest tests[] = {cmocka_unit_test(failures_of_one_rank_are_those_of_all)};
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  for (const char *const *name = (const char *[]){"out.vtkhdf", path, NULL}; *name; name++)
    remove(*name);
  return chdir("/") || rmdir(folder) || failed;
}
