/* xyz - a recorder of msim for XYZ files, which VMD, OVITO and Jmol show
 *
 * An example to start a recorder plugin from. It needs only the headers of msim: a plugin does not
 * link to libmsim. A frame is the number of particles, a line of comment, and a line for each
 * particle:
 *
 *     2
 *     msim step 0, t = 0 s
 *     P 0 0 2
 *     P 0.5 0 2 */
#define _POSIX_C_SOURCE 200809L /* fsync, newlocale */
#include <errno.h>
#include <locale.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <msim/recorder.h>

/* The state of one recording. Several may exist at a time, so there are no global variables. */
typedef struct xyz {
  const msim_host *host; /* provides memory and takes error messages */
  FILE *file;
  locale_t c;  /* numbers have a decimal point, whatever the locale of the program */
  int32_t n;   /* particles */
  int sync;    /* 1: each frame goes to the disk */
  char name[]; /* of the file, for messages */
} xyz;

/* An error is a status < 0 with a message for the user. */
static msim_status refuse(const xyz *self) {
  self->host->fail(self->host, "%s: cannot be written: %s", self->name, strerror(errno));
  return MSIM_ERR_IO;
}

/* Free the state in any case; a full disk may be reported only here. */
static msim_status close_file(void *data) {
  xyz *self = data;
  const msim_host *host = self->host;
  const msim_status status = self->file && fclose(self->file) != 0 ? refuse(self) : MSIM_OK;
  if (self->c) freelocale(self->c);
  host->free(host, self);
  return status;
}

/* Create the file what->path, which gets the name what->name when this has succeeded. */
static msim_status open_file(const msim_host *host, const msim_recording *what, void **result) {
  const char *name = what->name ? what->name : what->path;
  xyz *self = host->alloc(host, sizeof *self + strlen(name) + 1);
  *result = NULL;
  if (!self) return MSIM_ERR_MEMORY;
  *self = (xyz){.host = host, .n = what->n, .sync = what->sync};
  strcpy(self->name, name);
  self->c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  self->file = self->c ? fopen(what->path, "w") : NULL;
  if (!self->file) {
    const msim_status status = refuse(self);
    close_file(self);
    return status;
  }
  *result = self;
  return MSIM_OK;
}

/* 17 digits give the same bits when they are read again. */
static msim_status write_frame(void *data, const msim_frame *frame) {
  xyz *self = data;
  const locale_t before = uselocale(self->c);
  fprintf(self->file, "%d\nmsim step %lld, t = %.17g s\n", (int)self->n, (long long)frame->step,
          frame->t);
  for (const double *x = frame->x; x < frame->x + 3 * (size_t)self->n; x += 3)
    fprintf(self->file, "P %.17g %.17g %.17g\n", x[0], x[1], x[2]);
  uselocale(before);
  const int failed = fflush(self->file) != 0 || ferror(self->file);
  return failed || (self->sync && fsync(fileno(self->file)) != 0) ? refuse(self) : MSIM_OK;
}

/* 1: open_file() created this file, so that a new recording may replace it. */
static int32_t recognize_file(const msim_host *host, const char *path) {
  char line[32] = "";
  FILE *file = fopen(path, "r");
  (void)host;
  if (!file) return 0;
  const int has_two = fgets(line, sizeof line, file) && fgets(line, sizeof line, file);
  fclose(file);
  return has_two && strncmp(line, "msim step ", 10) == 0;
}

/* The only symbol that the plugin exports. `name` is the extension without its dot. Without
 * resume() a recording cannot be continued. */
MSIM_RECORDER_ENTRY(xyz) {
  static const msim_recorder_type table = {.abi = MSIM_RECORDER_ABI,
                                           .size = sizeof table,
                                           .name = "xyz",
                                           .extension = ".xyz",
                                           .library = "none",
                                           .license = "MIT",
                                           .open = open_file,
                                           .write = write_frame,
                                           .close = close_file,
                                           .recognize = recognize_file,
                                           .open_ended = 1};
  return &table;
}
