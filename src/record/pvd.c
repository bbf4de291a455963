#define _POSIX_C_SOURCE 200809L /* open, opendir */
#include "record/pvd.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"
#include "record/vtp.h"

/* Bytes of a line, powers of two: of a usual one, and of the longest name that a file can have. */
enum { LEAST_LINE = 256, MOST_LINE = 2048 };

static const char title[] = "<?xml version=\"1.0\"?>\n<!-- trajectory of msim -->\n";
static const char head[] =
    "<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>";
static const char ending[] = "</Collection></VTKFile>";

typedef struct recorder {
  const msim_host *host;
  ms_vtp vtp;
  int fd; /* the list; -1: none */
  int sync;
  int error; /* errno of the first failure; nothing is written after it */
  int made_folder;
  size_t line; /* bytes of a line of the list */
  int64_t nframes, written;
  size_t folder_length;
  char *path; /* of a frame, or of another file in the folder; begins with the folder's */
  char *name; /* of the list */
} recorder;

static msim_status report_pvd_error(const recorder *r, const char *path) {
  if (!r->error) return MSIM_OK;
  r->host->fail(r->host, "%s: cannot write the file: %s", path, strerror(r->error));
  return ms_error_io_status(r->error);
}

static void check_call(recorder *r, int failed) {
  if (failed && !r->error) r->error = errno;
}

/*------------------------------------- the folder -----------------------------------------------*/

/* Set the path to that of a file in the folder, "": of the folder. Names have up to 255 bytes. */
static const char *set_path(recorder *r, const char *file) {
  char *end = r->path + r->folder_length;
  snprintf(end, 258, "%s%s", *file ? "/" : "", file);
  return r->path;
}

static const char *set_frame_path(recorder *r, int64_t i) {
  char file[32];
  snprintf(file, sizeof file, "%06" PRId64 ".vtp", i);
  return set_path(r, file);
}

static int is_frame_name(const char *file) {
  const size_t digits = strspn(file, "0123456789");
  return digits >= 6 && strcmp(file + digits, ".vtp") == 0;
}

static int begins_with(const char *path, const char *text) {
  char first[64] = "";
  const size_t length = strlen(text);
  int fd = open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return 0;
  const ssize_t count = read(fd, first, length);
  close(fd);
  return count == (ssize_t)length && memcmp(first, text, length) == 0;
}

enum { LOOK, REMOVE };

/* Look for files with the names of frames: remove those of msim. Returns 0 and leaves the path at
 * the first one that is not. */
static int visit_frames(recorder *r, int how) {
  DIR *folder = opendir(set_path(r, ""));
  const struct dirent *entry;
  int ours = 1;
  check_call(r, !folder);
  while (folder && ours && (entry = readdir(folder)) != NULL) {
    if (!is_frame_name(entry->d_name)) continue;
    ours = begins_with(set_path(r, entry->d_name), ms_vtp_beginning);
    if (ours && how == REMOVE) check_call(r, unlink(r->path) != 0);
  }
  if (folder) closedir(folder);
  return ours;
}

static msim_status open_folder(recorder *r) {
  r->made_folder = mkdir(set_path(r, ""), 0777) == 0;
  if (!r->made_folder && errno != EEXIST) check_call(r, 1);
  if (!r->made_folder && !r->error && !visit_frames(r, LOOK)) {
    r->host->fail(r->host, "%s exists and is not a frame of msim; use another name", r->path);
    return MSIM_ERR_IO;
  }
  return report_pvd_error(r, r->path);
}

/*------------------------------------- the list -------------------------------------------------*/

/* Write a line: that of frame i is number i + 1. */
static void put_line(recorder *r, int64_t number, const char *text) {
  char line[MOST_LINE];
  snprintf(line, sizeof line, "%-*s", (int)r->line - 1, text);
  line[r->line - 1] = '\n';
  errno = ENOSPC; /* as where only a part is written */
  if (!r->error)
    check_call(r, pwrite(r->fd, line, r->line, (off_t)number * (off_t)r->line) != (ssize_t)r->line);
}

/* The name of the folder as a value of an attribute, at most 6 times as long */
static void escape(char *to, const char *name) {
  for (; *name; name++) {
    const char *code = *name == '&'   ? "&amp;"
                       : *name == '<' ? "&lt;"
                       : *name == '"' ? "&quot;"
                                      : NULL;
    if (code) to = stpcpy(to, code);
    else *to++ = *name;
  }
  *to = '\0';
}

/* The line of the frame at the path */
static void format_entry(const recorder *r, double t, char entry[MOST_LINE]) {
  char file[6 * 256 + 1];
  const char *folder = r->path + r->folder_length;
  while (folder > r->path && folder[-1] != '/') folder--;
  escape(file, folder);
  snprintf(entry, MOST_LINE, "<DataSet timestep=\"%s\" part=\"0\" file=\"%s\"/>",
           ms_text_format_double(t).text, file);
}

static void create_list(recorder *r, const char *path) {
  char text[MOST_LINE];
  set_frame_path(r, INT64_MAX);
  format_entry(r, -1.2345678901234567e-300, text);
  for (r->line = LEAST_LINE; r->line <= strlen(text); r->line *= 2) continue;
  r->fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  check_call(r, r->fd < 0);
  snprintf(text, sizeof text, "%s%s", title, head);
  put_line(r, 0, text);
  for (int64_t i = 0; i < r->nframes; i++) put_line(r, i + 1, "");
  put_line(r, r->nframes + 1, ending);
  if (!r->error && r->sync) check_call(r, fdatasync(r->fd) != 0);
}

/*------------------------------------- the recorder ---------------------------------------------*/

/* Flush a file, or the names in a folder. */
static void sync_path(recorder *r, const char *path) {
  int fd = open(path, O_RDONLY | O_CLOEXEC);
  check_call(r, fd < 0 || (fsync(fd) != 0 && errno != EINVAL)); /* some folders cannot */
  if (fd >= 0) close(fd);
}

static msim_status write_file(recorder *r, const msim_frame *frame) {
  FILE *stream = fopen(r->path, "wbe");
  check_call(r, !stream || !ms_vtp_write(&r->vtp, frame, stream));
  if (stream) check_call(r, fclose(stream) != 0);
  if (r->error && stream) unlink(r->path);
  if (!r->error && r->sync) sync_path(r, r->path);
  return report_pvd_error(r, r->path);
}

static msim_status write_pvd_frame(void *self, const msim_frame *frame) {
  recorder *r = self;
  char entry[MOST_LINE];
  if (r->written == r->nframes) {
    r->host->fail(r->host, "%s: all %" PRId64 " planned frames have been written already", r->name,
                  r->nframes);
    return MSIM_ERR_ARG;
  }
  if (r->written == 0) visit_frames(r, REMOVE); /* those of the run that this one replaces */
  set_frame_path(r, r->written);
  format_entry(r, frame->t, entry);
  const msim_status status = r->error ? report_pvd_error(r, r->path) : write_file(r, frame);
  if (status) return status;
  if (r->sync) sync_path(r, set_path(r, ""));
  put_line(r, ++r->written, entry);
  if (!r->error && r->sync) check_call(r, fdatasync(r->fd) != 0);
  return report_pvd_error(r, r->name);
}

static msim_status close_pvd(void *self) {
  recorder *r = self;
  if (r->fd >= 0) check_call(r, close(r->fd) != 0);
  if (r->made_folder && r->written == 0) rmdir(set_path(r, ""));
  const msim_status status = report_pvd_error(r, r->name);
  ms_vtp_free(&r->vtp, r->host);
  r->host->free(r->host, r);
  return status;
}

static msim_status open_pvd(const msim_host *host, const msim_recording *what, void **self) {
  const char *name = what->name ? what->name : what->path, *dot = strrchr(name, '.');
  const size_t length = strlen(name), stem = dot ? (size_t)(dot - name) : length;
  recorder *r = host->alloc(host, sizeof *r + 2 * length + 300);
  *self = NULL;
  if (r) memset(r, 0, sizeof *r);
  if (!r || !ms_vtp_init(&r->vtp, host, what)) {
    if (r) host->free(host, r);
    host->fail(host, "%s: out of memory for the pvd recorder", name);
    return MSIM_ERR_MEMORY;
  }
  r->host = host;
  r->fd = -1;
  r->sync = what->sync;
  r->nframes = what->nframes;
  r->name = memcpy(r + 1, name, length + 1);
  r->path = r->name + length + 1;
  r->folder_length = (size_t)sprintf(r->path, "%.*s_frames", (int)stem, name);
  msim_status status = open_folder(r);
  if (!status) {
    create_list(r, what->path);
    status = report_pvd_error(r, r->name);
  }
  if (!status) {
    *self = r;
    return MSIM_OK;
  }
  r->error = 0; /* it has been reported */
  close_pvd(r);
  return status;
}

static int32_t recognize_pvd(const msim_host *host, const char *path) {
  (void)host;
  return begins_with(path, title);
}

const msim_recorder_type *ms_pvd_recorder_type(void) {
  static const msim_recorder_type type = {
      .abi = MSIM_RECORDER_ABI,
      .size = sizeof type,
      .name = "pvd",
      .extension = ".pvd",
      .library = "msim",
      .license = "MIT",
      .open = open_pvd,
      .write = write_pvd_frame,
      .close = close_pvd,
      .recognize = recognize_pvd,
  };
  return &type;
}
