/* The recorder plugin hdf5: its layout, its hashes, its refusals, full disks.
 *
 *   test_hdf5                           the tests
 *   test_hdf5 write BASE                BASE.vtkhdf, BASE.csv and BASE.json, for vtk_read.py
 *   test_hdf5 slow FILE FRAMES MICROS   frames at a pace, for kill_recorder.py
 *   test_hdf5 verify FILE               prints "GOOD of PLANNED"; status 1 if anything is wrong
 */
#define _POSIX_C_SOURCE 200809L
#define _DEFAULT_SOURCE /* usleep */

#include <dlfcn.h>
#include <fcntl.h>
#include <hdf5.h>
#include <inttypes.h>
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "testing.h"
#include "recording.h"
#include "sim/csv.h"

static counting_host host;

/* NULL where the plugin was not built, or is linked in. */
static const msim_recorder_type *plugin(void) {
  const char *folder = getenv("MSIM_PLUGIN_PATH");
  char path[1024];
  snprintf(path, sizeof path, "%s/msim_recorder_hdf5.so", folder ? folder : "");
  void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  if (!library) return NULL;
  void *symbol = dlsym(library, "msim_recorder_entry");
  msim_recorder_entry_fn *entry;
  memcpy(&entry, &symbol, sizeof entry);
  return entry();
}

/*------------------------------------- reading, independently of the writer ---------------------*/

static hid_t open_trajectory(const char *path) {
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
  hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_file_locking(access, 0, 1);
  hid_t file = H5Fopen(path, H5F_ACC_RDONLY, access);
  H5Pclose(access);
  return file;
}

/* Its dimensions, [0] for scalars; the rank, -1 where there is none. */
static int extent(hid_t file, const char *path, hsize_t dims[2]) {
  dims[0] = dims[1] = 0;
  hid_t dataset = H5Dopen2(file, path, H5P_DEFAULT);
  if (dataset < 0) return -1;
  hid_t space = H5Dget_space(dataset);
  int rank = H5Sget_simple_extent_ndims(space);
  if (rank >= 0 && rank <= 2) H5Sget_simple_extent_dims(space, dims, NULL);
  H5Sclose(space);
  H5Dclose(dataset);
  return rank;
}

/* `rows` rows of a dataset of 64-bit numbers, as they are; all where rows < 0. NULL where they
 * cannot be read. */
static uint64_t *read_rows(hid_t file, const char *path, int64_t first, int64_t rows,
                           int64_t *count) {
  hsize_t dims[2];
  const int rank = extent(file, path, dims);
  if (rows < 0) rows = (int64_t)dims[0];
  if (rank < 1 || first + rows > (int64_t)dims[0]) return NULL;
  *count = rows * (rank == 2 ? (int64_t)dims[1] : 1);
  uint64_t *words = calloc((size_t)*count + 1, sizeof *words);
  const hsize_t start[2] = {(hsize_t)first, 0}, block[2] = {(hsize_t)rows, dims[1]};
  hid_t dataset = H5Dopen2(file, path, H5P_DEFAULT), type = H5Dget_type(dataset);
  hid_t there = H5Dget_space(dataset), here = H5Screate_simple(rank, block, NULL);
  herr_t result = H5Sselect_hyperslab(there, H5S_SELECT_SET, start, NULL, block, NULL);
  const hid_t memory = H5Tget_class(type) == H5T_FLOAT ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT64;
  if (result >= 0) result = H5Dread(dataset, memory, here, there, H5P_DEFAULT, words);
  H5Sclose(here);
  H5Sclose(there);
  H5Tclose(type);
  H5Dclose(dataset);
  if (result >= 0) return words;
  free(words);
  return NULL;
}

static int64_t read_attribute(hid_t file, const char *group, const char *name) {
  int64_t value[2] = {-1, -1};
  hid_t attribute = H5Aopen_by_name(file, group, name, H5P_DEFAULT, H5P_DEFAULT);
  if (attribute < 0) return -1;
  H5Aread(attribute, H5T_NATIVE_INT64, value);
  H5Aclose(attribute);
  return value[0];
}

/* The hash, as the head of hdf5.c tells readers to compute it. */
typedef struct hash {
  uint64_t sum, count;
} hash;

static void hash_word(hash *h, uint64_t word) {
  h->count++;
  uint64_t z = word ^ (h->count * 0x9e3779b97f4a7c15u);
  h->sum += (z ^ (z >> 32)) * 0xbf58476d1ce4e5b9u;
}

static int hash_rows(hash *h, hid_t file, const char *path, int64_t first, int64_t rows) {
  int64_t count = 0;
  uint64_t *words = read_rows(file, path, first, rows, &count);
  for (int64_t i = 0; i < count && words; i++) hash_word(h, words[i]);
  free(words);
  return words != NULL;
}

static int frame_is_good(hid_t file, int64_t i, int64_t n) {
  hash h = {0, 0};
  int64_t one;
  uint64_t *stored = read_rows(file, "/msim/frames/hash", i, 1, &one);
  int good = stored && hash_rows(&h, file, "/VTKHDF/PointData/Velocity", i * n, n) &&
             hash_rows(&h, file, "/VTKHDF/Points", i * n, n) &&
             hash_rows(&h, file, "/msim/frames/time", i, 1) &&
             hash_rows(&h, file, "/msim/frames/step", i, 1) && h.sum == *stored;
  free(stored);
  return good;
}

static int statics_are_good(hid_t file, int64_t n) {
  hash h = {0, 0};
  hsize_t springs[2], scene[2];
  extent(file, "/VTKHDF/CellData/Stiffness", springs);
  extent(file, "/msim/scene", scene);
  hash_word(&h, (uint64_t)n);
  hash_word(&h, springs[0]);
  int good = hash_rows(&h, file, "/VTKHDF/Lines/Connectivity", 0, -1) &&
             hash_rows(&h, file, "/VTKHDF/PointData/Mass", 0, -1) &&
             hash_rows(&h, file, "/VTKHDF/CellData/Stiffness", 0, -1) &&
             hash_rows(&h, file, "/VTKHDF/CellData/RestLength", 0, -1);
  hash_word(&h, scene[0]);
  good = good && hash_rows(&h, file, "/msim/scene", 0, -1);
  return good && h.sum == (uint64_t)read_attribute(file, "/msim", "static_hash");
}

/* Frames committed: the leading zeros of PartOffsets, nothing but ones after them. -1 if not so. */
static int64_t count_committed(hid_t file, int64_t planned) {
  int64_t count = 0, committed = 0, zeros = 0;
  uint64_t *part = read_rows(file, "/VTKHDF/Steps/PartOffsets", 0, -1, &count);
  if (!part) return -1;
  while (committed < count && part[committed] == 0) committed++;
  for (int64_t i = 0; i < count; i++) zeros += part[i] == 0;
  for (int64_t i = committed; i < count; i++)
    if (part[i] != 1) zeros = -1;
  free(part);
  return zeros == committed && count == planned ? committed : -1;
}

/* The frames committed, all checked; < 0 where anything is wrong. */
static int64_t verify(const char *path, int64_t *planned) {
  hid_t file = open_trajectory(path);
  if (file < 0) return -1;
  hsize_t values[2];
  int64_t count, good = -2;
  *planned = read_attribute(file, "/VTKHDF/Steps", "NSteps");
  uint64_t *n = read_rows(file, "/VTKHDF/NumberOfPoints", 0, 1, &count);
  /* longer Values would make VTK write past the end of its arrays */
  if (n && extent(file, "/VTKHDF/Steps/Values", values) == 1 && (int64_t)values[0] == *planned &&
      statics_are_good(file, (int64_t)*n))
    good = count_committed(file, *planned);
  for (int64_t i = 0; i < good; i++)
    if (!frame_is_good(file, i, (int64_t)*n)) good = -3;
  free(n);
  H5Fclose(file);
  return good;
}

static void assert_good(const char *path, int64_t frames, int64_t planned) {
  int64_t found = -1;
  assert_int_equal(verify(path, &found), frames);
  assert_int_equal(found, planned);
}

/*------------------------------------- the file is right ----------------------------------------*/

/* Leaves the file; the caller removes it. */
static void write_file(const char *path, int32_t n, int32_t nsprings, int64_t planned,
                       int64_t written) {
  const msim_recorder_type *hdf5 = plugin();
  if (!hdf5) skip();
  sample s;
  host_init(&host);
  sample_init(&s, path, n, nsprings, planned);
  if (record(hdf5, &host.host, &s, written) != MSIM_OK) fail_msg("%s", host.sentence);
  assert_int_equal(host.live, 0);
  assert_good(path, written, planned);
  sample_free(&s);
}

static void write_and_verify(int32_t n, int32_t nsprings, int64_t planned, int64_t written) {
  write_file("a.vtkhdf", n, nsprings, planned, written);
  remove("a.vtkhdf");
}

static void all_planned_frames(void **state) {
  (void)state;
  write_and_verify(20, 30, 12, 12);
}

static void fewer_frames_than_planned(void **state) {
  (void)state;
  write_and_verify(20, 30, 12, 5);
  write_and_verify(20, 30, 12, 0);
}

static void one_frame(void **state) {
  (void)state;
  write_and_verify(2, 1, 1, 1);
}

static void no_springs(void **state) {
  (void)state;
  write_and_verify(7, 0, 3, 3);
}

static void no_particles(void **state) {
  (void)state;
  write_and_verify(0, 0, 3, 3);
}

/* More rows than a block of 256, frames that are cut into several chunks. */
static void many_frames_and_large_frames(void **state) {
  (void)state;
  write_and_verify(3, 2, 1000, 1000);
  write_and_verify(100001, 2000, 3, 3);
}

static const struct {
  const char *path;
  int rank;
  hsize_t dims[2];
} layout[] = {
    /* 20 particles, 30 springs, 12 frames */
    {"/VTKHDF/NumberOfPoints", 1, {2, 0}},
    {"/VTKHDF/Points", 2, {240, 3}},
    {"/VTKHDF/PointData/Velocity", 2, {240, 3}},
    {"/VTKHDF/PointData/Mass", 1, {20, 0}},
    {"/VTKHDF/CellData/Stiffness", 1, {30, 0}},
    {"/VTKHDF/CellData/RestLength", 1, {30, 0}},
    {"/VTKHDF/FieldData/KineticEnergy", 1, {12, 0}},
    {"/VTKHDF/FieldData/PotentialEnergy", 1, {12, 0}},
    {"/VTKHDF/Lines/NumberOfCells", 1, {2, 0}},
    {"/VTKHDF/Lines/NumberOfConnectivityIds", 1, {2, 0}},
    {"/VTKHDF/Lines/Connectivity", 1, {60, 0}},
    {"/VTKHDF/Lines/Offsets", 1, {32, 0}},
    {"/VTKHDF/Vertices/NumberOfCells", 1, {2, 0}},
    {"/VTKHDF/Vertices/NumberOfConnectivityIds", 1, {2, 0}},
    {"/VTKHDF/Vertices/Connectivity", 1, {0, 0}},
    {"/VTKHDF/Vertices/Offsets", 1, {2, 0}},
    {"/VTKHDF/Polygons/Offsets", 1, {2, 0}},
    {"/VTKHDF/Strips/Offsets", 1, {2, 0}},
    {"/VTKHDF/Steps/Values", 1, {12, 0}},
    {"/VTKHDF/Steps/PartOffsets", 1, {12, 0}},
    {"/VTKHDF/Steps/NumberOfParts", 1, {12, 0}},
    {"/VTKHDF/Steps/PointOffsets", 1, {12, 0}},
    {"/VTKHDF/Steps/CellOffsets", 2, {12, 4}},
    {"/VTKHDF/Steps/ConnectivityIdOffsets", 2, {12, 4}},
    {"/VTKHDF/Steps/PointDataOffsets/Velocity", 1, {12, 0}},
    {"/VTKHDF/Steps/PointDataOffsets/Mass", 1, {12, 0}},
    {"/VTKHDF/Steps/CellDataOffsets/Stiffness", 1, {12, 0}},
    {"/VTKHDF/Steps/CellDataOffsets/RestLength", 1, {12, 0}},
    {"/VTKHDF/Steps/FieldDataOffsets/KineticEnergy", 1, {12, 0}},
    {"/VTKHDF/Steps/FieldDataOffsets/PotentialEnergy", 1, {12, 0}},
    {"/msim/frames/time", 1, {12, 0}},
    {"/msim/frames/step", 1, {12, 0}},
    {"/msim/frames/hash", 1, {12, 0}},
    {"/msim/scene", 1, {30, 0}},
};

static void assert_text(hid_t file, const char *group, const char *name, const char *expected) {
  char text[64] = "";
  hid_t attribute = H5Aopen_by_name(file, group, name, H5P_DEFAULT, H5P_DEFAULT);
  hid_t type = H5Aget_type(attribute);
  assert_int_equal(H5Tis_variable_str(type), 0); /* VTK before 9.5 refuses anything else */
  assert_int_equal(H5Tget_cset(type), H5T_CSET_ASCII);
  assert_int_equal(H5Tget_strpad(type), H5T_STR_NULLPAD);
  assert_int_equal(H5Tget_size(type), strlen(expected));
  assert_true(H5Aread(attribute, type, text) >= 0);
  assert_string_equal(text, expected);
  H5Tclose(type);
  H5Aclose(attribute);
}

static void the_layout_is_that_of_vtkhdf(void **state) {
  (void)state;
  write_file("b.vtkhdf", 20, 30, 12, 12);
  hid_t file = open_trajectory("b.vtkhdf");
  for (size_t i = 0; i < sizeof layout / sizeof *layout; i++) {
    hsize_t dims[2];
    if (extent(file, layout[i].path, dims) != layout[i].rank || dims[0] != layout[i].dims[0] ||
        dims[1] != layout[i].dims[1])
      fail_msg("%s is %d x %d", layout[i].path, (int)dims[0], (int)dims[1]);
  }
  char creator[32];
  snprintf(creator, sizeof creator, "msim %d.%d.%d", MSIM_VERSION_MAJOR, MSIM_VERSION_MINOR,
           MSIM_VERSION_PATCH);
  assert_text(file, "/VTKHDF", "Type", "PolyData");
  assert_text(file, "/msim", "creator", creator);
  assert_int_equal(read_attribute(file, "/VTKHDF", "Version"), 2);
  assert_int_equal(read_attribute(file, "/msim", "format"), 1);
  H5F_info2_t info;
  assert_true(H5Fget_info2(file, &info) >= 0);
  assert_int_equal(info.super.version, 0); /* no mark "open for writing" stays behind */
  H5Fclose(file);
  remove("b.vtkhdf");
}

static void assert_column(hid_t file, const char *path, int64_t first, int64_t stride) {
  int64_t count = 0;
  uint64_t *words = read_rows(file, path, 0, -1, &count);
  assert_non_null(words);
  for (int64_t i = 0; i < count; i++) assert_int_equal(words[i], first + i * stride);
  free(words);
}

static void assert_doubles(hid_t file, const char *path, const double *expected) {
  int64_t count = 0;
  uint64_t *words = read_rows(file, path, 0, -1, &count);
  assert_non_null(words);
  assert_memory_equal(words, expected, (size_t)count * sizeof *expected);
  free(words);
}

static void columns_hold_what_was_given(void **state) {
  (void)state;
  write_file("c.vtkhdf", 4, 3, 600, 2);
  sample s;
  sample_init(&s, "c.vtkhdf", 4, 3, 600);
  hid_t file = open_trajectory("c.vtkhdf");
  assert_doubles(file, "/VTKHDF/Steps/Values", s.times);
  assert_doubles(file, "/VTKHDF/PointData/Mass", s.mass);
  assert_doubles(file, "/VTKHDF/CellData/Stiffness", s.k);
  assert_doubles(file, "/VTKHDF/CellData/RestLength", s.rest);
  assert_column(file, "/VTKHDF/Steps/NumberOfParts", 1, 0);
  assert_column(file, "/VTKHDF/Steps/PointOffsets", 0, 4);
  assert_column(file, "/VTKHDF/Steps/PointDataOffsets/Velocity", 0, 4);
  assert_column(file, "/VTKHDF/Steps/PointDataOffsets/Mass", 0, 0);
  assert_column(file, "/VTKHDF/Steps/CellOffsets", 0, 0);
  assert_column(file, "/VTKHDF/Steps/FieldDataOffsets/KineticEnergy", 0, 1);
  assert_column(file, "/VTKHDF/Steps/FieldDataOffsets/PotentialEnergy", 0, 1);
  H5Fclose(file);
  sample_free(&s);
  remove("c.vtkhdf");
}

static void equal_runs_give_equal_bytes(void **state) {
  (void)state;
  write_file("d.vtkhdf", 20, 30, 300, 290);
  sleep(1); /* a time of day in the file would now differ */
  write_file("e.vtkhdf", 20, 30, 300, 290);
  size_t first, second;
  char *d = slurp("d.vtkhdf", &first), *e = slurp("e.vtkhdf", &second);
  assert_int_equal(first, second);
  assert_memory_equal(d, e, first);
  free(d);
  free(e);
  remove("d.vtkhdf");
  remove("e.vtkhdf");
}

/* Any bit of what the hashes cover. */
static void damage_is_noticed(void **state) {
  (void)state;
  static const char *const paths[] = {"/VTKHDF/Points", "/VTKHDF/PointData/Velocity",
                                      "/msim/frames/step", "/VTKHDF/Lines/Connectivity",
                                      "/VTKHDF/PointData/Mass"};
  int64_t planned;
  for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
    write_file("f.vtkhdf", 3, 2, 2, 2);
    hid_t file = H5Fopen("f.vtkhdf", H5F_ACC_RDWR, H5P_DEFAULT);
    hid_t dataset = H5Dopen2(file, paths[i], H5P_DEFAULT), type = H5Dget_type(dataset);
    uint64_t words[18];
    assert_true(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, words) >= 0);
    words[1] ^= 1;
    assert_true(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, words) >= 0);
    H5Tclose(type);
    H5Dclose(dataset);
    H5Fclose(file);
    assert_true(verify("f.vtkhdf", &planned) < 0);
    remove("f.vtkhdf");
  }
}

/*------------------------------------- refusals -------------------------------------------------*/

static void more_frames_than_planned(void **state) {
  (void)state;
  const msim_recorder_type *hdf5 = plugin();
  if (!hdf5) skip();
  sample s;
  void *self;
  host_init(&host);
  sample_init(&s, "g.vtkhdf", 5, 4, 2);
  assert_int_equal(hdf5->open(&host.host, &s.what, &self), MSIM_OK);
  for (int64_t i = 0; i < 3; i++) {
    msim_frame frame = sample_frame(&s, i);
    assert_int_equal(hdf5->write(self, &frame), i < 2 ? MSIM_OK : MSIM_ERR_ARG);
  }
  assert_string_equal(host.sentence, "g.vtkhdf: all 2 planned frames are written");
  assert_int_equal(hdf5->close(self), MSIM_OK);
  assert_int_equal(host.live, 0);
  assert_good("g.vtkhdf", 2, 2);
  sample_free(&s);
  remove("g.vtkhdf");
}

static void assert_refused(const char *path, int64_t nframes, msim_status status,
                           const char *sentence) {
  const msim_recorder_type *hdf5 = plugin();
  if (!hdf5) skip();
  sample s;
  host_init(&host);
  host.empty = status == MSIM_ERR_MEMORY;
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
  assert_refused("h.vtkhdf", 0, MSIM_ERR_ARG,
                 "final.vtkhdf: cannot create the file: too few or too many frames");
  assert_refused("h.vtkhdf", INT64_MAX / 2, MSIM_ERR_ARG, "too few or too many frames");
  assert_refused("h.vtkhdf", 2, MSIM_ERR_MEMORY, "memory");
}

/* More than any disk holds is refused before a byte is written. */
static void a_disk_that_is_too_small(void **state) {
  (void)state;
  assert_refused("i.vtkhdf", INT64_C(1) << 48, MSIM_ERR_IO, "MB of disk space: ");
  remove("i.vtkhdf");
}

static herr_t host_printer(hid_t stack, void *data) {
  (void)stack;
  ++*(int *)data;
  return 0;
}

static void the_library_never_prints(void **state) {
  (void)state;
  if (!plugin()) skip();
  int printed = 0, before = dup(STDERR_FILENO);
  int to = open("stderr", O_CREAT | O_RDWR | O_TRUNC, 0600);
  H5Eset_auto2(H5E_DEFAULT, host_printer, &printed);
  dup2(to, STDERR_FILENO);
  assert_refused("missing/a.vtkhdf", 2, MSIM_ERR_IO, "");
  dup2(before, STDERR_FILENO);
  off_t length = lseek(to, 0, SEEK_END);
  close(to);
  close(before);
  remove("stderr");
  assert_int_equal(length, 0);
  assert_int_equal(printed, 0);
  H5Dclose(12345); /* the host's own errors are printed as before */
  assert_int_equal(printed, 1);
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
}

/*------------------------------------- full disks -----------------------------------------------*/

/* The file's size limit stands for a full disk. */
static void limit_file_size(rlim_t bytes) {
  const struct rlimit limit = {bytes, bytes};
  setrlimit(RLIMIT_FSIZE, &limit);
  signal(SIGXFSZ, SIG_IGN);
}

enum { FULL_FRAMES = 20, FRAMES_BEFORE = 7 };

/* In a process of its own, which ends as a program does, handlers at exit included. Its exit
 * status: the number of good frames, 100 where open() failed, 200 and more where this test did. */
static void run_into_limit(const char *path, rlim_t at_open, rlim_t while_writing) {
  sample s;
  void *self = NULL;
  const msim_recorder_type *hdf5 = plugin();
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
    if (fine && failed) exit(201); /* once failed, always failed */
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
  if (!plugin()) skip();
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

/* Where space could not be reserved. The limits cut x, v, and what comes after them. */
static void a_disk_that_fills_leaves_whole_frames(void **state) {
  (void)state;
  for (rlim_t limit = 1000; limit < 900000; limit += 139000) {
    assert_int_equal(status_at_limit("k.vtkhdf", 0, limit), FRAMES_BEFORE);
    assert_good("k.vtkhdf", FRAMES_BEFORE, FULL_FRAMES);
    remove("k.vtkhdf");
  }
}

/*------------------------------------- every single write ---------------------------------------*/

/* libhdf5 calls this pwrite instead of the C library's. */
static int64_t writes_left = INT64_MAX; /* before the one that goes wrong; the next ones are fine */
static int dies;                        /* 1: it is torn and the process ends; 0: "disk full" */
static int64_t writes_made;

ssize_t pwrite(int fd, const void *data, size_t bytes, off_t offset) {
  writes_made++;
  if (writes_left-- != 0) return syscall(SYS_pwrite64, fd, data, bytes, offset);
  if (!dies) {
    errno = ENOSPC;
    return -1;
  }
  syscall(SYS_pwrite64, fd, data, bytes / 2, offset);
  _exit(0);
}

enum { WRITE_FRAMES = 5 };

/* As a program does it: opens, writes, closes and exits, whatever goes wrong. */
static void run_with_bad_write(const char *path, int64_t which) {
  sample s;
  void *self = NULL;
  const msim_recorder_type *hdf5 = plugin();
  host_init(&host);
  sample_init(&s, path, 10, 5, WRITE_FRAMES);
  writes_left = which;
  int refused = hdf5->open(&host.host, &s.what, &self) != MSIM_OK;
  for (int i = 0; i < WRITE_FRAMES && !refused && !dies; i++) {
    msim_frame frame = sample_frame(&s, i);
    refused = hdf5->write(self, &frame) != MSIM_OK;
  }
  /* after the first refusal there must be no other answer, though the disk has room again */
  msim_frame frame = sample_frame(&s, 0);
  if (refused && self && hdf5->write(self, &frame) == MSIM_OK) exit(200);
  if (refused && !strstr(host.sentence, "No space left on device")) exit(201);
  if (self && (hdf5->close(self) == MSIM_OK) == refused) exit(202);
  exit(host.live == 0 ? 0 : 203);
}
/*------------------------------------- threads --------------------------------------------------*/

static void *record_in_thread(void *path) {
  sample s;
  counting_host mine;
  host_init(&mine);
  sample_init(&s, path, 50, 40, 200);
  msim_status status = record(plugin(), &mine.host, &s, 200);
  sample_free(&s);
  return status == MSIM_OK && mine.live == 0 ? path : NULL;
}

static void threads_record_side_by_side(void **state) {
  (void)state;
  if (!plugin()) skip();
  static char paths[][16] = {"l.vtkhdf", "m.vtkhdf", "n.vtkhdf"};
  pthread_t threads[3];
  for (int i = 0; i < 3; i++) pthread_create(&threads[i], NULL, record_in_thread, paths[i]);
  for (int i = 0; i < 3; i++) {
    void *result;
    pthread_join(threads[i], &result);
    assert_ptr_equal(result, paths[i]);
  }
  for (int i = 0; i < 3; i++) {
    assert_good(paths[i], 200, 200);
    remove(paths[i]);
  }
}

/*------------------------------------- modes for the tests in Python ----------------------------*/

static int complain(const char *sentence) {
  fprintf(stderr, "%s\n", sentence);
  return 1;
}

static void write_list(FILE *out, const char *key, const double *values, int64_t count) {
  fprintf(out, ",\n\"%s\": [", key);
  for (int64_t i = 0; i < count; i++) fprintf(out, "%s%.17g", i ? ", " : "", values[i]);
  fprintf(out, "]");
}

/* What the CSV file does not tell. */
static int write_json(const char *path, sample *s, int64_t frames) {
  FILE *out = fopen(path, "w");
  if (!out) return complain("cannot write the JSON file");
  double *kinetic = doubles(frames), *potential = doubles(frames),
         *ij = doubles(2 * s->what.nsprings);
  for (int64_t i = 0; i < frames; i++) {
    msim_frame frame = sample_frame(s, i);
    kinetic[i] = frame.kinetic;
    potential[i] = frame.potential;
  }
  for (int32_t i = 0; i < 2 * s->what.nsprings; i++) ij[i] = s->ij[i];
  fprintf(out, "{\"frames\": %" PRId64, frames);
  write_list(out, "times", s->times, s->what.nframes);
  write_list(out, "mass", s->mass, s->what.n);
  write_list(out, "k", s->k, s->what.nsprings);
  write_list(out, "rest", s->rest, s->what.nsprings);
  write_list(out, "ij", ij, 2 * s->what.nsprings);
  write_list(out, "kinetic", kinetic, frames);
  write_list(out, "potential", potential, frames);
  fprintf(out, "}\n");
  free(kinetic);
  free(potential);
  free(ij);
  return fclose(out) == 0 ? 0 : complain("cannot write the JSON file");
}

/* 40 frames planned, 36 written. */
static int write_mode(const char *base) {
  enum { N = 35, NSPRINGS = 60, PLANNED = 40, WRITTEN = 36 };
  const msim_recorder_type *hdf5 = plugin();
  if (!hdf5) return 77;
  char path[3][1024];
  static const char *const endings[] = {"vtkhdf", "csv", "json"};
  for (int i = 0; i < 3; i++) snprintf(path[i], sizeof path[i], "%s.%s", base, endings[i]);
  sample s;
  host_init(&host);
  sample_init(&s, path[0], N, NSPRINGS, PLANNED);
  msim_status status = record(hdf5, &host.host, &s, WRITTEN);
  s.what.path = path[1];
  if (status == MSIM_OK) status = record(ms_recorder_csv(), &host.host, &s, WRITTEN);
  int result = status == MSIM_OK ? write_json(path[2], &s, WRITTEN) : complain(host.sentence);
  sample_free(&s);
  return result;
}

/* Opens as the library does: under another name until all is in place. */
static int slow_mode(const char *path, int64_t frames, int64_t micros) {
  const msim_recorder_type *hdf5 = plugin();
  if (!hdf5) return 77;
  char part[1024];
  snprintf(part, sizeof part, "%s.part", path);
  sample s;
  void *self;
  host_init(&host);
  sample_init(&s, part, 500, 900, frames);
  if (hdf5->open(&host.host, &s.what, &self) != MSIM_OK) return complain(host.sentence);
  if (rename(part, path) != 0) return complain("cannot rename the file");
  for (int64_t i = 0; i < frames; i++) {
    msim_frame frame = sample_frame(&s, i);
    if (hdf5->write(self, &frame) != MSIM_OK) return complain(host.sentence);
    usleep((useconds_t)micros);
  }
  msim_status status = hdf5->close(self);
  sample_free(&s);
  return status == MSIM_OK ? 0 : complain(host.sentence);
}

static int verify_mode(const char *path) {
  int64_t planned = -1, good = verify(path, &planned);
  if (good < 0) return complain("the file is damaged");
  printf("%" PRId64 " of %" PRId64 "\n", good, planned);
  return 0;
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(all_planned_frames),
      cmocka_unit_test(fewer_frames_than_planned),
      cmocka_unit_test(one_frame),
      cmocka_unit_test(no_springs),
      cmocka_unit_test(no_particles),
      cmocka_unit_test(many_frames_and_large_frames),
      cmocka_unit_test(the_layout_is_that_of_vtkhdf),
      cmocka_unit_test(columns_hold_what_was_given),
      cmocka_unit_test(equal_runs_give_equal_bytes),
      cmocka_unit_test(damage_is_noticed),
      cmocka_unit_test(more_frames_than_planned),
      cmocka_unit_test(refusals_say_why),
      cmocka_unit_test(a_disk_that_is_too_small),
      cmocka_unit_test(the_library_never_prints),
      cmocka_unit_test(a_full_disk_is_noticed_before_the_run),
      cmocka_unit_test(a_disk_that_fills_leaves_whole_frames),
      cmocka_unit_test(threads_record_side_by_side),
  };
  if (argc == 3 && strcmp(argv[1], "write") == 0) return write_mode(argv[2]);
  if (argc == 3 && strcmp(argv[1], "verify") == 0) return verify_mode(argv[2]);
  if (argc == 5 && strcmp(argv[1], "slow") == 0)
    return slow_mode(argv[2], atoll(argv[3]), atoll(argv[4]));
  return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
