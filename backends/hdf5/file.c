#define _POSIX_C_SOURCE 200809L /* posix_fallocate */
#include "file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/*------------------------------------- errors ---------------------------------------------------*/

int h5_doing(recorder *r, const char *verb, const char *object) {
  if (r->status == MSIM_OK) snprintf(r->doing, sizeof r->doing, "%s %s", verb, object);
  return r->status == MSIM_OK;
}

void h5_fail(recorder *r, msim_status status, const char *format, ...) {
  va_list args;
  va_start(args, format);
  r->status = status;
  vsnprintf(r->reason, sizeof r->reason, format, args);
  va_end(args);
}

/* The innermost record of libhdf5's error stack. That of a failed system call ends like
 * "errno = 28, error message = 'No space left on device', ...": the part in quotes will do. */
static herr_t explain(unsigned depth, const H5E_error2_t *record, void *data) {
  static const char mark[] = "error message = '";
  recorder *r = data;
  if (depth > 0 || !record->desc) return 0;
  const char *found = strstr(record->desc, mark);
  h5_fail(r, found ? MSIM_ERR_IO : MSIM_ERR_BACKEND, "%s",
          found ? found + strlen(mark) : record->desc);
  if (found) r->reason[strcspn(r->reason, "'")] = '\0';
  return 0;
}

/* Reasons are taken at once: the next call clears them. */
int h5_ok(recorder *r, int64_t result) {
  if (result < 0 && r->status == MSIM_OK) {
    h5_fail(r, MSIM_ERR_BACKEND, "libhdf5 does not say why");
    (void)H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, explain, r);
  }
  return result >= 0;
}

hid_t h5_id(recorder *r, hid_t result) { return h5_ok(r, result) ? result : H5I_INVALID_HID; }

void h5_drop(recorder *r, herr_t (*close)(hid_t), hid_t object) {
  if (object >= 0) h5_ok(r, close(object));
}

msim_status h5_report(const recorder *r) {
  if (r->status != MSIM_OK)
    r->host->fail(r->host, "%s: cannot %s: %s", r->name, r->doing, r->reason);
  return r->status;
}

/*------------------------------------- rows -----------------------------------------------------*/

/* Of the two one is NULL. */
static void move(recorder *r, hid_t dataset, shape s, hsize_t first, hsize_t rows, const void *data,
                 void *to) {
  if (r->status != MSIM_OK || rows == 0) return;
  const hsize_t start[] = {first, 0}, count[] = {rows, h5_width[s]};
  const hid_t type = h5_memory_type(s);
  hid_t there = h5_id(r, H5Dget_space(dataset));
  hid_t here = h5_id(r, H5Screate_simple(h5_rank(s), count, NULL));
  if (h5_ok(r, H5Sselect_hyperslab(there, H5S_SELECT_SET, start, NULL, count, NULL)))
    h5_ok(r, data ? H5Dwrite(dataset, type, here, there, H5P_DEFAULT, data)
                  : H5Dread(dataset, type, here, there, H5P_DEFAULT, to));
  h5_drop(r, H5Sclose, here);
  h5_drop(r, H5Sclose, there);
}

void h5_put(recorder *r, hid_t to, shape s, hsize_t first, hsize_t rows, const void *data) {
  move(r, to, s, first, rows, data, NULL);
}

void h5_get(recorder *r, hid_t from, shape s, hsize_t first, hsize_t rows, void *data) {
  move(r, from, s, first, rows, NULL, data);
}

void h5_allocate_slot(recorder *r, size_t capacity) {
  if (r->status != MSIM_OK) return;
  r->capacity = capacity;
  r->words = r->host->alloc(r->host, h5_slot_words(capacity) * sizeof *r->words);
  if (!r->words) h5_fail(r, MSIM_ERR_MEMORY, "no memory for a checkpoint");
}

/*------------------------------------- the file -------------------------------------------------*/

/* libhdf5 aborts the process where it is not the release whose headers were compiled in. */
static int library_fits(void) {
  unsigned v[3] = {0, 0, 0};
  return H5get_libversion(&v[0], &v[1], &v[2]) >= 0 && v[0] == H5_VERS_MAJOR &&
         v[1] == H5_VERS_MINOR && v[2] == H5_VERS_RELEASE;
}

/* Superblock 0, which has no "open for writing" flag to be left behind. No locks: viewers may open
 * the file while it is written. No cache of chunks, no sieve: a write that fails does so in the
 * call that made it, and leaves nothing behind that libhdf5 would have to write when it closes. */
void h5_open_file(recorder *r, const char *path, int how) {
  if (!library_fits()) h5_fail(r, MSIM_ERR_PLUGIN, "built for another release of " H5_VERS_INFO);
  if (r->status != MSIM_OK) return;
  hid_t access = h5_id(r, H5Pcreate(H5P_FILE_ACCESS));
  h5_ok(r, H5Pset_fapl_sec2(access));
  h5_ok(r, H5Pset_file_locking(access, 0, 1));
  h5_ok(r, H5Pset_cache(access, 0, 0, 0, 0.0));
  h5_ok(r, H5Pset_sieve_buf_size(access, 0));
  h5_ok(r, H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V18));
  h5_ok(r, H5Pset_fclose_degree(access, H5F_CLOSE_STRONG)); /* with all datasets */
  const unsigned mode = how == LOOK ? H5F_ACC_RDONLY : H5F_ACC_RDWR;
  if (r->status == MSIM_OK)
    r->file = h5_id(r, how == CREATE ? H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access)
                                     : H5Fopen(path, mode, access));
  h5_drop(r, H5Pclose, access);
}

static int descriptor(recorder *r) {
  void *fd;
  return h5_ok(r, H5Fget_vfd_handle(r->file, H5P_DEFAULT, &fd)) ? *(const int *)fd : -1;
}

void h5_flush(recorder *r) {
  if (!h5_doing(r, "write", "the file") || !h5_ok(r, H5Fflush(r->file, H5F_SCOPE_GLOBAL))) return;
  const int fd = r->sync ? descriptor(r) : -1;
  if (fd >= 0 && fdatasync(fd) != 0) h5_fail(r, MSIM_ERR_IO, "%s", strerror(errno));
}

void h5_reserve(recorder *r, double bytes) {
  char size[48];
  snprintf(size, sizeof size, "%.3g MB of disk space", bytes / 1e6);
  const int fd = h5_doing(r, "reserve", size) ? descriptor(r) : -1;
  if (fd < 0) return;
  int error = EINTR;
  while (error == EINTR) error = posix_fallocate(fd, 0, (off_t)bytes);
  if (error && error != EOPNOTSUPP && error != EINVAL)
    h5_fail(r, MSIM_ERR_IO, "%s", strerror(error));
}
