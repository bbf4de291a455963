/* input_file - the temporary file with the input, for fuzz targets that need one (see fuzz.h) */
#define _POSIX_C_SOURCE 200809L /* mkdtemp */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "fuzz.h"

/* libhdf5 1.10 leaks memory on damaged files. */
__attribute__((visibility("default"))) const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libhdf5"; }

/* libhdf5 allocates as much memory as a damaged file states; malloc may refuse. */
__attribute__((visibility("default"))) const char *__asan_default_options(void);
const char *__asan_default_options(void) {
  return "allocator_may_return_null=1:max_allocation_size_mb=1024";
}

static char folder[] = "/tmp/fuzz_XXXXXX";
static char path[64];

static void clean_up(void) {
  remove(path);
  rmdir(folder);
}

const char *fuzz_path(const char *name) {
  if (!*path) {
    fuzz_check(mkdtemp(folder) != NULL, "a folder");
    atexit(clean_up);
  }
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return path;
}

void fuzz_write(const uint8_t *data, size_t size) {
  FILE *file = fopen(path, "wb");
  fuzz_check(file && fwrite(data, 1, size, file) == size && fclose(file) == 0, "the input's file");
}

uint8_t *fuzz_read(size_t *size) {
  FILE *file = fopen(path, "rb");
  fuzz_check(file && fseek(file, 0, SEEK_END) == 0, "the file");
  *size = (size_t)ftell(file);
  uint8_t *data = malloc(*size + 1);
  rewind(file);
  fuzz_check(data && fread(data, 1, *size, file) == *size && fclose(file) == 0, "the file");
  return data;
}
