/* Tests of the built-in recorder pvd by the calls that it makes: a process that is killed at any
 * moment leaves a list of whole frames, and failures leave nothing behind. test_vtk_pvd.py reads
 * what it writes. */
#define _DEFAULT_SOURCE /* mkdtemp, syscall */

#include <sys/stat.h>
#include <sys/syscall.h>

#include "testing.h"
#include "sample_recording.h"
#include "record/pvd.h"

enum { N = 12, NSPRINGS = 16, PLANNED = 5, PAGE = 4096 };

static counting_host host;
static sample_trajectory s;

/*------------------------------------- writes to the list ---------------------------------------*/

static int nlines,
    frames_before[64]; /* number of lines written; whole frame files at each of them */

static long size_of(const char *path) {
  struct stat info;
  return stat(path, &info) == 0 ? (long)info.st_size : -1;
}

static int whole_frames(void) {
  char path[64];
  int count = 0;
  const long size = size_of("a_frames/000000.vtp");
  for (; count < PLANNED; count++) {
    snprintf(path, sizeof path, "a_frames/%06d.vtp", count);
    if (size < 0 || size_of(path) != size) break;
  }
  return count;
}

/* The recorder calls this function, which is visible, instead of that of the C library. */
__attribute__((visibility("default"))) ssize_t pwrite(int fd, const void *data, size_t bytes,
                                                      off_t offset) {
  /* the kernel writes page by page: a line in one page is written or not */
  assert_true(bytes <= PAGE && PAGE % bytes == 0 && offset % (off_t)bytes == 0);
  frames_before[nlines++] = whole_frames();
  return syscall(SYS_pwrite64, fd, data, bytes, offset);
}

static void clean_up(void) {
  char path[64];
  for (int i = 0; i < PLANNED; i++) {
    snprintf(path, sizeof path, "a_frames/%06d.vtp", i);
    remove(path);
  }
  rmdir("a_frames");
  remove("a.pvd");
  sample_free(&s);
}

static void begin(void) {
  host_init(&host);
  sample_init(&s, "a.pvd", N, NSPRINGS, PLANNED);
  nlines = 0;
}

/* The list has its size from the start; the line of a frame is written when its file is whole. */
static void frames_are_listed_when_they_are_whole(void **state) {
  (void)state;
  void *self;
  begin();
  assert_int_equal(ms_pvd_recorder_type()->open(&host.host, &s.what, &self), MSIM_OK);
  assert_int_equal(nlines, PLANNED + 2);
  const long size = size_of("a.pvd");
  for (int i = 0; i < PLANNED; i++) {
    const msim_frame frame = sample_frame(&s, i);
    assert_int_equal(ms_pvd_recorder_type()->write(self, &frame), MSIM_OK);
    assert_int_equal(nlines, PLANNED + 2 + i + 1);
    assert_int_equal(frames_before[nlines - 1], i + 1);
  }
  const msim_frame frame = sample_frame(&s, PLANNED);
  assert_int_equal(ms_pvd_recorder_type()->write(self, &frame), MSIM_ERR_ARG);
  assert_string_equal(host.sentence, "a.pvd: all 5 planned frames have been written already");
  assert_int_equal(ms_pvd_recorder_type()->close(self), MSIM_OK);
  assert_int_equal(size_of("a.pvd"), size);
  assert_int_equal(host.live, 0);
  clean_up();
}

/* In files of the folder behind the frames themselves */
static void a_frame_holds_its_bits(void **state) {
  (void)state;
  begin();
  assert_int_equal(record(ms_pvd_recorder_type(), &host.host, &s, 3), MSIM_OK);
  size_t length = 0;
  char *bytes = read_file("a_frames/000002.vtp", &length);
  const msim_frame frame = sample_frame(&s, 2);
  const struct {
    const void *data;
    uint64_t bytes;
  } arrays[] = {{&frame.t, 8},
                {frame.v, 24 * N},
                {s.mass, 8 * N},
                {s.pinned, N},
                {frame.reaction, 12 * N},
                {frame.strain, 4 * (NSPRINGS + 5)},
                {frame.tension, 4 * (NSPRINGS + 5)},
                {frame.x, 24 * N},
                {s.ij, 8 * NSPRINGS},
                {s.faces, 12 * 5}};
  const char *next = strstr(bytes, "<AppendedData encoding=\"raw\">\n_");
  assert_non_null(next);
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
    int found = 0;
    for (; !found && next + 8 + arrays[i].bytes <= bytes + length; next++)
      found = memcmp(next, &arrays[i].bytes, 8) == 0 &&
              memcmp(next + 8, arrays[i].data, arrays[i].bytes) == 0;
    assert_true(found);
  }
  free(bytes);
  clean_up();
}

/*------------------------------------- failures -------------------------------------------------*/

static void without_memory(void **state) {
  (void)state;
  begin();
  for (int i = 1; i <= 2; i++) {
    host_init(&host);
    host.fail_at = i;
    assert_int_equal(record(ms_pvd_recorder_type(), &host.host, &s, 1), MSIM_ERR_MEMORY);
    assert_string_equal(host.sentence, "a.pvd: out of memory for the pvd recorder");
    assert_int_equal(host.live, 0);
    assert_int_equal(size_of("a_frames"), -1);
  }
  clean_up();
}

static void without_a_folder(void **state) {
  (void)state;
  begin();
  s.what.path = "missing/a.pvd";
  assert_int_equal(record(ms_pvd_recorder_type(), &host.host, &s, 1), MSIM_ERR_IO);
  assert_string_equal(host.sentence,
                      "missing/a_frames: cannot write the file: No such file or directory");
  assert_int_equal(host.live, 0);
  clean_up();
}

/* The folder is removed where no frame was written. */
static void without_frames(void **state) {
  (void)state;
  begin();
  assert_int_equal(record(ms_pvd_recorder_type(), &host.host, &s, 0), MSIM_OK);
  assert_int_equal(size_of("a_frames"), -1);
  assert_int_equal(ms_pvd_recorder_type()->recognize(&host.host, "a.pvd"), 1);
  assert_int_equal(ms_pvd_recorder_type()->recognize(&host.host, "missing.pvd"), 0);
  clean_up();
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(frames_are_listed_when_they_are_whole),
      cmocka_unit_test(a_frame_holds_its_bits),
      cmocka_unit_test(without_memory),
      cmocka_unit_test(without_a_folder),
      cmocka_unit_test(without_frames),
  };
  return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
