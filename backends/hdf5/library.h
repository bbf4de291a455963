/* library - libhdf5 as a plugin uses it: one at a time, silent, and with a reason where it fails */
#ifndef HDF5_LIBRARY_H
#define HDF5_LIBRARY_H

#define _POSIX_C_SOURCE 200809L /* posix_fallocate: no header comes before this one */
#define H5_USE_110_API
#include <errno.h>
#include <fcntl.h>
#include <hdf5.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "msim/status.h"

/* The first failure: nothing is done after it. */
typedef struct fault {
  msim_status status;
  char reason[256];
} fault;

static inline void fault_set(fault *f, msim_status status, const char *reason) {
  if (f->status != MSIM_OK) return;
  f->status = status;
  snprintf(f->reason, sizeof f->reason, "%s", reason);
}

/* The innermost record of libhdf5's error stack. That of a failed system call ends like
 * "errno = 28, error message = 'No space left on device', ...": the part in quotes will do. */
static inline herr_t fault_explain(unsigned depth, const H5E_error2_t *record, void *data) {
  static const char mark[] = "error message = '";
  fault *f = data;
  if (depth > 0 || !record->desc) return 0;
  const char *found = strstr(record->desc, mark);
  fault_set(f, found ? MSIM_ERR_IO : MSIM_ERR_BACKEND, found ? found + strlen(mark) : record->desc);
  if (found) f->reason[strcspn(f->reason, "'")] = '\0';
  return 0;
}

/* Every result of libhdf5 passes here. Reasons are taken at once: the next call clears them. */
static inline int ok(fault *f, int64_t result) {
  if (result < 0 && f->status == MSIM_OK) {
    (void)H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, fault_explain, f);
    fault_set(f, MSIM_ERR_BACKEND, "libhdf5 does not say why");
  }
  return result >= 0;
}

static inline hid_t id(fault *f, hid_t result) { return ok(f, result) ? result : H5I_INVALID_HID; }

static inline void drop(fault *f, herr_t (*close)(hid_t), hid_t object) {
  if (object >= 0) ok(f, close(object));
}

/* libhdf5 aborts the process where it is not the release whose headers were compiled in. */
static inline int library_fits(void) {
  unsigned v[3] = {0, 0, 0};
  return H5get_libversion(&v[0], &v[1], &v[2]) >= 0 && v[0] == H5_VERS_MAJOR &&
         v[1] == H5_VERS_MINOR && v[2] == H5_VERS_RELEASE;
}

/* Take disk space now: "disk full" then comes before anything is written, and libhdf5, which would
 * keep for ever what it cannot write, never sees it. Some file systems cannot promise space. */
static inline void reserve_disk(fault *f, hid_t file, double bytes) {
  void *fd = NULL;
  if (!ok(f, H5Fget_vfd_handle(file, H5P_DEFAULT, &fd))) return;
  int error = EINTR;
  while (error == EINTR) error = posix_fallocate(*(const int *)fd, 0, (off_t)bytes);
  if (error && error != EOPNOTSUPP && error != EINVAL) fault_set(f, MSIM_ERR_IO, strerror(error));
}

/* libhdf5 is one per process and, as often built, not safe for threads. While it is in our hands
 * it must not print. At exit it would try again and again to write what a full disk refused, and
 * crash; H5dont_atexit forbids that if it comes first, else it changes nothing. Of a plugin one
 * file alone takes it. */
static inline pthread_mutex_t *library(void) {
  static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
  return &mutex;
}

#define WITH_LIBRARY(work)           \
  do {                               \
    pthread_mutex_lock(library());   \
    (void)H5dont_atexit();           \
    H5E_BEGIN_TRY { work; }          \
    H5E_END_TRY                      \
    pthread_mutex_unlock(library()); \
  } while (0)

#endif
