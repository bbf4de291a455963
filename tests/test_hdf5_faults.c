/* Tests of failures in the recorder plugin hdf5: it reports the reason, neither prints nor crashes,
 * leaks nothing, and the frames written so far are good. */
#define _DEFAULT_SOURCE /* mkdtemp, syscall */

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include "trajectory.h"

/* libhdf5 leaks some memory when a write fails; blocks of the plugin are counted by the host. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libhdf5"; }

static counting_host host;

/*------------------------------------- refusals -------------------------------------------------*/

static void more_frames_than_planned(void **state) {
  (void)state;
  const msim_recorder_type *hdf5 = find_hdf5_recorder();
  sample_trajectory s;
  void *self;
  host_init(&host);
  sample_init(&s, "g.vtkhdf", 5, 4, 2);
  assert_int_equal(hdf5->open(&host.host, &s.what, &self), MSIM_OK);
  for (int64_t i = 0; i < 3; i++) {
    msim_frame frame = sample_frame(&s, i);
    assert_int_equal(hdf5->write(self, &frame), i < 2 ? MSIM_OK : MSIM_ERR_ARG);
  }
  assert_string_equal(host.sentence, "g.vtkhdf: all 2 planned frames have been written already");
  assert_int_equal(hdf5->close(self), MSIM_OK);
  assert_int_equal(host.live, 0);
  assert_trajectory_valid("g.vtkhdf", 2, 2);
  sample_free(&s);
  remove("g.vtkhdf");
}

static void assert_refused(const char *path, int64_t nframes, msim_status status,
                           const char *sentence) {
  const msim_recorder_type *hdf5 = find_hdf5_recorder();
  sample_trajectory s;
  host_init(&host);
  host.fails = status == MSIM_ERR_MEMORY;
  sample_init(&s, path, 5, 4, 2);
  s.what.name = "final.vtkhdf";
  s.what.nframes = nframes;
  assert_int_equal(record(hdf5, &host.host, &s, 2), status);
  if (!strstr(host.sentence, sentence)) fail_msg("'%s' lacks '%s'", host.sentence, sentence);
  assert_int_equal(host.live, 0);
  sample_free(&s);
}

static void refusals_say_why(void **state) {
  (void)state;
  assert_refused("missing/a.vtkhdf", 2, MSIM_ERR_IO,
                 "final.vtkhdf: cannot create the file: No such file or directory");
  assert_refused("/", 2, MSIM_ERR_IO, "final.vtkhdf: cannot create the file: Is a directory");
  assert_refused(
      "h.vtkhdf", 0, MSIM_ERR_ARG,
      "final.vtkhdf: cannot create the file: there are 0 frames; there must be at least 1");
  assert_refused("h.vtkhdf", INT64_MAX / 2, MSIM_ERR_ARG,
                 "frames; there must be at least 1, and at most 2^62 bytes");
  assert_refused("h.vtkhdf", 2, MSIM_ERR_MEMORY, "memory");
}

/* A file larger than any disk is refused before a byte is written. */
static void a_disk_that_is_too_small(void **state) {
  (void)state;
  assert_refused("i.vtkhdf", INT64_C(1) << 48, MSIM_ERR_IO, "MB of disk space: ");
  remove("i.vtkhdf");
}

static herr_t count_printed(hid_t stack, void *data) {
  (void)stack;
  ++*(int *)data;
  return 0;
}

static void the_library_never_prints(void **state) {
  (void)state;
  int printed = 0, before = dup(STDERR_FILENO);
  int to = open("stderr", O_CREAT | O_RDWR | O_TRUNC, 0600);
  H5Eset_auto2(H5E_DEFAULT, count_printed, &printed);
  dup2(to, STDERR_FILENO);
  assert_refused("missing/a.vtkhdf", 2, MSIM_ERR_IO, "");
  dup2(before, STDERR_FILENO);
  off_t length = lseek(to, 0, SEEK_END);
  close(to);
  close(before);
  remove("stderr");
  assert_int_equal(length, 0);
  assert_int_equal(printed, 0);
  H5Dclose(12345); /* errors of the host itself are printed as before */
  assert_int_equal(printed, 1);
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
}

/*------------------------------------- full disks -----------------------------------------------*/

/* A file size limit simulates a full disk. */
static void limit_file_size(rlim_t bytes) {
  const struct rlimit limit = {bytes, bytes};
  setrlimit(RLIMIT_FSIZE, &limit);
  signal(SIGXFSZ, SIG_IGN);
}

enum { FULL_FRAMES = 20, FRAMES_BEFORE = 7 };

/* In a child process, which ends as a program does, exit handlers included. Its exit status: the
 * number of good frames; 100 if open() failed; 200 and more if a check failed. */
static void run_into_limit(const char *path, rlim_t at_open, rlim_t while_writing) {
  sample_trajectory s;
  void *self = NULL;
  const msim_recorder_type *hdf5 = find_hdf5_recorder();
  host_init(&host);
  sample_init(&s, path, 1000, 0, FULL_FRAMES);
  if (at_open) limit_file_size(at_open);
  if (hdf5->open(&host.host, &s.what, &self) != MSIM_OK)
    exit(host.live == 0 && strstr(host.sentence, "MB of disk space: File too large") ? 100 : 200);
  int good = 0, failed = 0;
  for (int i = 0; i < FULL_FRAMES; i++) {
    if (i == FRAMES_BEFORE) limit_file_size(while_writing);
    msim_frame frame = sample_frame(&s, i);
    int fine = hdf5->write(self, &frame) == MSIM_OK;
    if (fine && failed) exit(201); /* after a failure all writes fail */
    good += fine;
    failed += !fine;
  }
  if (!failed || !strstr(host.sentence, path) || !strstr(host.sentence, "File too large"))
    exit(202);
  if (hdf5->close(self) != MSIM_ERR_IO || host.live != 0) exit(203);
  sample_free(&s);
  exit(good);
}

static int status_at_limit(const char *path, rlim_t at_open, rlim_t while_writing) {
  fflush(NULL);
  pid_t child = fork();
  if (child == 0) run_into_limit(path, at_open, while_writing);
  int status = 0;
  assert_int_equal(waitpid(child, &status, 0), child);
  assert_true(WIFEXITED(status)); /* no signal */
  return WEXITSTATUS(status);
}

static void a_full_disk_is_noticed_before_the_run(void **state) {
  (void)state;
  assert_int_equal(status_at_limit("j.vtkhdf", 100000, 0), 100);
  remove("j.vtkhdf");
}

/* If space could not be reserved. The limits fall into x, v, and what follows them. */
static void a_disk_that_fills_leaves_whole_frames(void **state) {
  (void)state;
  for (rlim_t limit = 1000; limit < 900000; limit += 139000) {
    assert_int_equal(status_at_limit("k.vtkhdf", 0, limit), FRAMES_BEFORE);
    assert_trajectory_valid("k.vtkhdf", FRAMES_BEFORE, FULL_FRAMES);
    remove("k.vtkhdf");
  }
}

/*------------------------------------- every single write ---------------------------------------*/

/* libhdf5 calls this pwrite, which is visible, instead of that of the C library. */
static int64_t writes_left = INT64_MAX; /* before the one that fails; the next ones succeed */
static int ends_process;                /* 1: written by half, then exit; 0: "disk full" */
static int64_t writes_made;

__attribute__((visibility("default"))) ssize_t pwrite(int fd, const void *data, size_t bytes,
                                                      off_t offset) {
  writes_made++;
  if (writes_left-- != 0) return syscall(SYS_pwrite64, fd, data, bytes, offset);
  if (!ends_process) {
    errno = ENOSPC;
    return -1;
  }
  syscall(SYS_pwrite64, fd, data, bytes / 2, offset);
  _exit(0);
}

enum { FEW_FRAMES = 5 };

/* Open, write and close as a program does. Returns 1 if any call was refused, 2 and more if the
 * results are inconsistent. after[]: the numbers of writes after open and after each frame. */
static int run_few_frames(const char *path, int64_t after[1 + FEW_FRAMES]) {
  sample_trajectory s;
  void *self = NULL;
  const msim_recorder_type *hdf5 = find_hdf5_recorder();
  host_init(&host);
  sample_init(&s, path, 10, 5, FEW_FRAMES);
  int refused = hdf5->open(&host.host, &s.what, &self) != MSIM_OK, closed = MSIM_OK;
  after[0] = writes_made;
  for (int i = 0; i < FEW_FRAMES && self; i++) {
    msim_frame frame = sample_frame(&s, i);
    int fine = hdf5->write(self, &frame) == MSIM_OK;
    if (fine && refused) return 2; /* although the disk may have space again */
    refused |= !fine;
    after[1 + i] = writes_made;
  }
  if (self) closed = hdf5->close(self);
  sample_free(&s);
  if (self && (closed != MSIM_OK) != refused) return 3;
  if (refused && !strstr(host.sentence, "No space left on device")) return 4;
  return host.live == 0 ? refused : 5;
}

static int status_with_bad_write(const char *path, int64_t which) {
  int64_t after[1 + FEW_FRAMES];
  fflush(NULL);
  pid_t child = fork();
  if (child == 0) {
    writes_left = which;
    exit(run_few_frames(path, after));
  }
  int status = 0;
  assert_int_equal(waitpid(child, &status, 0), child);
  assert_true(WIFEXITED(status)); /* no signal, not even at exit */
  return WEXITSTATUS(status);
}

/* Another process resumes the file. */
static void assert_resumed(const char *path, size_t length, const char *whole) {
  sample_trajectory s;
  size_t now;
  int64_t kept;
  host_init(&host);
  sample_init(&s, path, 10, 5, FEW_FRAMES);
  if (record_resumed(find_hdf5_recorder(), &host.host, &s, FEW_FRAMES, &kept) != MSIM_OK)
    fail_msg("%s", host.sentence);
  sample_free(&s);
  char *bytes = read_file(path, &now);
  assert_int_equal(now, length);
  assert_memory_equal(bytes, whole, length);
  free(bytes);
}

/* Each write fails in turn. Once the file is open, every frame whose last write came before is in
 * it and good, and at most the frame that was being written is there too. The resumed and completed
 * file equals an uninterrupted one. */
static void assert_every_write(const char *path, int status) {
  int64_t after[1 + FEW_FRAMES], planned;
  writes_made = 0;
  assert_int_equal(run_few_frames(path, after), 0);
  assert_true(writes_made > 0);
  const int64_t writes = after[FEW_FRAMES];
  size_t length = 0;
  char *whole = read_file(path, &length);
  for (int64_t which = 0; which < writes; which++) {
    assert_int_equal(status_with_bad_write(path, which), status);
    int64_t frames = 0, good = verify_trajectory(path, &planned);
    while (frames < FEW_FRAMES && after[1 + frames] <= which) frames++;
    if (which >= after[0] && good != frames && good != frames + 1)
      fail_msg("write %d of %d: %d frames, not %d", (int)which, (int)writes, (int)good,
               (int)frames);
    if (which >= after[0]) assert_resumed(path, length, whole);
  }
  free(whole);
  remove(path);
}

static void death_at_any_write_leaves_whole_frames(void **state) {
  (void)state;
  ends_process = 1;
  assert_every_write("o.vtkhdf", 0);
  ends_process = 0;
}

static void refusal_of_any_write_is_told(void **state) {
  (void)state;
  assert_every_write("p.vtkhdf", 1);
}

int main(void) {
  if (!find_hdf5_recorder()) return missing_status("the recorder hdf5");
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(more_frames_than_planned),
      cmocka_unit_test(refusals_say_why),
      cmocka_unit_test(a_disk_that_is_too_small),
      cmocka_unit_test(the_library_never_prints),
      cmocka_unit_test(a_full_disk_is_noticed_before_the_run),
      cmocka_unit_test(a_disk_that_fills_leaves_whole_frames),
      cmocka_unit_test(death_at_any_write_leaves_whole_frames),
      cmocka_unit_test(refusal_of_any_write_is_told),
  };
  return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
