/* file - a trajectory that is open: its datasets, what went wrong with it, rows of numbers
 *
 * Nothing is read or written after the first failure. */
#ifndef HDF5_FILE_H
#define HDF5_FILE_H

#include "library.h"
#include "layout.h"

typedef struct recorder {
  const msim_host *host;
  hid_t file, column[NWRITTEN], slot[NSLOTS];
  int64_t n, nframes, written;
  int64_t committed; /* before the last one that says so; above `written` those are taken back */
  double planned_t;  /* of that last one, s */
  int sync;
  size_t capacity; /* bytes of a checkpoint; 0: there are no slots */
  uint64_t *words; /* of a slot */
  fault fault;
  char doing[96]; /* what failed */
  char name[];    /* of the file, for messages */
} recorder;

/* Say what is going to be done, for the message should it fail; 0 where something has failed. */
int h5_doing(recorder *r, const char *verb, const char *object);
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void h5_fail(recorder *r, msim_status status, const char *format, ...);

/* Every result of libhdf5 passes here. */
static inline int h5_ok(recorder *r, int64_t result) { return ok(&r->fault, result); }
static inline hid_t h5_id(recorder *r, hid_t result) { return id(&r->fault, result); }
static inline void h5_drop(recorder *r, herr_t (*close)(hid_t), hid_t object) {
  drop(&r->fault, close, object);
}

/* Tell the host. */
msim_status h5_report(const recorder *r);

void h5_put(recorder *r, hid_t to, shape s, hsize_t first, hsize_t rows, const void *data);
void h5_get(recorder *r, hid_t from, shape s, hsize_t first, hsize_t rows, void *data);

/* Memory for a slot of so many bytes. */
void h5_allocate_slot(recorder *r, size_t capacity);

enum { CREATE, GO_ON, LOOK };
void h5_open_file(recorder *r, const char *path, int how);

/* Into the file, and with `sync` onto the disk. */
void h5_flush(recorder *r);

/* "Disk full" then comes before the run and not hours into it. */
void h5_reserve(recorder *r, double bytes);

#endif
