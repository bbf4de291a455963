/* scarce_preload - a library to preload into a program: makes its allocation number SCARCE_AT fail,
 * or with SCARCE_LATER all from it on, and writes to the pipe SCARCE_PIPE at exit whether one
 * failed */
#define _POSIX_C_SOURCE 200809L /* write */
#include <stdlib.h>
#include <unistd.h>

#include "scarce.h"

__attribute__((constructor)) static void begin(void) {
  const char *at = getenv("SCARCE_AT");
  scarce_count(SCARCE_BY_MALLOC);
  scarce_arm(at ? atoll(at) : -1, getenv("SCARCE_LATER") != NULL);
}

__attribute__((destructor)) static void end(void) {
  const char *tube = getenv("SCARCE_PIPE");
  if (tube && scarce_failed() && write(atoi(tube), "!", 1) != 1) _exit(99);
}
