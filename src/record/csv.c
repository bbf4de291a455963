#define _POSIX_C_SOURCE 200809L /* newlocale, open */
#include "record/csv.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <locale.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/error.h"

/* A line has at most two integers of 20 characters and seven reals of 24. */
enum { LONGEST_LINE = 256, BUFFER = 1 << 18 };

static const char title[] = "step,t,particle,x,y,z,vx,vy,vz\n";

typedef struct recorder {
  const msim_host *host;
  locale_t c;
  int32_t n;
  int fd;
  int sync;
  int error;      /* errno of the first failure; nothing is written after it */
  int torn;       /* 1: the file ends inside an incomplete frame */
  off_t length;   /* of the file, bytes */
  off_t complete; /* bytes up to the end of the last complete frame */
  size_t used;    /* of the buffer */
  char buffer[BUFFER];
  char name[]; /* of the file, for messages */
} recorder;

static msim_status report_csv_error(const recorder *r) {
  if (!r->error) return MSIM_OK;
  r->host->fail(r->host, "%s: cannot write the file: %s%s", r->name, strerror(r->error),
                r->torn ? "; its last frame is incomplete" : "");
  return ms_error_io_status(r->error);
}

/* Uses write(), as stdio might still write the rest of a frame after an error. */
static void flush_buffer(recorder *r) {
  size_t done = 0;
  while (done < r->used && !r->error) {
    ssize_t count = write(r->fd, r->buffer + done, r->used - done);
    if (count >= 0) done += (size_t)count;
    else if (errno != EINTR) r->error = errno;
  }
  r->length += (off_t)done;
  r->used = 0;
}

/* After an error the file is truncated to its complete frames. */
static msim_status end_frame(recorder *r) {
  flush_buffer(r);
  if (!r->error && r->sync && fdatasync(r->fd) != 0) r->error = errno;
  if (!r->error) r->complete = r->length;
  if (r->length > r->complete && ftruncate(r->fd, r->complete) != 0) r->torn = 1;
  else r->length = r->complete;
  return report_csv_error(r);
}

static void put_particle(recorder *r, const msim_frame *frame, int32_t i) {
  const double *x = frame->x + 3 * (size_t)i, *v = frame->v + 3 * (size_t)i;
  if (r->used + LONGEST_LINE > BUFFER) flush_buffer(r);
  r->used += (size_t)snprintf(r->buffer + r->used, LONGEST_LINE,
                              "%" PRId64 ",%.17g,%" PRId32 ",%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n",
                              frame->step, frame->t, i, x[0], x[1], x[2], v[0], v[1], v[2]);
}

static msim_status write_csv_frame(void *self, const msim_frame *frame) {
  recorder *r = self;
  locale_t before = uselocale(r->c);
  for (int32_t i = 0; i < r->n && !r->error; i++) put_particle(r, frame, i);
  uselocale(before);
  return end_frame(r);
}

static msim_status close_csv(void *self) {
  recorder *r = self;
  if (r->fd >= 0 && close(r->fd) != 0 && !r->error) r->error = errno;
  if (r->c) freelocale(r->c);
  msim_status status = report_csv_error(r);
  r->host->free(r->host, r);
  return status;
}

static msim_status open_csv(const msim_host *host, const msim_recording *what, void **self) {
  const char *name = what->name ? what->name : what->path;
  const size_t bytes = strlen(name) + 1;
  recorder *r = host->alloc(host, sizeof *r + bytes);
  *self = NULL;
  if (!r) {
    host->fail(host, "%s: out of memory for the csv recorder", name);
    return MSIM_ERR_MEMORY;
  }
  memset(r, 0, offsetof(recorder, buffer));
  memcpy(r->name, name, bytes);
  r->host = host;
  r->n = what->n;
  r->sync = what->sync;
  r->c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  r->fd = r->c ? open(what->path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666) : -1;
  if (r->fd < 0) r->error = errno;
  r->used = (size_t)snprintf(r->buffer, LONGEST_LINE, "%s", title);
  if (end_frame(r) != MSIM_OK) return close_csv(r);
  *self = r;
  return MSIM_OK;
}

static int32_t recognize_csv(const msim_host *host, const char *path) {
  char first[sizeof title] = "";
  (void)host;
  int fd = open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return 0;
  ssize_t count = read(fd, first, sizeof title - 1);
  close(fd);
  return count > 0 && strcmp(first, title) == 0;
}

const msim_recorder_type *ms_csv_recorder_type(void) {
  static const msim_recorder_type type = {
      .abi = MSIM_RECORDER_ABI,
      .size = sizeof type,
      .name = "csv",
      .extension = ".csv",
      .library = "msim",
      .license = "MIT",
      .open = open_csv,
      .write = write_csv_frame,
      .close = close_csv,
      .recognize = recognize_csv,
      .open_ended = 1,
  };
  return &type;
}
