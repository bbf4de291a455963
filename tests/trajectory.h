/* trajectory - reads a .vtkhdf file and checks it independently of the plugin that wrote it */
#ifndef TRAJECTORY_H
#define TRAJECTORY_H

#include <hdf5.h>

#include "testing.h"
#include "sample_recording.h"
#include "record/recorders.h"

/* The recorder hdf5, loaded or linked in; NULL: missing. */
static inline const msim_recorder_type *find_hdf5_recorder(void) {
  const msim_allocator alloc = ms_memory_allocator(NULL);
  const msim_options opt = {.plugin_path = NULL};
  const msim_recorder_type *type;
  return ms_recorders_find("a.vtkhdf", &opt, &alloc, &type, NULL) ? NULL : type;
}

static inline hid_t open_trajectory(const char *path) {
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
  hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_file_locking(access, 0, 1);
  hid_t file = H5Fopen(path, H5F_ACC_RDONLY, access);
  H5Pclose(access);
  return file;
}

/* The rank of a dataset, -1 if it does not exist; dims: its dimensions, dims[0] = 0 for a
 * scalar. */
static inline int dataset_extent(hid_t file, const char *path, hsize_t dims[2]) {
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

/* Rows first to first + rows - 1 of a dataset of 64-bit numbers, as raw words; rows < 0: all. NULL
 * where they cannot be read. */
static inline uint64_t *read_rows(hid_t file, const char *path, int64_t first, int64_t rows,
                                  int64_t *count) {
  hsize_t dims[2];
  const int rank = dataset_extent(file, path, dims);
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

static inline int64_t read_attribute(hid_t file, const char *group, const char *name) {
  int64_t value[2] = {-1, -1};
  hid_t attribute = H5Aopen_by_name(file, group, name, H5P_DEFAULT, H5P_DEFAULT);
  if (attribute < 0) return -1;
  H5Aread(attribute, H5T_NATIVE_INT64, value);
  H5Aclose(attribute);
  return value[0];
}

/* The hash that the comment at the top of hdf5.c defines. */
typedef struct trajectory_hash {
  uint64_t sum, count;
} trajectory_hash;

static inline void hash_word(trajectory_hash *h, uint64_t word) {
  h->count++;
  uint64_t z = word ^ (h->count * 0x9e3779b97f4a7c15u);
  h->sum += (z ^ (z >> 32)) * 0xbf58476d1ce4e5b9u;
}

static inline int hash_rows(trajectory_hash *h, hid_t file, const char *path, int64_t first,
                            int64_t rows) {
  int64_t count = 0;
  uint64_t *words = read_rows(file, path, first, rows, &count);
  for (int64_t i = 0; i < count && words; i++) hash_word(h, words[i]);
  free(words);
  return words != NULL;
}

static inline int is_frame_valid(hid_t file, int64_t i, int64_t n) {
  trajectory_hash h = {0, 0};
  int64_t one;
  uint64_t *stored = read_rows(file, "/msim/frames/hash", i, 1, &one);
  int good = stored && hash_rows(&h, file, "/VTKHDF/PointData/Velocity", i * n, n) &&
             hash_rows(&h, file, "/VTKHDF/Points", i * n, n) &&
             hash_rows(&h, file, "/msim/frames/time", i, 1) &&
             hash_rows(&h, file, "/msim/frames/step", i, 1) && h.sum == *stored;
  free(stored);
  return good;
}

static inline int are_statics_valid(hid_t file, int64_t n) {
  trajectory_hash h = {0, 0};
  hsize_t ends[2], scene[2];
  dataset_extent(file, "/VTKHDF/Lines/Connectivity", ends);
  dataset_extent(file, "/msim/scene", scene);
  const int64_t springs = (int64_t)ends[0] / 2;
  hash_word(&h, (uint64_t)n);
  hash_word(&h, (uint64_t)springs);
  int good = hash_rows(&h, file, "/VTKHDF/Lines/Connectivity", 0, -1) &&
             hash_rows(&h, file, "/VTKHDF/PointData/Mass", 0, -1) &&
             hash_rows(&h, file, "/VTKHDF/CellData/Stiffness", 0, springs) &&
             hash_rows(&h, file, "/VTKHDF/CellData/RestLength", 0, springs);
  hash_word(&h, scene[0]);
  good = good && hash_rows(&h, file, "/msim/scene", 0, -1) &&
         hash_rows(&h, file, "/VTKHDF/Polygons/Connectivity", 0, -1);
  return good && h.sum == (uint64_t)read_attribute(file, "/msim", "static_hash");
}

/* The number of committed frames: the leading zeros of PartOffsets, which only ones may follow; -1
 * otherwise. */
static inline int64_t count_committed(hid_t file, int64_t planned) {
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

/* NCommitted, which may be too small after a crash; -1 if it is missing */
static inline int64_t committed_count(hid_t file) {
  int64_t rows, count;
  uint64_t *word = read_rows(file, "/msim/frames/NCommitted", 0, 1, &rows);
  count = word ? (int64_t)*word : -1;
  free(word);
  return count;
}

/* Check all committed frames; returns their number, < 0 where anything is wrong. */
static inline int64_t verify_trajectory(const char *path, int64_t *planned) {
  hid_t file = open_trajectory(path);
  if (file < 0) return -1;
  hsize_t values[2];
  int64_t count, good = -2;
  *planned = read_attribute(file, "/VTKHDF/Steps", "NSteps");
  uint64_t *n = read_rows(file, "/VTKHDF/NumberOfPoints", 0, 1, &count);
  /* VTK reads all of Values, and writes past the end of its arrays if there are more */
  if (n && dataset_extent(file, "/VTKHDF/Steps/Values", values) == 1 &&
      (int64_t)values[0] == *planned && are_statics_valid(file, (int64_t)*n))
    good = count_committed(file, *planned);
  for (int64_t i = 0; i < good; i++)
    if (!is_frame_valid(file, i, (int64_t)*n)) good = -3;
  if (good >= 0 && committed_count(file) > good) good = -4;
  free(n);
  H5Fclose(file);
  return good;
}

static inline void set_trajectory_format(const char *path, int64_t format) {
  hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT);
  hid_t group = H5Gopen2(file, "/msim", H5P_DEFAULT);
  hid_t attribute = H5Aopen(group, "format", H5P_DEFAULT);
  assert_true(H5Awrite(attribute, H5T_NATIVE_INT64, &format) >= 0);
  H5Aclose(attribute), H5Gclose(group), H5Fclose(file);
}

static inline void assert_trajectory_valid(const char *path, int64_t frames, int64_t planned) {
  int64_t found = -1;
  assert_int_equal(verify_trajectory(path, &found), frames);
  assert_int_equal(found, planned);
}

#endif
