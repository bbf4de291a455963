#define _POSIX_C_SOURCE 200809L /* strcasecmp */
#include "cleaned.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "mark.h"
#include "stl.h"

/* The *length bytes from the present place to the end; NULL: there are none, or out of memory */
static char *read_rest(FILE *file, size_t *length) {
  const long start = ftell(file);
  if (fseek(file, 0, SEEK_END) || ftell(file) <= start) return NULL;
  *length = (size_t)(ftell(file) - start);
  char *text = malloc(*length);
  if (text && fseek(file, start, SEEK_SET) == 0) *length = fread(text, 1, *length, file);
  return text;
}

/* 1: the file, which is at the first byte to read, is to be cleaned. */
static int needs_cleaning(FILE *file, const char *extension, int *is_stl) {
  *is_stl = strcasecmp(extension, ".stl") == 0;
  if (*is_stl) return assimp_stl_is_text(file);
  const int is_text = strcasecmp(extension, ".obj") == 0 || strcasecmp(extension, ".ply") == 0;
  return is_text && assimp_skip_mark(file);
}

msim_status assimp_cleaned_read(const msim_host *host, const char *path, char **text,
                                size_t *length) {
  const char *extension = strrchr(path, '.');
  FILE *file = fopen(path, "rb");
  int is_stl = 0;
  *text = NULL, *length = 0;
  if (file && extension && needs_cleaning(file, extension, &is_stl)) {
    *text = read_rest(file, length);
    if (!*text) host->fail(host, *length ? "out of memory" : "it is empty");
    for (size_t i = 0; i < *length && is_stl; i++) (*text)[i] = (char)tolower((*text)[i] & 0xFF);
    fclose(file);
    return *text ? MSIM_OK : *length ? MSIM_ERR_MEMORY : MSIM_ERR_ARG;
  }
  if (file) fclose(file);
  return MSIM_OK;
}
