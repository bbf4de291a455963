#include "resume.h"

#include <inttypes.h>
#include <string.h>

#include "hash.h"

/* Words read at once. */
enum { BLOCK = 1536 };

/*------------------------------------- contents of the file -------------------------------------*/

static int64_t get_attribute(recorder *r, const char *group, const char *name) {
  int64_t value = 0;
  if (r->fault.status != MSIM_OK) return 0;
  hid_t attribute = h5_id(r, H5Aopen_by_name(r->file, group, name, H5P_DEFAULT, H5P_DEFAULT));
  if (attribute >= 0) h5_ok(r, H5Aread(attribute, H5T_NATIVE_INT64, &value));
  h5_drop(r, H5Aclose, attribute);
  return value;
}

/* Whether the file contains all data of the dataset, so that reading `rows` rows is bounded by the
 * size of the file. */
static int has_all_data(recorder *r, hid_t dataset, hid_t type, shape s, hsize_t rows) {
  hsize_t size = 0;
  h5_ok(r, H5Fget_filesize(r->file, &size));
  const double claimed = (double)rows * (double)h5_width[s] * (double)H5Tget_size(type);
  const hsize_t stored = H5Dget_storage_size(dataset);
  return (double)stored >= claimed && stored <= size;
}

/* Open a dataset of this shape and get its number of rows; refuse all others. */
static hid_t open_dataset(recorder *r, const char *path, shape s, hsize_t *rows) {
  hsize_t dims[H5S_MAX_RANK] = {0};
  if (r->fault.status != MSIM_OK) return H5I_INVALID_HID;
  hid_t dataset = h5_id(r, H5Dopen2(r->file, path, H5P_DEFAULT));
  hid_t space = h5_id(r, H5Dget_space(dataset));
  hid_t type = h5_id(r, H5Dget_type(dataset));
  hid_t create = h5_id(r, H5Dget_create_plist(dataset));
  const int fits = r->fault.status == MSIM_OK &&
                   H5Sget_simple_extent_dims(space, dims, NULL) == h5_rank(s) &&
                   (h5_rank(s) == 1 || dims[1] == h5_width[s]) &&
                   H5Tequal(type, h5_file_type(s)) > 0 && H5Pget_nfilters(create) == 0 &&
                   H5Pget_external_count(create) == 0 && has_all_data(r, dataset, type, s, dims[0]);
  if (!fits && r->fault.status == MSIM_OK)
    h5_fail(r, MSIM_ERR_ARG, "its dataset %s was not created by msim, or is damaged", path);
  h5_drop(r, H5Pclose, create);
  h5_drop(r, H5Tclose, type);
  h5_drop(r, H5Sclose, space);
  *rows = dims[0];
  return dataset;
}

static hid_t open_rows(recorder *r, const char *path, shape s, hsize_t wanted) {
  hsize_t rows;
  hid_t dataset = open_dataset(r, path, s, &rows);
  if (r->fault.status == MSIM_OK && rows != wanted)
    h5_fail(r, MSIM_ERR_ARG, "its dataset %s has %" PRIu64 " rows, not %" PRIu64, path,
            (uint64_t)rows, (uint64_t)wanted);
  return dataset;
}

static int64_t get_count(recorder *r, const char *path) {
  int64_t counts[2] = {0, 0};
  hid_t dataset = open_rows(r, path, WHOLE, 2);
  h5_get(r, dataset, WHOLE, 0, 2, counts);
  h5_drop(r, H5Dclose, dataset);
  return counts[0];
}

static int is_msim_file(const recorder *r) {
  return r->fault.status == MSIM_OK &&
         H5Aexists_by_name(r->file, "/msim", "format", H5P_DEFAULT) > 0;
}

static void check_counts(recorder *r, const msim_recording *what) {
  if (r->fault.status == MSIM_OK && !is_msim_file(r))
    h5_fail(r, MSIM_ERR_ARG, "it is not a trajectory written by msim");
  const int64_t format = get_attribute(r, "/msim", "format");
  const int64_t n = get_count(r, "/VTKHDF/NumberOfPoints");
  const int64_t nsprings = get_count(r, "/VTKHDF/Lines/NumberOfCells");
  const int64_t nfaces = get_count(r, "/VTKHDF/Polygons/NumberOfCells");
  r->nframes = get_attribute(r, "/VTKHDF/Steps", "NSteps");
  if (r->fault.status != MSIM_OK) return;
  r->format = (int)format;
  r->has_pins = H5Lexists(r->file, h5_columns[REACTION].path, H5P_DEFAULT) > 0;
  r->ncells = (int64_t)what->nsprings + (format > 1 ? what->nfaces : 0);
  if (format < 1 || format > FORMAT)
    h5_fail(r, MSIM_ERR_ARG,
            "it has format %" PRId64 ", which this version of msim does not support", format);
  else if (n != what->n)
    h5_fail(r, MSIM_ERR_ARG, "it has %" PRId64 " particles, but the scene has %d", n, what->n);
  else if (nsprings != what->nsprings)
    h5_fail(r, MSIM_ERR_ARG, "it has %" PRId64 " springs, but the scene has %d", nsprings,
            what->nsprings);
  else if (format > 1 && nfaces != what->nfaces)
    h5_fail(r, MSIM_ERR_ARG, "it has %" PRId64 " faces, but the scene has %d", nfaces,
            what->nfaces);
  else if (what->nframes > r->nframes)
    h5_fail(r, MSIM_ERR_ARG,
            "it was created for %" PRId64 " frames, but this run has %" PRId64
            "; reduce t_end or steps, or start another file from the last state",
            r->nframes, what->nframes);
}

/* Open the datasets that are written during the run; return the number of words of a slot. */
static hsize_t open_columns(recorder *r) {
  hsize_t words[NSLOTS] = {0};
  for (int i = 0; i < NWRITTEN; i++) {
    const column *c = &h5_columns[i];
    if (!h5_has_column(r, c)) continue;
    r->column[i] =
        open_rows(r, c->path, c->shape, (hsize_t)r->nframes * h5_frame_rows(r, c->shape));
  }
  if (r->format > 1) r->count = open_rows(r, "/msim/frames/NCommitted", WHOLE, 1);
  if (r->fault.status == MSIM_OK && H5Lexists(r->file, "/msim/checkpoint", H5P_DEFAULT) <= 0)
    h5_fail(r, MSIM_ERR_ARG, "it contains no checkpoints, so it cannot be resumed");
  for (int i = 0; i < NSLOTS; i++) r->slot[i] = open_dataset(r, h5_slots[i], WHOLE, &words[i]);
  if (r->fault.status == MSIM_OK && (words[0] != words[1] || words[0] < SLOT_BYTES))
    h5_fail(r, MSIM_ERR_ARG, "its checkpoints are damaged");
  return words[0];
}

/*------------------------------------- integrity ------------------------------------------------*/

/* Add rows of the file to a hash. */
static void hash_rows(recorder *r, hash *h, hid_t dataset, shape s, int64_t first, int64_t rows) {
  uint64_t words[BLOCK];
  const int64_t most = BLOCK / (int64_t)h5_width[s];
  for (int64_t i = 0; i < rows && r->fault.status == MSIM_OK; i += most) {
    const int64_t count = rows - i < most ? rows - i : most;
    h5_get(r, dataset, s, (hsize_t)(first + i), (hsize_t)count, words);
    h5_hash_words(h, (size_t)count * h5_width[s], words);
  }
}

/* Hash the first of `all` rows of a dataset. */
static void hash_dataset(recorder *r, hash *h, const char *path, shape s, int64_t rows,
                         int64_t all) {
  hid_t dataset = open_rows(r, path, s, (hsize_t)all);
  hash_rows(r, h, dataset, s, 0, rows);
  h5_drop(r, H5Dclose, dataset);
}

static void check_constants(recorder *r, const msim_recording *what) {
  hash h = {0, 0};
  hsize_t length = 0;
  const int64_t ends = 2 * (int64_t)what->nsprings, corners = 3 * (r->ncells - what->nsprings);
  h5_hash_words(&h, 2, (int64_t[]){what->n, what->nsprings});
  hash_dataset(r, &h, "/VTKHDF/Lines/Connectivity", WHOLE, ends, ends);
  hash_dataset(r, &h, "/VTKHDF/PointData/Mass", REAL, what->n, what->n);
  hash_dataset(r, &h, "/VTKHDF/CellData/Stiffness", REAL, what->nsprings, r->ncells);
  hash_dataset(r, &h, "/VTKHDF/CellData/RestLength", REAL, what->nsprings, r->ncells);
  hid_t scene = open_dataset(r, "/msim/scene", BYTE, &length);
  h5_hash_words(&h, 1, &length);
  hash_rows(r, &h, scene, WHOLE, 0, (int64_t)length); /* one byte per word */
  h5_drop(r, H5Dclose, scene);
  hash_dataset(r, &h, "/VTKHDF/Polygons/Connectivity", WHOLE, corners, corners);
  if (h.sum != (uint64_t)get_attribute(r, "/msim", "static_hash") && r->fault.status == MSIM_OK)
    h5_fail(r, MSIM_ERR_ARG, "its mesh, parameters or scene are damaged: wrong hash");
}

static uint64_t get_word(recorder *r, int i, int64_t frame) {
  uint64_t word = 0;
  h5_get(r, r->column[i], h5_columns[i].shape, (hsize_t)frame, 1, &word);
  return word;
}

static int frame_is_intact(recorder *r, int64_t i) {
  hash h = {0, 0};
  hash_rows(r, &h, r->column[V], VECTOR, i * r->n, r->n);
  hash_rows(r, &h, r->column[X], VECTOR, i * r->n, r->n);
  hash_rows(r, &h, r->column[TIME], REAL, i, 1);
  hash_rows(r, &h, r->column[STEP], WHOLE, i, 1);
  return h.sum == get_word(r, HASH, i) && r->fault.status == MSIM_OK;
}

/*------------------------------------- point of continuation ------------------------------------*/

/* Number of frames committed without a gap; *beyond: up to the last frame marked as committed. A
 * power failure may leave gaps. */
static int64_t count_committed(recorder *r, int64_t *beyond) {
  int64_t part[BLOCK], committed = 0;
  *beyond = 0;
  for (int64_t i = 0; i < r->nframes && r->fault.status == MSIM_OK; i += BLOCK) {
    const int64_t count = r->nframes - i < BLOCK ? r->nframes - i : BLOCK;
    h5_get(r, r->column[COMMIT], WHOLE, (hsize_t)i, (hsize_t)count, part);
    for (int64_t j = 0; j < count; j++) {
      if (part[j] != 0) continue;
      committed += committed == i + j;
      *beyond = i + j + 1;
    }
  }
  return committed;
}

/* Number of frames up to and including that of a slot; 0 if the slot or its frame is damaged, or if
 * the frame is not one of this run. */
static int64_t frames_of_slot(recorder *r, int which, int64_t committed, const double *times) {
  const uint64_t *slot = r->words;
  h5_get(r, r->slot[which], WHOLE, 0, h5_slot_words(r->capacity), r->words);
  if (r->fault.status != MSIM_OK || slot[SLOT_FRAME] >= (uint64_t)committed ||
      slot[SLOT_LENGTH] > r->capacity || slot[SLOT_HASH] != h5_slot_hash(slot))
    return 0;
  const int64_t frame = (int64_t)slot[SLOT_FRAME];
  const uint64_t t = get_word(r, TIME, frame);
  const int fits =
      memcmp(&t, &times[frame], sizeof t) == 0 && get_word(r, STEP, frame) == slot[SLOT_STEP];
  return fits && frame_is_intact(r, frame) ? frame + 1 : 0;
}

static void find_checkpoint(recorder *r, int64_t committed, const double *times) {
  int newest = 0;
  for (int i = 0; i < NSLOTS && committed > 0; i++) {
    const int64_t frames = frames_of_slot(r, i, committed, times);
    if (frames <= r->written) continue;
    r->written = frames;
    newest = i;
  }
  if (r->written > 0) h5_get(r, r->slot[newest], WHOLE, 0, h5_slot_words(r->capacity), r->words);
}

/* Compare the planned times with those shown in the file. They may differ for the last frame
 * written, for the next one, whose writing may have begun, and for the last frame of this run, if
 * its time is before that of the next frame in the file. */
static void check_times(recorder *r, const msim_recording *what) {
  double shown[BLOCK];
  const int64_t last = what->nframes - 1;
  for (int64_t i = 0; i < r->nframes && r->fault.status == MSIM_OK; i += BLOCK) {
    const int64_t count = r->nframes - i < BLOCK ? r->nframes - i : BLOCK;
    h5_get(r, r->column[TIME_SHOWN], REAL, (hsize_t)i, (hsize_t)count, shown);
    for (int64_t j = i; j < i + count && r->fault.status == MSIM_OK; j++) {
      const double there = shown[j - i], here = what->times[j < last ? j : last];
      const int free = j >= r->written && (j == last || j == r->committed || j == r->committed - 1);
      const int differs = j <= last ? !free && there != here : j == last + 1 && there <= here;
      if (differs)
        h5_fail(r, MSIM_ERR_ARG,
                "its frame %" PRId64
                " was planned at t = %.17g s, but at %.17g s in this run; use the same fps, every "
                "and h",
                j, there, here);
    }
  }
}

static void find_resume_point(recorder *r, const msim_recording *what) {
  const int64_t committed = r->complete = count_committed(r, &r->committed);
  if (r->fault.status == MSIM_OK && r->committed > what->nframes)
    h5_fail(r, MSIM_ERR_ARG,
            "it already contains %" PRId64 " frames, but this run has only %" PRId64, r->committed,
            what->nframes);
  if (r->fault.status != MSIM_OK) return;
  find_checkpoint(r, committed, what->times);
  if (r->committed > r->written) r->planned_t = what->times[r->committed - 1];
  check_times(r, what);
  if (r->written == 0 && committed > 0 && r->fault.status == MSIM_OK)
    h5_fail(r, MSIM_ERR_ARG,
            "none of its %" PRId64 " frames has an intact checkpoint and belongs to this run",
            committed);
}

/* libhdf5 may change a damaged file as soon as it is opened for writing, so it is reopened only
 * after all checks. */
static void reopen_for_writing(recorder *r, const char *path) {
  h5_drop(r, H5Fclose, r->file);
  r->file = H5I_INVALID_HID;
  h5_open_file(r, path, GO_ON);
  open_columns(r);
}

void h5_resume(recorder *r, const msim_recording *what, msim_resumption *from) {
  h5_doing(r, "resume", "the file");
  h5_open_file(r, what->path, LOOK);
  check_counts(r, what);
  h5_allocate_slot(r, (size_t)(open_columns(r) - SLOT_BYTES) * 8);
  check_constants(r, what);
  find_resume_point(r, what);
  if (r->fault.status == MSIM_OK) reopen_for_writing(r, what->path);
  if (r->fault.status != MSIM_OK) return;
  from->frames = r->written;
  if (r->written == 0) return;
  from->step = (int64_t)r->words[SLOT_STEP];
  from->checkpoint = r->words + SLOT_BYTES;
  from->checkpoint_length = r->words[SLOT_LENGTH];
}

void h5_join(recorder *r, const msim_recording *what) {
  h5_doing(r, "open", "the file");
  h5_open_file(r, what->path, GO_ON);
  check_counts(r, what);
  r->capacity = (size_t)(open_columns(r) - SLOT_BYTES) * 8;
  h5_drop(r, H5Dclose, r->count); /* that of the other process */
  r->count = H5I_INVALID_HID;
}

int h5_recognize(recorder *r, const char *path) {
  h5_open_file(r, path, LOOK);
  const int ours = is_msim_file(r);
  h5_drop(r, H5Fclose, r->file);
  return ours;
}
