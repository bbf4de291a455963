#define _POSIX_C_SOURCE 200809L /* newlocale, open */
#include "record/csv.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <locale.h>
#include <string.h>
#include <unistd.h>

#include "record/frame_file.h"

static const char title[] = "step,t,particle,x,y,z,vx,vy,vz\n";

typedef struct recorder {
  const msim_host *host;
  locale_t c;
  int32_t n;
  ms_frame_file file;
  char name[]; /* of the file, for messages */
} recorder;

static void put_particle(recorder *r, const msim_frame *frame, int32_t i) {
  const double *x = frame->x + 3 * (size_t)i, *v = frame->v + 3 * (size_t)i;
  ms_frame_file_print(&r->file,
                      "%" PRId64 ",%.17g,%" PRId32 ",%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n",
                      frame->step, frame->t, i, x[0], x[1], x[2], v[0], v[1], v[2]);
}

static msim_status write_csv_frame(void *self, const msim_frame *frame) {
  recorder *r = self;
  locale_t before = uselocale(r->c);
  for (int32_t i = 0; i < r->n && !r->file.error; i++) put_particle(r, frame, i);
  uselocale(before);
  return ms_frame_file_end_frame(&r->file);
}

static msim_status close_csv(void *self) {
  recorder *r = self;
  if (r->c) freelocale(r->c);
  msim_status status = ms_frame_file_close(&r->file);
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
  memcpy(r->name, name, bytes);
  r->host = host;
  r->n = what->n;
  r->c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  const int why = errno;
  ms_frame_file_open(&r->file, host, what, r->name);
  if (!r->c) r->file.error = why;
  ms_frame_file_print(&r->file, "%s", title);
  if (ms_frame_file_end_frame(&r->file) != MSIM_OK) return close_csv(r);
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
