/* Tests of the built-in recorder csv: the file holds the bits of the states it was given. */
#define _POSIX_C_SOURCE 200809L

#include <inttypes.h>
#include <locale.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "testing.h"
#include "sample_recording.h"
#include "record/csv.h"

static counting_host host;

static void assert_no_leak(void) { assert_int_equal(host.live, 0); }

/* Reads a whole number or a double and the separator that follows it. */
static int64_t whole(char **next) {
  int64_t value = strtoll(*next, next, 10);
  ++*next;
  return value;
}

static void assert_same_bits(double a, double b) {
  if (memcmp(&a, &b, sizeof a) != 0) fail_msg("%.17g is not %.17g", a, b);
}

static void assert_real(char **next, double expected) {
  assert_same_bits(strtod(*next, next), expected);
  ++*next;
}

static void assert_frame(char **next, const msim_frame *frame, int32_t n) {
  for (int32_t i = 0; i < n; i++) {
    assert_int_equal(whole(next), frame->step);
    assert_real(next, frame->t);
    assert_int_equal(whole(next), i);
    for (int c = 0; c < 3; c++) assert_real(next, frame->x[3 * i + c]);
    for (int c = 0; c < 3; c++) assert_real(next, frame->v[3 * i + c]);
    assert_int_equal((*next)[-1], '\n');
  }
}

/* The file consists of the first `frames` frames. */
static void assert_file(const char *path, sample_trajectory *s, int64_t frames) {
  static const char header[] = "step,t,particle,x,y,z,vx,vy,vz\n";
  char *text = read_file(path, NULL);
  assert_non_null(text);
  assert_memory_equal(text, header, sizeof header - 1);
  char *next = text + sizeof header - 1;
  for (int64_t i = 0; i < frames; i++) {
    msim_frame frame = sample_frame(s, i);
    assert_frame(&next, &frame, s->what.n);
  }
  assert_string_equal(next, "");
  free(text);
}

static void write_and_read(int32_t n, int64_t frames) {
  sample_trajectory s;
  host_init(&host);
  sample_init(&s, "a.csv", n, 0, frames);
  assert_int_equal(record(ms_csv_recorder_type(), &host.host, &s, frames), MSIM_OK);
  assert_file("a.csv", &s, frames);
  assert_no_leak();
  sample_free(&s);
  remove("a.csv");
}

static void every_bit_survives(void **state) {
  (void)state;
  write_and_read(5, 7);
}

static void frames_larger_than_the_buffer(void **state) {
  (void)state;
  write_and_read(5000, 3);
}

static void no_particles(void **state) {
  (void)state;
  write_and_read(0, 2);
}

/* Each frame is in the file when write() returns, so that other programs can read along. */
static void frames_are_flushed(void **state) {
  (void)state;
  sample_trajectory s;
  void *self;
  const msim_recorder_type *csv = ms_csv_recorder_type();
  host_init(&host);
  sample_init(&s, "b.csv", 3, 0, 4);
  assert_int_equal(csv->open(&host.host, &s.what, &self), MSIM_OK);
  for (int64_t i = 0; i < 4; i++) {
    assert_file("b.csv", &s, i);
    msim_frame frame = sample_frame(&s, i);
    assert_int_equal(csv->write(self, &frame), MSIM_OK);
  }
  assert_int_equal(csv->close(self), MSIM_OK);
  sample_free(&s);
  remove("b.csv");
}

/* csv.c calls this function instead of that of the C library. */
static int syncs;
static off_t synced_length; /* of the file, at the last call */

int fdatasync(int fd) {
  struct stat now;
  syncs++;
  if (fstat(fd, &now) == 0) synced_length = now.st_size;
  return 0;
}

static off_t length_of(const char *path) {
  struct stat now;
  assert_int_equal(stat(path, &now), 0);
  return now.st_size;
}

/* sync = 1: the header and each whole frame are on the disk when the call returns. 0: no call waits
 * for the disk. */
static void frames_are_synced_where_asked(void **state) {
  (void)state;
  const msim_recorder_type *csv = ms_csv_recorder_type();
  for (int sync = 0; sync < 2; sync++) {
    sample_trajectory s;
    void *self;
    host_init(&host);
    sample_init(&s, "f.csv", 3, 0, 4);
    s.what.sync = sync;
    syncs = 0;
    assert_int_equal(csv->open(&host.host, &s.what, &self), MSIM_OK);
    assert_int_equal(syncs, sync);
    for (int i = 0; i < 4; i++) {
      msim_frame frame = sample_frame(&s, i);
      assert_int_equal(csv->write(self, &frame), MSIM_OK);
      assert_int_equal(syncs, sync * (2 + i));
      if (sync) assert_int_equal(synced_length, length_of("f.csv"));
    }
    assert_int_equal(csv->close(self), MSIM_OK);
    sample_free(&s);
    remove("f.csv");
  }
}

static void a_comma_locale_changes_nothing(void **state) {
  (void)state;
  require(setlocale(LC_NUMERIC, "de_DE.UTF-8") != NULL, "the locale de_DE.UTF-8");
  sample_trajectory s;
  host_init(&host);
  sample_init(&s, "c.csv", 5, 0, 2);
  msim_status status = record(ms_csv_recorder_type(), &host.host, &s, 2);
  char here[32];
  snprintf(here, sizeof here, "%.1f", 0.5);
  setlocale(LC_NUMERIC, "C");
  assert_int_equal(status, MSIM_OK);
  assert_string_equal(here, "0,5"); /* the locale of the host is unchanged */
  assert_file("c.csv", &s, 2);
  sample_free(&s);
  remove("c.csv");
}

static void assert_refused(const char *path, msim_status status, const char *why) {
  sample_trajectory s;
  host_init(&host);
  host.fails = status == MSIM_ERR_MEMORY;
  sample_init(&s, path, 5, 0, 2);
  s.what.name = "final.csv";
  assert_int_equal(record(ms_csv_recorder_type(), &host.host, &s, 2), status);
  assert_non_null(strstr(host.sentence, why));
  assert_non_null(strstr(host.sentence, "final.csv"));
  assert_no_leak();
  sample_free(&s);
}

static void refusals_say_why(void **state) {
  (void)state;
  assert_refused("missing/a.csv", MSIM_ERR_IO, "No such file or directory");
  assert_refused("/", MSIM_ERR_IO, "Is a directory");
  assert_refused("/dev/full", MSIM_ERR_IO, "No space left on device");
  assert_refused("d.csv", MSIM_ERR_MEMORY, "memory");
}

/* A file size limit simulates a full disk. */
static void limit_file_size(rlim_t bytes) {
  struct rlimit limit;
  getrlimit(RLIMIT_FSIZE, &limit);
  limit.rlim_cur = bytes < limit.rlim_max ? bytes : limit.rlim_max;
  setrlimit(RLIMIT_FSIZE, &limit);
}

static void a_full_disk_leaves_whole_frames(void **state) {
  (void)state;
  sample_trajectory s;
  void *self;
  const msim_recorder_type *csv = ms_csv_recorder_type();
  host_init(&host);
  sample_init(&s, "e.csv", 100, 0, 9);
  assert_int_equal(csv->open(&host.host, &s.what, &self), MSIM_OK);
  signal(SIGXFSZ, SIG_IGN);
  limit_file_size(50000);
  int64_t good = 0;
  msim_status status = MSIM_OK;
  while (status == MSIM_OK) {
    msim_frame frame = sample_frame(&s, good);
    status = csv->write(self, &frame);
    good += status == MSIM_OK;
  }
  limit_file_size(RLIM_INFINITY);
  signal(SIGXFSZ, SIG_DFL);
  assert_in_range(good, 1, 5);
  msim_frame frame = sample_frame(&s, good);
  assert_int_equal(csv->write(self, &frame), MSIM_ERR_IO); /* after a failure all writes fail */
  assert_int_equal(csv->close(self), MSIM_ERR_IO);
  assert_non_null(strstr(host.sentence, "e.csv: cannot write the file: File too large"));
  assert_file("e.csv", &s, good);
  assert_no_leak();
  sample_free(&s);
  remove("e.csv");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_bit_survives),
      cmocka_unit_test(frames_larger_than_the_buffer),
      cmocka_unit_test(no_particles),
      cmocka_unit_test(frames_are_flushed),
      cmocka_unit_test(frames_are_synced_where_asked),
      cmocka_unit_test(a_comma_locale_changes_nothing),
      cmocka_unit_test(refusals_say_why),
      cmocka_unit_test(a_full_disk_leaves_whole_frames),
  };
  return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
