/* Every state in which a crash can leave a trajectory: whatever the disk kept of what was written,
 * the file opens, holds every frame that was written, and can be gone on with to the same bytes.
 *
 *   test_hdf5_replay                    the tests
 *   test_hdf5_replay states FOLDER      some of the states, as FOLDER/I_FRAMES.vtkhdf, for VTK
 */
#define _DEFAULT_SOURCE /* mkdtemp, syscall */

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <sys/syscall.h>

#include "trajectory.h"

/*------------------------------------- what is written ------------------------------------------*/

typedef struct operation {
  enum { WRITE, RESIZE, RESERVE, SYNC } kind;
  size_t at, length;
  char *data; /* of a WRITE */
  int frames; /* whose write() had returned before */
} operation;

enum { MOST = 4000 };
static operation journal[MOST];
static int noperations, is_open, frames_returned;

static void note(int kind, size_t at, size_t length, const void *data) {
  if (!is_open) return;
  operation *o = &journal[noperations++];
  if (noperations > MOST) abort();
  *o = (operation){kind, at, length, data ? malloc(length) : NULL, frames_returned};
  if (data) memcpy(o->data, data, length);
}

/* libhdf5 and the plugin call these, which are visible, instead of the C library's. */
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

/*------------------------------------- the disk -------------------------------------------------*/

typedef struct image {
  char *bytes;
  size_t length, room;
} image;

static void resize(image *to, size_t length) {
  if (length > to->room) {
    to->room = 2 * length;
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
static sample s;
static image first, whole; /* when open() has returned, and at the end */
static int nstates;        /* checked */

static void load(image *to, const char *path) {
  size_t length = 0;
  char *bytes = slurp(path, &length);
  assert_non_null(bytes);
  resize(to, length);
  memcpy(to->bytes, bytes, length);
  free(bytes);
}

/* All frames: as they are written, the journal tells. */
static void run(int sync) {
  const msim_recorder_type *hdf5 = plugin();
  void *self;
  host_init(&host);
  sample_init(&s, "a.vtkhdf", N, NSPRINGS, FRAMES);
  s.what.sync = sync;
  noperations = frames_returned = nstates = 0;
  assert_int_equal(hdf5->open(&host.host, &s.what, &self), MSIM_OK);
  load(&first, "a.vtkhdf");
  is_open = 1;
  for (int i = 0; i < FRAMES; i++) {
    const msim_frame frame = sample_frame(&s, i);
    assert_int_equal(hdf5->write(self, &frame), MSIM_OK);
    frames_returned++;
  }
  assert_int_equal(hdf5->close(self), MSIM_OK);
  is_open = 0;
  load(&whole, "a.vtkhdf");
}

static void forget(void) {
  for (int i = 0; i < noperations; i++) free(journal[i].data);
  sample_free(&s);
  remove("a.vtkhdf");
}

/* The frames that had been written are in it and good, and at most one more; and who goes on from
 * there ends with the same bytes. */
static void check(const image *state, int frames, const char *what, int at) {
  static image end;
  int64_t planned, kept;
  save(state, "state.vtkhdf");
  const int64_t good = verify("state.vtkhdf", &planned);
  if (good < frames || good > frames + 1 || planned != FRAMES)
    fail_msg("%s at operation %d: %" PRId64 " good frames of %d", what, at, good, frames);
  s.what.path = "state.vtkhdf";
  if (record_on(plugin(), &host.host, &s, FRAMES, &kept) != MSIM_OK)
    fail_msg("%s at operation %d: %s", what, at, host.sentence);
  load(&end, "state.vtkhdf");
  if (kept < good - 1 || end.length != whole.length ||
      memcmp(end.bytes, whole.bytes, whole.length) != 0)
    fail_msg("%s at operation %d: %" PRId64 " frames kept, another end", what, at, kept);
  s.what.path = "a.vtkhdf";
  nstates++;
  remove("state.vtkhdf");
}

/*------------------------------------- killed ---------------------------------------------------*/

/* Between two operations, or within a write: at each page of the disk, and in the middle. */
static void killed_at_any_moment(void **state) {
  (void)state;
  enum { PAGE = 4096 };
  image now = {0}, torn = {0};
  run(0);
  copy(&now, &first);
  check(&now, 0, "killed", 0);
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
  print_message("%d operations, %d states\n", noperations, nstates);
  assert_in_range(noperations, 10 * FRAMES, MOST);
  free(now.bytes), free(torn.bytes);
  forget();
}

/*------------------------------------- power cuts -----------------------------------------------*/

static uint64_t chance = 1;

static int coin(void) {
  chance = chance * 6364136223846793005u + 1442695040888963407u;
  return (int)(chance >> 63);
}

/* Up to the last sync all is on the disk; of what follows anything, torn writes too. */
static void power_cut_at_any_moment(void **state) {
  (void)state;
  enum { TRIES = 8 };
  image synced = {0}, now = {0};
  int from = 0;
  run(1);
  copy(&synced, &first);
  for (int i = 0; i <= noperations; i++) {
    for (int try = 0; try < TRIES && i > from; try++) {
      copy(&now, &synced);
      for (int j = from; j < i; j++) {
        const int kept = try == 0 ? 0 : try == 1 ? j == i - 1 : coin(); /* nothing, the last, any */
        if (kept) apply(&now, &journal[j], coin() ? journal[j].length : journal[j].length / 2);
      }
      check(&now, journal[i - 1].frames, "power cut", i);
    }
    if (i == noperations || journal[i].kind != SYNC) continue;
    for (; from <= i; from++) apply(&synced, &journal[from], journal[from].length);
  }
  print_message("%d states\n", nstates);
  free(synced.bytes), free(now.bytes);
  forget();
}

/*------------------------------------- for VTK --------------------------------------------------*/

static int write_states(const char *folder) {
  char path[1024];
  image now = {0};
  if (chdir(folder) != 0) return 1;
  run(0);
  copy(&now, &first);
  for (int i = 0; i < noperations; i++) {
    int64_t planned;
    apply(&now, &journal[i], i % 2 ? journal[i].length / 2 : journal[i].length);
    save(&now, "state.vtkhdf");
    snprintf(path, sizeof path, "%03d_%" PRId64 ".vtkhdf", i, verify("state.vtkhdf", &planned));
    rename("state.vtkhdf", path);
    apply(&now, &journal[i], journal[i].length);
  }
  free(now.bytes);
  forget();
  return 0;
}

int main(int argc, char **argv) {
  if (!plugin()) return missing_status("the recorder hdf5");
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(killed_at_any_moment),
      cmocka_unit_test(power_cut_at_any_moment),
  };
  if (argc == 3 && strcmp(argv[1], "states") == 0) return write_states(argv[2]);
  int status = cmocka_run_group_tests(tests, enter_folder, leave_folder);
  free(first.bytes), free(whole.bytes);
  return status;
}
