#define _POSIX_C_SOURCE 200809L /* open, ftruncate */
#include "record/frame_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { LONGEST_PRINT = 512 };

void ms_frame_file_open(ms_frame_file *file, const msim_host *host, const msim_recording *what,
                        const char *name) {
  memset(file, 0, offsetof(ms_frame_file, buffer));
  file->host = host;
  file->name = name;
  file->sync = what->sync;
  file->fd = open(what->path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file->fd < 0) file->error = errno;
}

/* Uses write(), as stdio might still write the rest of a frame after an error. */
static void flush_buffer(ms_frame_file *file) {
  size_t done = 0;
  while (done < file->used && !file->error) {
    ssize_t count = write(file->fd, file->buffer + done, file->used - done);
    if (count >= 0) done += (size_t)count;
    else if (errno != EINTR) file->error = errno;
  }
  file->length += (int64_t)done;
  file->used = 0;
}

void ms_frame_file_print(ms_frame_file *file, const char *format, ...) {
  va_list args;
  if (file->used + LONGEST_PRINT > MS_FRAME_FILE_BUFFER) flush_buffer(file);
  va_start(args, format);
  file->used += (size_t)vsnprintf(file->buffer + file->used, LONGEST_PRINT, format, args);
  va_end(args);
}

void ms_frame_file_write(ms_frame_file *file, const void *bytes, size_t count) {
  const char *next = bytes;
  while (count > 0) {
    const size_t room = MS_FRAME_FILE_BUFFER - file->used, part = count < room ? count : room;
    memcpy(file->buffer + file->used, next, part);
    file->used += part;
    next += part;
    count -= part;
    if (file->used == MS_FRAME_FILE_BUFFER) flush_buffer(file);
  }
}

static msim_status report_error(const ms_frame_file *file) {
  if (!file->error) return MSIM_OK;
  file->host->fail(file->host, "%s: cannot write the file: %s%s", file->name, strerror(file->error),
                   file->torn ? "; its last frame is incomplete" : "");
  return ms_error_io_status(file->error);
}

msim_status ms_frame_file_end_frame(ms_frame_file *file) {
  flush_buffer(file);
  if (!file->error && file->sync && fdatasync(file->fd) != 0) file->error = errno;
  if (!file->error) file->complete = file->length;
  if (file->length > file->complete && ftruncate(file->fd, file->complete) != 0) file->torn = 1;
  else file->length = file->complete;
  return report_error(file);
}

msim_status ms_frame_file_close(ms_frame_file *file) {
  if (file->fd >= 0 && close(file->fd) != 0 && !file->error) file->error = errno;
  return report_error(file);
}
