#define _POSIX_C_SOURCE 200809L /* strdup, stat */
#include "files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* A file that exists, or the folder of one that does not exist, with its name there */
typedef struct identity {
  int known;
  struct stat info;
  const char *name; /* "" where the file exists */
} identity;

static identity identify(const char *path) {
  identity id = {.name = ""};
  if (stat(path, &id.info) == 0) {
    id.known = 1;
    return id;
  }
  const char *slash = strrchr(path, '/');
  char *folder = strdup(slash ? path : "./");
  if (!folder) return id;
  if (slash) folder[slash - path + 1] = '\0';
  id.known = stat(folder, &id.info) == 0;
  id.name = slash ? slash + 1 : path;
  free(folder);
  return id;
}

int same_file(const char *a, const char *b) {
  if (!a || !b) return 0;
  identity ia = identify(a), ib = identify(b);
  return ia.known && ib.known && ia.info.st_dev == ib.info.st_dev &&
         ia.info.st_ino == ib.info.st_ino && strcmp(ia.name, ib.name) == 0;
}

const char *special_file_kind(const char *path) {
  struct stat info;
  if (!path || stat(path, &info) != 0 || S_ISREG(info.st_mode)) return NULL;
  return S_ISDIR(info.st_mode) ? "a folder" : "a device or a pipe";
}

int file_exists(const char *path) {
  struct stat info;
  return stat(path, &info) == 0;
}

int file_is_foreign(const char *path, const char *text) {
  struct stat info;
  if (stat(path, &info) != 0 || info.st_size == 0) return 0;
  FILE *stream = fopen(path, "r");
  while (stream && *text && fgetc(stream) == *text) text++;
  if (stream) fclose(stream);
  return *text != '\0';
}

int has_extension(const char *path, const char *extension) {
  const char *dot = strrchr(path, '.');
  return dot && strcmp(dot, extension) == 0;
}
