/* file - a trajectory that is open: its datasets, what went wrong with it, rows of numbers
 *
 * Nothing is written after the first failure. */
#ifndef HDF5_FILE_H
#define HDF5_FILE_H

#include "layout.h"

typedef struct recorder {
  const msim_host *host;
  hid_t file, column[NWRITTEN];
  int64_t n, nframes, written;
  msim_status status; /* that of the first failure */
  char doing[96];     /* what failed */
  char reason[256];   /* and why */
  char name[];        /* of the file, for messages */
} recorder;

/* Say what is going to be done, for the message should it fail; 0 where something has failed. */
int h5_doing(recorder *r, const char *verb, const char *object);
void h5_fail(recorder *r, msim_status status, const char *reason);

/* Every result of libhdf5 passes here: >= 0 is good. */
int h5_ok(recorder *r, int64_t result);
hid_t h5_id(recorder *r, hid_t result);
void h5_drop(recorder *r, herr_t (*close)(hid_t), hid_t object);

/* Tell the host. */
msim_status h5_report(const recorder *r);

void h5_put(recorder *r, hid_t to, shape s, hsize_t first, hsize_t rows, const void *data);

void h5_create_file(recorder *r, const char *path);
void h5_flush(recorder *r);

/* Take disk space now: "disk full" then comes before the run and not hours into it. Some file
 * systems cannot promise space; there a write may fail later. */
void h5_reserve(recorder *r, double bytes);

#endif
