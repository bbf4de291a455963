#include "output.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "message.h"

int output_open(output_file *file, const char *path) {
  *file = (output_file){.path = path};
  size_t size = strlen(path) + sizeof ".part";
  file->part = malloc(size);
  if (!file->part) return report_error("out of memory for a file name");
  snprintf(file->part, size, "%s.part", path);
  file->stream = fopen(file->part, "w");
  if (file->stream) return EXIT_OK;
  report_error("cannot write '%s': %s", path, strerror(errno));
  output_discard(file);
  return EXIT_ERROR;
}

int output_close(output_file *file, int written) {
  written = fclose(file->stream) == 0 && written;
  file->stream = NULL;
  if (written && rename(file->part, file->path) == 0) return EXIT_OK;
  report_error("cannot write '%s': %s", file->path, errno ? strerror(errno) : "out of memory");
  remove(file->part);
  return EXIT_ERROR;
}

void output_discard(output_file *file) {
  if (file->stream) {
    fclose(file->stream);
    remove(file->part);
  }
  free(file->part);
  *file = (output_file){.path = NULL};
}
