/* Tests of the recorder plugin hdf5 when it resumes a file: from any end, the completed file equals
 * an uninterrupted one byte by byte; a file that cannot be resumed is left unchanged. */
#define _DEFAULT_SOURCE /* mkdtemp */

#include <inttypes.h>

#include "scenes.h"
#include "trajectory.h"

enum { N = 20, NSPRINGS = 30, PLANNED = 12 };

static counting_host host;
static sample_trajectory s;

/* Record a file of `written` frames. */
static void begin(int64_t written) {
  host_init(&host);
  sample_init(&s, "a.vtkhdf", N, NSPRINGS, PLANNED);
  assert_int_equal(record(find_hdf5_recorder(), &host.host, &s, written), MSIM_OK);
}

/* Resume up to the end: the file kept so many frames, and now equals an uninterrupted one. */
static void go_on(int64_t kept) {
  int64_t found = -1;
  size_t first, second;
  host_init(&host);
  if (record_resumed(find_hdf5_recorder(), &host.host, &s, PLANNED, &found) != MSIM_OK)
    fail_msg("%s", host.sentence);
  assert_int_equal(found, kept);
  assert_int_equal(host.live, 0);
  assert_trajectory_valid("a.vtkhdf", PLANNED, PLANNED);
  s.what.path = "whole.vtkhdf";
  assert_int_equal(record(find_hdf5_recorder(), &host.host, &s, PLANNED), MSIM_OK);
  char *mine = read_file("a.vtkhdf", &first), *whole = read_file("whole.vtkhdf", &second);
  assert_int_equal(first, second);
  assert_memory_equal(mine, whole, first);
  free(mine), free(whole);
  remove("a.vtkhdf"), remove("whole.vtkhdf");
  sample_free(&s);
}

/* Flip bits of the i-th word of a dataset. */
static void change_word(const char *path, hsize_t i, uint64_t bits) {
  hid_t file = H5Fopen("a.vtkhdf", H5F_ACC_RDWR, H5P_DEFAULT);
  hid_t dataset = H5Dopen2(file, path, H5P_DEFAULT), type = H5Dget_type(dataset);
  hid_t space = H5Dget_space(dataset);
  const hsize_t size = (hsize_t)H5Sget_simple_extent_npoints(space);
  uint64_t *words = calloc(size, sizeof *words);
  assert_true(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, words) >= 0);
  words[i] ^= bits;
  assert_true(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, words) >= 0);
  free(words);
  H5Sclose(space), H5Tclose(type), H5Dclose(dataset), H5Fclose(file);
}

static void refuse(msim_status want, const char *sentence) {
  void *self;
  size_t length, after;
  char *before = read_file("a.vtkhdf", &length);
  msim_resumption from = {.size = sizeof from};
  host_init(&host);
  assert_int_equal(find_hdf5_recorder()->resume(&host.host, &s.what, &from, &self), want);
  if (!strstr(host.sentence, sentence)) fail_msg("'%s' lacks '%s'", host.sentence, sentence);
  assert_non_null(strstr(host.sentence, "a.vtkhdf: cannot resume the file: "));
  assert_int_equal(host.live, 0);
  char *now = read_file("a.vtkhdf", &after);
  assert_int_equal(after, length);
  if (length) assert_memory_equal(now, before, length);
  free(before), free(now);
}

/*------------------------------------- resuming -------------------------------------------------*/

static void resume_from_any_frame(void **state) {
  (void)state;
  for (int64_t written = 0; written <= PLANNED; written++) {
    begin(written);
    go_on(written);
  }
}

/* The last checkpoint may be in either of the two slots. */
static void with_the_last_checkpoint(void **state) {
  (void)state;
  for (int64_t written = 4; written <= 5; written++) {
    void *self;
    msim_resumption from = {.size = sizeof from};
    begin(written);
    assert_int_equal(find_hdf5_recorder()->resume(&host.host, &s.what, &from, &self), MSIM_OK);
    const msim_frame frame = sample_frame(&s, written - 1);
    assert_int_equal(from.frames, written);
    assert_int_equal(from.step, frame.step);
    assert_int_equal(from.checkpoint_length, frame.checkpoint_length);
    assert_memory_equal(from.checkpoint, frame.checkpoint, frame.checkpoint_length);
    assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
    go_on(written);
  }
}

static void resume_before_damaged_frames(void **state) {
  (void)state;
  static const char *const last[] = {"/msim/checkpoint/0", "/VTKHDF/Points"};
  const hsize_t words[] = {100, 4 * 3 * N + 7};
  for (int i = 0; i < 2; i++) {
    begin(5);
    change_word(last[i], words[i], 1);
    go_on(4);
  }
  begin(5); /* a power cut may lose one commit and keep the next */
  change_word("/VTKHDF/Steps/PartOffsets", 3, 1);
  change_word("/msim/checkpoint/1", 1, 3 ^ 1);
  refuse(MSIM_ERR_ARG, "none of its 3 frames has an intact checkpoint");
  sample_free(&s);
  remove("a.vtkhdf");
}

/* Frames written at an interruption, at times that are not planned, are overwritten. */
static void resume_over_an_unplanned_frame(void **state) {
  (void)state;
  void *self;
  msim_resumption from = {.size = sizeof from};
  begin(4);
  assert_int_equal(find_hdf5_recorder()->resume(&host.host, &s.what, &from, &self), MSIM_OK);
  msim_frame frame = sample_frame(&s, 4);
  frame.t -= 0.05;
  assert_int_equal(find_hdf5_recorder()->write(self, &frame), MSIM_OK);
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
  assert_trajectory_valid("a.vtkhdf", 5, PLANNED);
  go_on(4);
}

/* The content of the file at each sync: the find_hdf5_recorder calls this function, which is
 * visible, instead of that of the C library. */
enum { MOST_SYNCS = 8 };
static struct {
  char *bytes;
  size_t length;
} synced[MOST_SYNCS];
static int nsyncs;

__attribute__((visibility("default"))) int fdatasync(int fd) {
  (void)fd;
  if (nsyncs < MOST_SYNCS) synced[nsyncs].bytes = read_file("a.vtkhdf", &synced[nsyncs].length);
  nsyncs++;
  return 0;
}

/* Number of good frames in the file after the i-th sync */
static int64_t frames_at_sync(int i) {
  int64_t planned;
  FILE *file = fopen("b.vtkhdf", "wb");
  assert_true(file && fwrite(synced[i].bytes, 1, synced[i].length, file) == synced[i].length);
  fclose(file);
  const int64_t frames = verify_trajectory("b.vtkhdf", &planned);
  remove("b.vtkhdf");
  return frames;
}

/* Two frames without checkpoints are committed after the last one that has one. Before the next
 * frame is written there, they are withdrawn one by one, with a sync after each: a power cut may
 * lose any writes since the last sync, and the committed frames are still the first ones. */
static void frames_are_withdrawn_one_by_one(void **state) {
  (void)state;
  static const int64_t expected[] = {5, 4, 3, 3, 4}; /* NCommitted is lowered first */
  void *self;
  msim_resumption from = {.size = sizeof from};
  begin(3);
  assert_int_equal(find_hdf5_recorder()->resume(&host.host, &s.what, &from, &self), MSIM_OK);
  for (int i = 3; i < 5; i++) {
    msim_frame frame = sample_frame(&s, i);
    frame.checkpoint = NULL, frame.checkpoint_length = 0;
    assert_int_equal(find_hdf5_recorder()->write(self, &frame), MSIM_OK);
  }
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
  assert_trajectory_valid("a.vtkhdf", 5, PLANNED);
  s.what.sync = 1;
  assert_int_equal(find_hdf5_recorder()->resume(&host.host, &s.what, &from, &self), MSIM_OK);
  assert_int_equal(from.frames, 3);
  const msim_frame frame = sample_frame(&s, 3);
  nsyncs = 0;
  assert_int_equal(find_hdf5_recorder()->write(self, &frame), MSIM_OK);
  assert_int_equal(nsyncs, 5);
  for (int i = 0; i < 5; i++) {
    assert_int_equal(frames_at_sync(i), expected[i]);
    free(synced[i].bytes);
  }
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
  s.what.sync = 0;
  go_on(4);
}

/* Resume to an end before the planned one, and then to the planned one. */
static void to_an_earlier_end(void **state) {
  (void)state;
  int64_t kept;
  begin(5);
  s.what.nframes = 8;
  s.times[7] -= 0.03;
  assert_int_equal(record_resumed(find_hdf5_recorder(), &host.host, &s, 8, &kept), MSIM_OK);
  assert_trajectory_valid("a.vtkhdf", 8, PLANNED);
  s.what.nframes = PLANNED;
  s.times[7] += 0.03;
  go_on(8);
}

/*------------------------------------- formats --------------------------------------------------*/

static void a_later_format_is_refused(void **state) {
  (void)state;
  begin(5);
  set_trajectory_format("a.vtkhdf", 4);
  refuse(MSIM_ERR_ARG, "it has format 4, which this version of msim does not support");
  sample_free(&s);
  remove("a.vtkhdf");
}

/*------------------------------------- refusals -------------------------------------------------*/

static void another_run_is_refused(void **state) {
  (void)state;
  begin(5);
  s.what.n = N - 1;
  refuse(MSIM_ERR_ARG, "it has 20 particles, but the scene has 19");
  s.what.n = N, s.what.nsprings = NSPRINGS - 1;
  refuse(MSIM_ERR_ARG, "it has 30 springs, but the scene has 29");
  s.what.nsprings = NSPRINGS, s.what.nfaces--;
  refuse(MSIM_ERR_ARG, "it has 9 faces, but the scene has 8");
  s.what.nfaces++, s.what.nframes = PLANNED + 1;
  refuse(MSIM_ERR_ARG, "it was created for 12 frames, but this run has 13; reduce");
  s.what.nframes = 4;
  refuse(MSIM_ERR_ARG, "it already contains 5 frames, but this run has only 4");
  s.what.nframes = PLANNED, s.times[9] += 0.01;
  refuse(MSIM_ERR_ARG, "its frame 9 was planned at t = 0.9");
  s.times[3] = 0.31, s.times[4] = 0.41;
  refuse(MSIM_ERR_ARG, "its frame 3 was planned at t = 0.3");
  sample_free(&s);
  remove("a.vtkhdf");
}

static void damage_is_refused(void **state) {
  (void)state;
  static const char *const statics[] = {"/VTKHDF/PointData/Mass",
                                        "/VTKHDF/CellData/Stiffness",
                                        "/VTKHDF/CellData/RestLength",
                                        "/VTKHDF/Lines/Connectivity",
                                        "/msim/scene",
                                        "/VTKHDF/Polygons/Connectivity"};
  begin(5);
  for (int i = 0; i < 6; i++) {
    change_word(statics[i], 1, 1);
    refuse(MSIM_ERR_ARG, "its mesh, parameters or scene are damaged");
    change_word(statics[i], 1, 1);
  }
  for (int i = 0; i < 2; i++) change_word(i ? "/msim/checkpoint/1" : "/msim/checkpoint/0", 0, 1);
  refuse(MSIM_ERR_ARG, "none of its 5 frames has an intact checkpoint");
  sample_free(&s);
  remove("a.vtkhdf");
}

/* The claimed rows are not read, which would take as long as the file claims. */
static void rows_that_are_not_stored_are_refused(void **state) {
  (void)state;
  const hsize_t rows = (hsize_t)1 << 40;
  begin(5);
  hid_t file = H5Fopen("a.vtkhdf", H5F_ACC_RDWR, H5P_DEFAULT);
  hid_t space = H5Screate_simple(1, &rows, NULL);
  H5Ldelete(file, "/msim/scene", H5P_DEFAULT);
  hid_t scene =
      H5Dcreate2(file, "/msim/scene", H5T_STD_U8LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  assert_true(scene >= 0);
  H5Dclose(scene), H5Sclose(space), H5Fclose(file);
  refuse(MSIM_ERR_ARG, "its dataset /msim/scene was not created by msim");
  sample_free(&s);
  remove("a.vtkhdf");
}

static void what_is_not_ours_is_refused(void **state) {
  (void)state;
  begin(0);
  assert_int_equal(find_hdf5_recorder()->recognize(&host.host, "a.vtkhdf"), 1);
  hid_t file = H5Fopen("a.vtkhdf", H5F_ACC_RDWR, H5P_DEFAULT);
  H5Ldelete(file, "/msim/checkpoint", H5P_DEFAULT);
  H5Fclose(file);
  refuse(MSIM_ERR_ARG, "it contains no checkpoints");
  file = H5Fopen("a.vtkhdf", H5F_ACC_RDWR, H5P_DEFAULT);
  H5Ldelete(file, "/msim", H5P_DEFAULT);
  H5Fclose(file);
  refuse(MSIM_ERR_ARG, "it is not a trajectory written by msim");
  assert_int_equal(find_hdf5_recorder()->recognize(&host.host, "a.vtkhdf"), 0);
  FILE *text = fopen("a.vtkhdf", "w");
  fputs("a diary\n", text);
  fclose(text);
  refuse(MSIM_ERR_BACKEND, "file signature");
  assert_int_equal(find_hdf5_recorder()->recognize(&host.host, "a.vtkhdf"), 0);
  remove("a.vtkhdf");
  assert_int_equal(find_hdf5_recorder()->recognize(&host.host, "a.vtkhdf"), 0);
  assert_int_equal(host.live, 0);
  sample_free(&s);
}

static void without_memory(void **state) {
  (void)state;
  int64_t kept;
  begin(5);
  for (int i = 1; i <= 2; i++) {
    host_init(&host);
    host.fail_at = i;
    assert_int_equal(record_resumed(find_hdf5_recorder(), &host.host, &s, PLANNED, &kept),
                     MSIM_ERR_MEMORY);
    assert_non_null(strstr(host.sentence, "a.vtkhdf: "));
    assert_int_equal(host.live, 0);
  }
  go_on(5);
}

/* A host of a version without checkpoints. */
static void an_older_host(void **state) {
  (void)state;
  host_init(&host);
  sample_init(&s, "a.vtkhdf", N, NSPRINGS, PLANNED);
  s.what.size = offsetof(msim_recording, checkpoint_capacity);
  void *self;
  assert_int_equal(find_hdf5_recorder()->open(&host.host, &s.what, &self), MSIM_OK);
  msim_frame frame = sample_frame(&s, 0);
  frame.size = offsetof(msim_frame, checkpoint);
  assert_int_equal(find_hdf5_recorder()->write(self, &frame), MSIM_OK);
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
  assert_trajectory_valid("a.vtkhdf", 1, PLANNED);
  sample_free(&s);
  remove("a.vtkhdf");
}

static void a_checkpoint_that_is_too_long(void **state) {
  (void)state;
  void *self;
  begin(0);
  assert_int_equal(find_hdf5_recorder()->open(&host.host, &s.what, &self), MSIM_OK);
  msim_frame frame = sample_frame(&s, 0);
  frame.checkpoint_length = SAMPLE_CHECKPOINT + 1;
  assert_int_equal(find_hdf5_recorder()->write(self, &frame), MSIM_ERR_ARG);
  assert_non_null(strstr(host.sentence, "a checkpoint of 1004 bytes exceeds the 1003 planned"));
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_ERR_ARG);
  sample_free(&s);
  remove("a.vtkhdf");
}

/* A checkpoint that fills its slot, which consists of words, to the last byte */
static void a_checkpoint_as_long_as_planned(void **state) {
  (void)state;
  enum { LENGTH = SAMPLE_CHECKPOINT / 8 * 8 };
  void *self;
  msim_resumption from = {.size = sizeof from};
  begin(0);
  s.what.checkpoint_capacity = LENGTH;
  assert_int_equal(find_hdf5_recorder()->open(&host.host, &s.what, &self), MSIM_OK);
  msim_frame frame = sample_frame(&s, 0);
  frame.checkpoint_length = LENGTH;
  assert_int_equal(find_hdf5_recorder()->write(self, &frame), MSIM_OK);
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
  assert_int_equal(find_hdf5_recorder()->resume(&host.host, &s.what, &from, &self), MSIM_OK);
  assert_int_equal(from.frames, 1);
  assert_int_equal(from.checkpoint_length, LENGTH);
  assert_memory_equal(from.checkpoint, frame.checkpoint, LENGTH);
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
  sample_free(&s);
  remove("a.vtkhdf");
}

/*------------------------------------- sims -----------------------------------------------------*/

static msim_sim *flight(void) {
  const double x[3] = {0, 0, 1}, v[3] = {1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  msim_options opt = options("velocity-verlet", 0.01);
  opt.steps = 6, opt.every = 1;
  msim_sim *sim = make_sim(scene, &opt);
  msim_scene_destroy(scene);
  return sim;
}

static int write_frame(msim_sim *sim, void *recorder) {
  (void)sim;
  return msim_recorder_write(recorder, NULL) != MSIM_OK;
}

/* A file without frames starts anew; a file that does not exist cannot be resumed. */
static void before_the_first_frame(void **state) {
  (void)state;
  msim_sim *sim = flight(), *other = flight();
  msim_recorder *recorder;
  msim_error why;
  assert_int_equal(msim_recorder_resume(sim, "a.vtkhdf", &recorder, &why), MSIM_ERR_IO);
  assert_non_null(
      strstr(why.text, "a.vtkhdf does not exist, so that no run can be resumed from it"));
  assert_null(recorder);
  assert_int_equal(access("a.vtkhdf", F_OK), -1);
  assert_ok(msim_recorder_open(sim, "a.vtkhdf", &recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  assert_ok(msim_recorder_resume(other, "a.vtkhdf", &recorder, err));
  assert_int_equal(state_of(other).step, 0);
  assert_ok(msim_sim_run(other, write_frame, recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  assert_ok(msim_recorder_resume(sim, "a.vtkhdf", &recorder, err));
  assert_int_equal(state_of(sim).step, 6);
  assert_memory_equal(state_of(sim).x, state_of(other).x, 3 * sizeof(double));
  assert_ok(msim_recorder_close(recorder, err));
  remove("a.vtkhdf");
  msim_sim_destroy(sim), msim_sim_destroy(other);
}

int main(void) {
  if (!find_hdf5_recorder()) return missing_status("the recorder hdf5");
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(resume_from_any_frame),
      cmocka_unit_test(with_the_last_checkpoint),
      cmocka_unit_test(resume_before_damaged_frames),
      cmocka_unit_test(resume_over_an_unplanned_frame),
      cmocka_unit_test(frames_are_withdrawn_one_by_one),
      cmocka_unit_test(to_an_earlier_end),
      cmocka_unit_test(a_later_format_is_refused),
      cmocka_unit_test(another_run_is_refused),
      cmocka_unit_test(damage_is_refused),
      cmocka_unit_test(rows_that_are_not_stored_are_refused),
      cmocka_unit_test(what_is_not_ours_is_refused),
      cmocka_unit_test(without_memory),
      cmocka_unit_test(an_older_host),
      cmocka_unit_test(a_checkpoint_that_is_too_long),
      cmocka_unit_test(a_checkpoint_as_long_as_planned),
      cmocka_unit_test(before_the_first_frame),
  };
  return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
