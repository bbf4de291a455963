/* driver - runs a fuzz target on files and on all files of folders, for builds without libFuzzer */
#define _POSIX_C_SOURCE 200809L
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <time.h>

#include "fuzz.h"

enum { MOST_BYTES = 1 << 24 };

static double seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void run_file(const char *path) {
  FILE *file = fopen(path, "rb");
  uint8_t *room = malloc(MOST_BYTES);
  fuzz_check(file && room, path);
  const size_t size = fread(room, 1, MOST_BYTES, file);
  fclose(file);
  /* a block of the exact length, so that sanitizers detect reads past its end */
  uint8_t *data = realloc(room, size ? size : 1);
  fuzz_check(data != NULL, path);
  const double start = seconds();
  LLVMFuzzerTestOneInput(data, size);
  printf("%6.3f s  %s\n", seconds() - start, path);
  free(data);
}

static int is_visible(const struct dirent *entry) { return entry->d_name[0] != '.'; }

static void run(const char *path) {
  struct stat there;
  fuzz_check(stat(path, &there) == 0, path);
  if (!S_ISDIR(there.st_mode)) {
    run_file(path);
    return;
  }
  struct dirent **entries;
  const int n = scandir(path, &entries, is_visible, alphasort);
  for (int i = 0; i < n; i++) {
    char inner[4096];
    snprintf(inner, sizeof inner, "%s/%s", path, entries[i]->d_name);
    run(inner);
    free(entries[i]);
  }
  if (n >= 0) free(entries);
}

int main(int argc, char **argv) {
  for (int i = 1; i < argc; i++) run(argv[i]);
  return 0;
}
