/* hdf5 - the recorder plugin `hdf5`: trajectories that ParaView opens as they are */
#include <hdf5.h>
#include <pthread.h>
#include <string.h>

#include "create.h"
#include "file.h"
#include "hash.h"

static void put_column(recorder *r, int i, const entry *e) {
  const shape s = h5_columns[i].shape;
  const hsize_t rows = h5_rows(s, r->n);
  const void *data = (const char *)e + h5_columns[i].source;
  if (s == VECTOR) data = *(const double *const *)data;
  h5_doing(r, "write", h5_columns[i].path);
  h5_put(r, r->column[i], s, (hsize_t)r->written * rows, rows, data);
}

static void put_entry(recorder *r, const entry *e) {
  for (int i = 0; i < COMMIT; i++) put_column(r, i, e);
  h5_flush(r);
  put_column(r, COMMIT, e);
  h5_flush(r);
}

/*------------------------------------- the recorder ---------------------------------------------*/

/* libhdf5 is one per process and, as often built, not safe for threads. While it is in our hands
 * it must not print. At exit it would try again and again to write what a full disk refused, and
 * crash; H5dont_atexit forbids that if it comes first, else it changes nothing. */
static pthread_mutex_t library = PTHREAD_MUTEX_INITIALIZER;

#define WITH_LIBRARY(work)          \
  do {                              \
    pthread_mutex_lock(&library);   \
    (void)H5dont_atexit();          \
    H5E_BEGIN_TRY { work; }         \
    H5E_END_TRY                     \
    pthread_mutex_unlock(&library); \
  } while (0)

/* Frames that were planned but not written stay, and show nothing: to cut them would change
 * metadata, and a file whose writer is killed while it does that may be damaged. */
static msim_status close_recorder(void *self) {
  recorder *r = self;
  h5_doing(r, "close", "the file");
  WITH_LIBRARY(h5_drop(r, H5Fclose, r->file));
  const msim_status status = h5_report(r);
  r->host->free(r->host, r);
  return status;
}

static msim_status open_recorder(const msim_host *host, const msim_recording *what, void **self) {
  const char *name = what->name ? what->name : what->path;
  recorder *r = host->alloc(host, sizeof *r + strlen(name) + 1);
  *self = NULL;
  if (!r) {
    host->fail(host, "%s: no memory for a recorder", name);
    return MSIM_ERR_MEMORY;
  }
  *r = (recorder){host, .file = H5I_INVALID_HID, .n = what->n, .nframes = what->nframes};
  memcpy(r->name, name, strlen(name) + 1);
  WITH_LIBRARY(h5_create(r, what));
  if (r->status != MSIM_OK) return close_recorder(r);
  *self = r;
  return MSIM_OK;
}

static msim_status write_frame(void *self, const msim_frame *frame) {
  recorder *r = self;
  if (r->written == r->nframes) {
    r->host->fail(r->host, "%s: all %lld planned frames are written", r->name,
                  (long long)r->nframes);
    return MSIM_ERR_ARG;
  }
  const entry e = {*frame, h5_frame_hash(r->n, frame), 0};
  WITH_LIBRARY(put_entry(r, &e));
  if (r->status == MSIM_OK) r->written++;
  return h5_report(r);
}

MSIM_RECORDER_ENTRY(hdf5) {
  static const msim_recorder_type type = {
      MSIM_RECORDER_ABI, sizeof type,   "hdf5",      ".vtkhdf",      H5_VERS_INFO,
      "BSD-3-Clause",    open_recorder, write_frame, close_recorder,
  };
  return &type;
}
