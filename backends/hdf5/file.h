/* file - an open trajectory file: its datasets, its error state, reading and writing of rows
 *
 * After the first failure nothing more is read or written. */
#ifndef HDF5_FILE_H
#define HDF5_FILE_H

#include "library.h"
#include "layout.h"

typedef struct recorder {
  const msim_host *host;
  hid_t file, column[NWRITTEN], slot[NSLOTS], count; /* invalid: what the file's format lacks */
  int format, has_pins;
  int64_t n, ncells, nframes, written;
  int64_t complete;  /* frames committed without a gap, for NCommitted */
  int64_t committed; /* index after the last frame marked as committed; those from `written` on are
                        to be uncommitted */
  double planned_t;  /* planned time of the last of them, s */
  int sync;
  size_t capacity;     /* size of a checkpoint, bytes; 0: no slots */
  uint64_t scene_hash; /* of the text of the scene, while the file is created */
  uint64_t *words;     /* the slot that a file is resumed from; else NULL */
  fault fault;
  char operation[96]; /* present operation, for messages */
  char name[];        /* name of the file, for messages */
} recorder;

/* Set the present operation for messages. Returns 0 after a failure. */
int h5_doing(recorder *r, const char *verb, const char *object);
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void h5_fail(recorder *r, msim_status status, const char *format, ...);

/* All results of libhdf5 are checked by these. */
static inline int h5_ok(recorder *r, int64_t result) { return check_result(&r->fault, result); }
static inline hid_t h5_id(recorder *r, hid_t result) { return check_id(&r->fault, result); }
static inline void h5_drop(recorder *r, herr_t (*close)(hid_t), hid_t object) {
  close_object(&r->fault, close, object);
}

/* Pass the error to the host and return its status. */
msim_status h5_report(const recorder *r);

void h5_put(recorder *r, hid_t to, shape s, hsize_t first, hsize_t rows, const void *data);
void h5_get(recorder *r, hid_t from, shape s, hsize_t first, hsize_t rows, void *data);

/* Number of rows of a shape per frame */
static inline hsize_t h5_frame_rows(const recorder *r, shape s) {
  return h5_rows(s, r->n, r->ncells);
}

/* 1: the file has this column. */
static inline int h5_has_column(const recorder *r, const column *c) {
  return c->format <= r->format && (r->has_pins || c->format != FORMAT_OF_PINS);
}

/* Allocate the buffer to read slots with checkpoints of `capacity` bytes. */
void h5_allocate_slot(recorder *r, size_t capacity);

enum { CREATE, GO_ON, LOOK };
void h5_open_file(recorder *r, const char *path, int how);

/* Write all buffers to the file, and with `sync` flush it to the disk. */
void h5_flush(recorder *r);

/* Allocate disk space, so that a full disk is reported before the run and not during it. */
void h5_reserve(recorder *r, double bytes);

#endif
