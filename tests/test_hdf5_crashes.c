/* Tests of every state in which a crash can leave a trajectory while it is created, written and
 * resumed. Whichever writes are on the disk, the file holds every frame whose write had returned,
 * and is resumed to the same bytes. Only a file whose creation had not ended may be refused.
 *
 *   test_hdf5_replay                    the tests
 *   test_hdf5_replay states FOLDER      some of the states, as FOLDER/I_FRAMES.vtkhdf, for VTK */
#define _DEFAULT_SOURCE /* mkdtemp, syscall */

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <sys/syscall.h>

#include "scenes.h"
#include "trajectory.h"

/*------------------------------------- journal --------------------------------------------------*/

typedef struct operation {
  enum { WRITE, RESIZE, RESERVE, SYNC, RENAME } kind;
  size_t at, length;
  char *data; /* of a WRITE */
  int frames; /* frames whose write() had returned before */
} operation;

enum { MOST = 4000 };
static operation journal[MOST];
static int noperations, is_open, frames_returned;
static int created; /* operations before open() returned */

static void note(int kind, size_t at, size_t length, const void *data) {
  if (!is_open) return;
  operation *o = &journal[noperations++];
  if (noperations > MOST) abort();
  *o = (operation){kind, at, length, data ? malloc(length) : NULL, frames_returned};
  if (data) memcpy(o->data, data, length);
}

/* libhdf5 and the plugin call these functions, which are visible, instead of those of the C
 * library. */
#define SEEN __attribute__((visibility("default")))

SEEN ssize_t pwrite(int fd, const void *data, size_t bytes, off_t offset) {
  note(WRITE, (size_t)offset, bytes, data);
  return syscall(SYS_pwrite64, fd, data, bytes, offset);
}

SEEN int ftruncate(int fd, off_t length) {
  note(RESIZE, 0, (size_t)length, NULL);
  return (int)syscall(SYS_ftruncate, fd, length);
}

SEEN int posix_fallocate(int fd, off_t offset, off_t length) {
  note(RESERVE, (size_t)offset, (size_t)length, NULL);
  return syscall(SYS_fallocate, fd, 0, offset, length) == 0 ? 0 : errno;
}

SEEN int fdatasync(int fd) {
  (void)fd;
  note(SYNC, 0, 0, NULL);
  return 0;
}

SEEN int rename(const char *from, const char *to) {
  note(RENAME, 0, 0, NULL);
  return (int)syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0);
}

/*------------------------------------- file images ----------------------------------------------*/

typedef struct image {
  char *bytes;
  size_t length, room;
} image;

static void resize(image *to, size_t length) {
  if (length >= to->room) {
    to->room = 2 * length + 1;
    to->bytes = realloc(to->bytes, to->room);
  }
  if (length > to->length) memset(to->bytes + to->length, 0, length - to->length);
  to->length = length;
}

/* Of a WRITE the first `bytes` only. */
static void apply(image *to, const operation *o, size_t bytes) {
  if (o->kind == RESIZE) resize(to, o->length);
  if (o->kind == RESERVE || o->kind == WRITE)
    if (o->at + o->length > to->length) resize(to, o->at + o->length);
  if (o->kind == WRITE) memcpy(to->bytes + o->at, o->data, bytes);
}

static void copy(image *to, const image *from) {
  resize(to, from->length);
  memcpy(to->bytes, from->bytes, from->length);
}

static void save(const image *it, const char *path) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(it->bytes, 1, it->length, file), it->length);
  fclose(file);
}

/*------------------------------------- the run --------------------------------------------------*/

enum { N = 90, NSPRINGS = 20, FRAMES = 6 };

static counting_host host;
static sample_trajectory s;
static image first, whole;    /* before the first operation, and at the end */
static int nstates, nrefused; /* number of states checked; those among them that were refused */

static void load(image *to, const char *path) {
  size_t length = 0;
  char *bytes = read_file(path, &length);
  assert_non_null(bytes);
  resize(to, length);
  memcpy(to->bytes, bytes, length);
  free(bytes);
}

/* Record the rest of a file after open() or resume(). */
static void write_rest(void *self) {
  while (frames_returned < FRAMES) {
    const msim_frame frame = sample_frame(&s, frames_returned);
    assert_int_equal(find_hdf5_recorder()->write(self, &frame), MSIM_OK);
    frames_returned++;
  }
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
}

/* The journal of a whole run. */
static void run(int sync) {
  const msim_recorder_type *hdf5 = find_hdf5_recorder();
  void *self;
  host_init(&host);
  sample_init(&s, "a.vtkhdf", N, NSPRINGS, FRAMES);
  s.what.sync = sync;
  resize(&first, 0);
  noperations = frames_returned = nstates = nrefused = 0;
  is_open = 1;
  assert_int_equal(hdf5->open(&host.host, &s.what, &self), MSIM_OK);
  created = noperations;
  write_rest(self);
  is_open = 0;
  load(&whole, "a.vtkhdf");
}

static void clear_journal(void) {
  while (noperations > 0) free(journal[--noperations].data);
}

static void free_images(void) {
  clear_journal();
  sample_free(&s);
  remove("a.vtkhdf");
}

/* A file of `written` frames; is_stopped: the last one at a time that is not planned. */
static void record_part(int written, int is_stopped) {
  void *self;
  assert_int_equal(find_hdf5_recorder()->open(&host.host, &s.what, &self), MSIM_OK);
  for (int i = 0; i < written; i++) {
    const int is_last = is_stopped && i == written - 1;
    msim_frame frame = sample_frame(&s, is_last ? FRAMES : i);
    if (is_last) frame.t = s.times[i] - 0.05;
    assert_int_equal(find_hdf5_recorder()->write(self, &frame), MSIM_OK);
  }
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
}

/* The journal of a run that resumes a file of `written` frames. A frame that is not planned is
 * withdrawn. */
static void run_resumed(int sync, int written, int is_stopped) {
  void *self;
  msim_resumption from = {.size = sizeof from};
  run(sync);
  clear_journal();
  record_part(written, is_stopped);
  load(&first, "a.vtkhdf");
  created = 0, frames_returned = written - is_stopped;
  is_open = 1;
  assert_int_equal(find_hdf5_recorder()->resume(&host.host, &s.what, &from, &self), MSIM_OK);
  assert_int_equal(from.frames, frames_returned);
  write_rest(self);
  is_open = 0;
}

/*------------------------------------- checks ---------------------------------------------------*/

/* The creation had not ended; resume() gives the reason in one line, and leaves the file
 * unchanged. */
static void check_refused(const image *state, const char *what, int at) {
  static image after;
  load(&after, "state.vtkhdf");
  const char *line_end = strchr(host.sentence, '\n');
  if (at >= created || !strstr(host.sentence, "state.vtkhdf: cannot resume the file: ") ||
      line_end || after.length != state->length ||
      memcmp(after.bytes, state->bytes, state->length) != 0)
    fail_msg("%s at operation %d: refused by '%s'", what, at, host.sentence);
  nrefused++;
}

static int64_t count_in(const char *path) {
  const hid_t file = open_trajectory(path);
  const int64_t count = committed_count(file);
  H5Fclose(file);
  return count;
}

/* The file holds the frames whose write had returned, all good, and at most one more; a run that
 * resumes it keeps them and ends with the same bytes. */
static void check_resumed(int frames, const char *what, int at) {
  static image end;
  int64_t planned, kept;
  const int64_t good = verify_trajectory("state.vtkhdf", &planned);
  if (good < frames || good > frames + 1 || planned != FRAMES)
    fail_msg("%s at operation %d: %" PRId64 " good frames of %d", what, at, good, frames);
  if (record_resumed(find_hdf5_recorder(), &host.host, &s, FRAMES, &kept) != MSIM_OK)
    fail_msg("%s at operation %d: %s", what, at, host.sentence);
  load(&end, "state.vtkhdf");
  if (kept < frames || end.length != whole.length ||
      memcmp(end.bytes, whole.bytes, whole.length) != 0)
    fail_msg("%s at operation %d: %" PRId64 " frames kept, another final file", what, at, kept);
}

/* 1: the file can be resumed, with the checkpoint of the last frame that it keeps. */
static int resumes(void) {
  void *self;
  msim_resumption from = {.size = sizeof from};
  host.sentence[0] = '\0';
  if (find_hdf5_recorder()->resume(&host.host, &s.what, &from, &self) != MSIM_OK) return 0;
  if (from.frames > 0) {
    const msim_frame last = sample_frame(&s, from.frames - 1);
    assert_int_equal(from.step, last.step);
    assert_int_equal(from.checkpoint_length, last.checkpoint_length);
    assert_memory_equal(from.checkpoint, last.checkpoint, last.checkpoint_length);
  }
  assert_int_equal(find_hdf5_recorder()->close(self), MSIM_OK);
  return 1;
}

/* NCommitted counts the frames that had returned, but the last one after a power cut, as it is not
 * synced, and no frame that is not committed. */
static void check_count(int frames, const char *what, int at) {
  int64_t planned;
  const int64_t good = verify_trajectory("state.vtkhdf", &planned),
                count = count_in("state.vtkhdf");
  if (count < frames - s.what.sync || count > good)
    fail_msg("%s at operation %d: NCommitted = %" PRId64 ", %" PRId64 " good frames", what, at,
             count, good);
}

/* `frames` had been written. The count is looked at first, as closing the file corrects it. */
static void check(const image *state, int frames, const char *what, int at) {
  save(state, "state.vtkhdf");
  s.what.path = "state.vtkhdf";
  if (at >= created) check_count(frames, what, at);
  if (resumes()) check_resumed(frames, what, at);
  else check_refused(state, what, at);
  s.what.path = "a.vtkhdf";
  nstates++;
  remove("state.vtkhdf");
}

/*------------------------------------- killed processes -----------------------------------------*/

/* Between two operations, or within a write: at each page of the disk, and in the middle. */
static void kill_at_any_moment(void) {
  enum { PAGE = 4096 };
  image now = {0}, torn = {0};
  copy(&now, &first);
  check(&now, journal[0].frames, "killed", 0);
  for (int i = 0; i < noperations; i++) {
    const operation *o = &journal[i];
    for (size_t bytes = PAGE - o->at % PAGE; o->kind == WRITE && bytes < o->length; bytes += PAGE) {
      copy(&torn, &now);
      apply(&torn, o, bytes);
      check(&torn, o->frames, "torn at a page", i);
    }
    copy(&torn, &now);
    apply(&torn, o, o->length / 2);
    check(&torn, o->frames, "torn in the middle", i);
    apply(&now, o, o->length);
    check(&now, o->frames, "killed", i + 1);
  }
  print_message("%d operations, %d states, %d refused\n", noperations, nstates, nrefused);
  free(now.bytes), free(torn.bytes);
  free_images();
}

static void killed_in_a_new_file(void **state) {
  (void)state;
  run(0);
  assert_in_range(created, 10, MOST);
  assert_in_range(noperations - created, 10 * FRAMES, MOST);
  kill_at_any_moment();
  assert_true(nrefused > 0);
}

static void killed_in_a_resumed_file(void **state) {
  (void)state;
  for (int written = 0; written < FRAMES; written++) {
    for (int is_stopped = 0; is_stopped < 2 && is_stopped * 2 <= written; is_stopped++) {
      run_resumed(0, written, is_stopped);
      kill_at_any_moment();
    }
  }
}

/* Until all of a new file is on the disk it has another name, so that a file under the requested
 * name is never incomplete, and an older one is not lost. */
static void named_when_it_is_whole(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  msim_options opt = options("velocity-verlet", 0.01);
  msim_recorder *recorder;
  int synced = 0;
  opt.steps = 6, opt.every = 1, opt.sync = 1;
  msim_sim *sim = make_sim(scene, &opt);
  is_open = 1;
  assert_ok(msim_recorder_open(sim, "a.vtkhdf", &recorder, err));
  is_open = 0;
  for (int i = 0; i < noperations; i++)
    if (journal[i].kind == WRITE || journal[i].kind == SYNC) synced = journal[i].kind == SYNC;
  assert_true(synced);
  assert_int_equal(journal[noperations - 1].kind, RENAME);
  assert_ok(msim_recorder_close(recorder, err));
  msim_sim_destroy(sim), msim_scene_destroy(scene);
  clear_journal();
  remove("a.vtkhdf");
}

/*------------------------------------- power cuts -----------------------------------------------*/

static uint64_t chance = 1;

static int coin(void) {
  chance = chance * 6364136223846793005u + 1442695040888963407u;
  return (int)(chance >> 63);
}

/* Everything up to the last sync is on the disk; of the later writes any subset, torn ones too. */
static void cut_power_at_any_moment(void) {
  enum { TRIES = 8 };
  image synced = {0}, now = {0};
  int from = 0;
  copy(&synced, &first);
  for (int i = 0; i <= noperations; i++) {
    for (int try = 0; try < TRIES && i > from; try++) {
      copy(&now, &synced);
      for (int j = from; j < i; j++) {
        const int kept = try == 0 ? 0 : try == 1 ? j == i - 1 : coin(); /* none, the last, any */
        if (kept) apply(&now, &journal[j], coin() ? journal[j].length : journal[j].length / 2);
      }
      check(&now, journal[i - 1].frames, "power cut", i);
    }
    if (i == noperations || journal[i].kind != SYNC) continue;
    for (; from <= i; from++) apply(&synced, &journal[from], journal[from].length);
  }
  print_message("%d states, %d refused\n", nstates, nrefused);
  free(synced.bytes), free(now.bytes);
  free_images();
}

static void power_cut_in_a_new_file(void **state) {
  (void)state;
  run(1);
  cut_power_at_any_moment();
}

static void power_cut_in_a_resumed_file(void **state) {
  (void)state;
  for (int is_stopped = 0; is_stopped < 2; is_stopped++) {
    run_resumed(1, 3, is_stopped);
    cut_power_at_any_moment();
  }
}

/*------------------------------------- for VTK --------------------------------------------------*/

static int write_states(const char *folder) {
  char path[1024];
  image now = {0};
  if (chdir(folder) != 0) return 1;
  run(0);
  copy(&now, &first);
  for (int i = 0; i < created; i++) apply(&now, &journal[i], journal[i].length);
  for (int i = created; i < noperations; i++) {
    int64_t planned;
    apply(&now, &journal[i], i % 2 ? journal[i].length / 2 : journal[i].length);
    save(&now, "state.vtkhdf");
    snprintf(path, sizeof path, "%03d_%" PRId64 ".vtkhdf", i,
             verify_trajectory("state.vtkhdf", &planned));
    rename("state.vtkhdf", path);
    apply(&now, &journal[i], journal[i].length);
  }
  free(now.bytes);
  free_images();
  return 0;
}

int main(int argc, char **argv) {
  if (!find_hdf5_recorder()) return missing_status("the recorder hdf5");
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(killed_in_a_new_file),        cmocka_unit_test(killed_in_a_resumed_file),
      cmocka_unit_test(named_when_it_is_whole),      cmocka_unit_test(power_cut_in_a_new_file),
      cmocka_unit_test(power_cut_in_a_resumed_file),
  };
  if (argc == 3 && strcmp(argv[1], "states") == 0) return write_states(argv[2]);
  int status = cmocka_run_group_tests(tests, enter_folder, leave_folder);
  free(first.bytes), free(whole.bytes);
  return status;
}
