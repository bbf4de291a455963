#include "file.h"

#include <stdarg.h>
#include <unistd.h>

/*------------------------------------- errors ---------------------------------------------------*/

int h5_doing(recorder *r, const char *verb, const char *object) {
  if (r->fault.status == MSIM_OK)
    snprintf(r->operation, sizeof r->operation, "%s %s", verb, object);
  return r->fault.status == MSIM_OK;
}

void h5_fail(recorder *r, msim_status status, const char *format, ...) {
  char reason[sizeof r->fault.reason];
  va_list args;
  va_start(args, format);
  vsnprintf(reason, sizeof reason, format, args);
  va_end(args);
  fault_set(&r->fault, status, reason);
}

msim_status h5_report(const recorder *r) {
  if (r->fault.status != MSIM_OK)
    r->host->fail(r->host, "%s: cannot %s: %s", r->name, r->operation, r->fault.reason);
  return r->fault.status;
}

/*------------------------------------- rows -----------------------------------------------------*/

/* Write if `data` is not NULL, else read to `to`. */
static void transfer_rows(recorder *r, hid_t dataset, shape s, hsize_t first, hsize_t rows,
                          const void *data, void *to) {
  if (r->fault.status != MSIM_OK || rows == 0) return;
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
  transfer_rows(r, to, s, first, rows, data, NULL);
}

void h5_get(recorder *r, hid_t from, shape s, hsize_t first, hsize_t rows, void *data) {
  transfer_rows(r, from, s, first, rows, NULL, data);
}

void h5_allocate_slot(recorder *r, size_t capacity) {
  if (r->fault.status != MSIM_OK) return;
  r->capacity = capacity;
  r->words = r->host->alloc(r->host, h5_slot_words(capacity) * sizeof *r->words);
  if (!r->words) h5_fail(r, MSIM_ERR_MEMORY, "out of memory for a checkpoint");
}

/*------------------------------------- the file -------------------------------------------------*/

/* Superblock 0 has no "open for writing" flag that could remain set. No locks: viewers may open the
 * file while it is written. No chunk cache and no sieve buffer: a failing write is reported by the
 * call that made it, and leaves nothing for libhdf5 to write when it closes the file. */
void h5_open_file(recorder *r, const char *path, int how) {
  if (!library_fits()) h5_fail(r, MSIM_ERR_PLUGIN, "%s", OTHER_RELEASE);
  if (r->fault.status != MSIM_OK) return;
  hid_t access = h5_id(r, H5Pcreate(H5P_FILE_ACCESS));
  h5_ok(r, H5Pset_fapl_sec2(access));
  h5_ok(r, H5Pset_file_locking(access, 0, 1));
  h5_ok(r, H5Pset_cache(access, 0, 0, 0, 0.0));
  h5_ok(r, H5Pset_sieve_buf_size(access, 0));
  h5_ok(r, H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V18));
  h5_ok(r, H5Pset_fclose_degree(access, H5F_CLOSE_STRONG)); /* closes all datasets, too */
  const unsigned mode = how == LOOK ? H5F_ACC_RDONLY : H5F_ACC_RDWR;
  if (r->fault.status == MSIM_OK)
    r->file = h5_id(r, how == CREATE ? H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access)
                                     : H5Fopen(path, mode, access));
  h5_drop(r, H5Pclose, access);
}

void h5_flush(recorder *r) {
  void *fd = NULL;
  if (!h5_doing(r, "write", "the file") || !h5_ok(r, H5Fflush(r->file, H5F_SCOPE_GLOBAL))) return;
  if (r->sync && h5_ok(r, H5Fget_vfd_handle(r->file, H5P_DEFAULT, &fd)) &&
      fdatasync(*(const int *)fd) != 0)
    h5_fail(r, MSIM_ERR_IO, "%s", strerror(errno));
}

void h5_reserve(recorder *r, double bytes) {
  char size[48];
  snprintf(size, sizeof size, "%.3g MB of disk space", bytes / 1e6);
  if (h5_doing(r, "reserve", size)) reserve_disk(&r->fault, r->file, bytes);
}
