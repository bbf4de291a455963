/* library - use of libhdf5 by plugins: one thread at a time, no printing, error messages */
#ifndef HDF5_LIBRARY_H
#define HDF5_LIBRARY_H

#define _POSIX_C_SOURCE 200809L /* for posix_fallocate: must be defined before any system header */
#define H5_USE_110_API
#include <errno.h>
#include <fcntl.h>
#include <hdf5.h>
#include <stdio.h>
#include <string.h>

#include "msim/status.h"

/* The first failure; later ones are ignored. */
typedef struct fault {
  msim_status status;
  char reason[256];
} fault;

static inline void fault_set(fault *f, msim_status status, const char *reason) {
  if (f->status != MSIM_OK) return;
  f->status = status;
  snprintf(f->reason, sizeof f->reason, "%s", reason);
}

/* Get the reason from the innermost record of libhdf5's error stack. That of a failed system call
 * ends like "errno = 28, error message = 'No space left on device', ...": extract it. */
static inline herr_t fault_explain(unsigned depth, const H5E_error2_t *record, void *data) {
  static const char mark[] = "error message = '";
  fault *f = data;
  if (depth > 0 || !record->desc) return 0;
  const char *found = strstr(record->desc, mark);
  fault_set(f, found ? MSIM_ERR_IO : MSIM_ERR_BACKEND, found ? found + strlen(mark) : record->desc);
  if (found) f->reason[strcspn(f->reason, "'")] = '\0';
  return 0;
}

/* Check a result of libhdf5. The reason is read at once, because the next call clears it. */
static inline int check_result(fault *f, int64_t result) {
  if (result < 0 && f->status == MSIM_OK) {
    (void)H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, fault_explain, f);
    fault_set(f, MSIM_ERR_BACKEND, "libhdf5 gave no reason");
  }
  return result >= 0;
}

static inline hid_t check_id(fault *f, hid_t result) {
  return check_result(f, result) ? result : H5I_INVALID_HID;
}

static inline void close_object(fault *f, herr_t (*close)(hid_t), hid_t object) {
  if (object >= 0) check_result(f, close(object));
}

#define OTHER_RELEASE                                                                              \
  "another release of HDF5 is installed than the one that the plugin was built for (" H5_VERS_INFO \
  "); rebuild the plugin"

/* libhdf5 aborts the process if it is not the release of the headers used here. */
static inline int library_fits(void) {
  unsigned v[3] = {0, 0, 0};
  return H5get_libversion(&v[0], &v[1], &v[2]) >= 0 && v[0] == H5_VERS_MAJOR &&
         v[1] == H5_VERS_MINOR && v[2] == H5_VERS_RELEASE;
}

/* Allocate disk space: a full disk is then reported before anything is written, and libhdf5, which
 * keeps data that it cannot write, never meets it. Some file systems cannot allocate space. */
static inline void reserve_disk(fault *f, hid_t file, double bytes) {
  void *fd = NULL;
  if (!check_result(f, H5Fget_vfd_handle(file, H5P_DEFAULT, &fd))) return;
  int error = EINTR;
  while (error == EINTR) error = posix_fallocate(*(const int *)fd, 0, (off_t)bytes);
  if (error && error != EOPNOTSUPP && error != EINVAL) fault_set(f, MSIM_ERR_IO, strerror(error));
}

/* libhdf5 has one state per process and is often built without thread safety; recorder and importer
 * are two plugins, hence the host's lock. It must not print while it is used here. At exit it would
 * repeat writes that a full disk refused, and crash; H5dont_atexit prevents that if it is the first
 * call, else it has no effect. */
#define WITH_LIBRARY(host, work)     \
  do {                               \
    (host)->lock(host);              \
    (void)H5dont_atexit();           \
    H5E_BEGIN_TRY { work; }          \
    H5E_END_TRY(host)->unlock(host); \
  } while (0)

#endif
