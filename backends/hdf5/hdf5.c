/* hdf5 - the recorder plugin `hdf5`, which writes trajectories that ParaView can open */
#include "create.h"
#include "file.h"
#include "hash.h"
#include "resume.h"

/* 1: the rows of a column that several ranks share */
static int is_shared(shape s) { return s == VECTOR || s == SINGLE; }

/* Write `rows` rows of a frame, from `first` on. Hosts of older versions give no strain and no
 * reactions: the file has zeros. */
static void write_rows(recorder *r, int i, const entry *e, int64_t frame, int64_t first,
                       int64_t rows) {
  const shape s = h5_columns[i].shape;
  const void *data = (const char *)e + h5_columns[i].source;
  if (s == VECTOR) data = *(const double *const *)data;
  if (s == SINGLE || s == FORCE) data = *(const float *const *)data;
  if (!data || !h5_has_column(r, &h5_columns[i])) return;
  h5_doing(r, "write", h5_columns[i].path);
  h5_put(r, r->column[i], s, (hsize_t)frame * h5_frame_rows(r, s) + (hsize_t)first, (hsize_t)rows,
         data);
}

static void write_column(recorder *r, int i, const entry *e) {
  write_rows(r, i, e, r->written, 0, (int64_t)h5_frame_rows(r, h5_columns[i].shape));
}

static hid_t slot_of(const recorder *r, int64_t frame) { return r->slot[frame % NSLOTS]; }

/* Write a part of the bytes of a slot: whole words, and in the last part what is left. */
static void write_slot_bytes(recorder *r, const msim_frame *frame, const msim_frame_part *part) {
  const size_t size = frame->checkpoint_length, words = size / 8, first = part->checkpoint_first;
  const hid_t slot = slot_of(r, part->frame);
  uint64_t last = 0;
  if (!frame->checkpoint || !h5_doing(r, "write", h5_slots[part->frame % NSLOTS])) return;
  if (first + size > r->capacity) {
    h5_fail(r, MSIM_ERR_ARG, "a checkpoint of %zu bytes exceeds the %zu planned", first + size,
            r->capacity);
    return;
  }
  h5_put(r, slot, WHOLE, SLOT_BYTES + first / 8, words, frame->checkpoint);
  if (size % 8 == 0) return;
  memcpy(&last, (const char *)frame->checkpoint + 8 * words, size % 8);
  h5_put(r, slot, WHOLE, SLOT_BYTES + first / 8 + words, 1, &last);
}

static void write_shared_rows(recorder *r, const entry *e, const msim_frame_part *part) {
  for (int i = 0; i < COMMIT; i++) {
    const shape s = h5_columns[i].shape;
    if (s == VECTOR) write_rows(r, i, e, part->frame, part->first, part->n);
    if (s == SINGLE) write_rows(r, i, e, part->frame, part->first_cell, part->ncells);
  }
  write_slot_bytes(r, &e->frame, part);
}

static void write_slot_head(recorder *r, const msim_frame *frame, const msim_frame_part *part,
                            uint64_t bytes_hash) {
  uint64_t head[SLOT_BYTES] = {[SLOT_FRAME] = (uint64_t)part->frame,
                               [SLOT_STEP] = (uint64_t)frame->step,
                               [SLOT_LENGTH] = part->checkpoint_length};
  if (part->checkpoint_length == 0 || !h5_doing(r, "write", h5_slots[part->frame % NSLOTS])) return;
  head[SLOT_HASH] = bytes_hash + h5_slot_head_hash(head);
  h5_put(r, slot_of(r, part->frame), WHOLE, 0, SLOT_BYTES, head);
}

static void write_count(recorder *r, int64_t frames) {
  r->complete = frames;
  if (r->count >= 0) h5_put(r, r->count, WHOLE, 0, 1, &frames);
}

/* Uncommit frames from `written` on, last first, so that there is never a gap. */
static void uncommit_frames(recorder *r) {
  const hid_t values = r->column[TIME_SHOWN], commit = r->column[COMMIT];
  if (r->committed == r->written) return;
  write_count(r, r->written);
  h5_flush(r);
  h5_put(r, values, REAL, (hsize_t)r->committed - 1, 1, &r->planned_t);
  for (; r->committed > r->written; h5_flush(r))
    h5_put(r, commit, WHOLE, (hsize_t)--r->committed, 1, &(int64_t){1});
}

/* Write all but the shared rows, and commit the frame. */
static void commit_entry(recorder *r, const entry *e, const msim_frame_part *part,
                         const msim_frame_hash *sum) {
  for (int i = 0; i < COMMIT; i++)
    if (!is_shared(h5_columns[i].shape)) write_column(r, i, e);
  write_slot_head(r, &e->frame, part, sum->checkpoint);
  h5_flush(r);
  write_column(r, COMMIT, e);
  h5_flush(r);
  write_count(r, r->written + 1);
}

/*------------------------------------- the recorder ---------------------------------------------*/

/* Planned frames that were not written remain and show nothing: removing them would change
 * metadata, and a file whose writer is killed in between may be damaged. */
static msim_status close_recorder(void *self) {
  recorder *r = self;
  const msim_host *host = r->host;
  h5_doing(r, "close", "the file");
  WITH_LIBRARY(host, write_count(r, r->complete); h5_drop(r, H5Fclose, r->file));
  const msim_status status = h5_report(r);
  host->free(host, r->words);
  host->free(host, r);
  return status;
}

/* Copy as much of a struct as the host provides; the rest stays 0. */
#define COPY_KNOWN_MEMBERS(mine, given) \
  memcpy(&(mine), given, (given)->size < sizeof(mine) ? (given)->size : sizeof(mine))

/* Create the file, resume it if `from` is not NULL, or join its writers. */
static msim_status start_recorder(const msim_host *host, const msim_recording *given,
                                  msim_resumption *from, int joins, void **self) {
  msim_recording what = {0};
  COPY_KNOWN_MEMBERS(what, given);
  const char *name = what.name ? what.name : what.path;
  recorder *r = host->alloc(host, sizeof *r + strlen(name) + 1);
  *self = NULL;
  if (!r) {
    host->fail(host, "%s: out of memory for a recorder", name);
    return MSIM_ERR_MEMORY;
  }
  *r = (recorder){host,
                  .file = H5I_INVALID_HID,
                  .count = H5I_INVALID_HID,
                  .format = FORMAT,
                  .n = what.n,
                  .ncells = (int64_t)what.nsprings + what.nfaces,
                  .nframes = what.nframes,
                  .sync = what.sync};
  memcpy(r->name, name, strlen(name) + 1);
  for (int32_t p = 0; p < what.n && what.pinned; p++) r->has_pins |= what.pinned[p];
  if (joins) WITH_LIBRARY(host, h5_join(r, &what));
  else if (from) WITH_LIBRARY(host, h5_resume(r, &what, from));
  else WITH_LIBRARY(host, h5_create(r, &what));
  if (r->fault.status != MSIM_OK) return close_recorder(r);
  *self = r;
  return MSIM_OK;
}

static msim_status open_recorder(const msim_host *host, const msim_recording *what, void **self) {
  return start_recorder(host, what, NULL, 0, self);
}

static msim_status join_recorder(const msim_host *host, const msim_recording *what, void **self) {
  return start_recorder(host, what, NULL, 1, self);
}

static msim_status resume_recorder(const msim_host *host, const msim_recording *what,
                                   msim_resumption *from, void **self) {
  msim_resumption found = {.size = from->size};
  const msim_status status = start_recorder(host, what, &found, 0, self);
  memcpy(from, &found, found.size < sizeof found ? found.size : sizeof found);
  return status;
}

static int32_t recognize_file(const msim_host *host, const char *path) {
  int ours;
  recorder r = {host, .file = H5I_INVALID_HID};
  WITH_LIBRARY(host, ours = h5_recognize(&r, path));
  return ours;
}

static msim_status begin_frame(void *self) {
  recorder *r = self;
  if (r->written == r->nframes) {
    r->host->fail(r->host, "%s: all %lld planned frames have been written already", r->name,
                  (long long)r->nframes);
    return MSIM_ERR_ARG;
  }
  r->host->free(r->host, r->words);
  r->words = NULL;
  WITH_LIBRARY(r->host, uncommit_frames(r));
  return h5_report(r);
}

/* Rows of other processes than the one that commits the frame reach the file here. */
static msim_status write_part(void *self, const msim_frame *frame, const msim_frame_part *part,
                              msim_frame_hash *sum) {
  recorder *r = self;
  entry e = {.part = 0};
  COPY_KNOWN_MEMBERS(e.frame, frame);
  sum->rows = h5_rows_hash(r->n, frame, part->first, part->n);
  sum->checkpoint = h5_slot_bytes_hash(part->checkpoint_first, e.frame.checkpoint,
                                       e.frame.checkpoint ? e.frame.checkpoint_length : 0);
  WITH_LIBRARY(r->host, write_shared_rows(r, &e, part); if (part->n < r->n) h5_flush(r));
  return h5_report(r);
}

static msim_status commit_frame(void *self, const msim_frame *frame, const msim_frame_part *part,
                                const msim_frame_hash *sum) {
  recorder *r = self;
  entry e = {.part = 0};
  COPY_KNOWN_MEMBERS(e.frame, frame);
  e.hash = sum->rows + h5_frame_rest_hash(r->n, frame);
  WITH_LIBRARY(r->host, commit_entry(r, &e, part, sum));
  if (r->fault.status == MSIM_OK) r->committed = ++r->written;
  return h5_report(r);
}

static msim_status write_frame(void *self, const msim_frame *frame) {
  const recorder *r = self;
  msim_frame known = {0};
  COPY_KNOWN_MEMBERS(known, frame);
  const msim_frame_part all = {.size = sizeof all,
                               .frame = r->written,
                               .n = (int32_t)r->n,
                               .ncells = r->ncells,
                               .checkpoint_length = known.checkpoint ? known.checkpoint_length : 0};
  msim_frame_hash sum;
  msim_status status = begin_frame(self);
  if (!status) status = write_part(self, frame, &all, &sum);
  return status ? status : commit_frame(self, frame, &all, &sum);
}

MSIM_RECORDER_ENTRY(hdf5) {
  static const msim_recorder_type type = {
      .abi = MSIM_RECORDER_ABI,
      .size = sizeof type,
      .name = "hdf5",
      .extension = ".vtkhdf",
      .library = H5_VERS_INFO,
      .license = "BSD-3-Clause",
      .open = open_recorder,
      .write = write_frame,
      .close = close_recorder,
      .resume = resume_recorder,
      .recognize = recognize_file,
      .join = join_recorder,
      .begin = begin_frame,
      .write_part = write_part,
      .commit = commit_frame,
      .reads_scene = 1,
  };
  return &type;
}
