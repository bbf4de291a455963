/* failing_allocator_preload - a library to preload into a program: makes its allocation number
 * FAIL_AT fail, or with FAIL_LATER all from it on, and writes to the pipe FAIL_PIPE at exit
 * whether one failed */
#define _POSIX_C_SOURCE 200809L /* write */
#include <stdlib.h>
#include <unistd.h>

#include "failing_allocator.h"

__attribute__((constructor)) static void begin(void) {
  const char *at = getenv("FAIL_AT");
  failing_allocator_count(FAILING_BY_MALLOC);
  failing_allocator_arm(at ? atoll(at) : -1, getenv("FAIL_LATER") != NULL);
}

__attribute__((destructor)) static void end(void) {
  const char *tube = getenv("FAIL_PIPE");
  if (tube && failing_allocator_has_failed() && write(atoi(tube), "!", 1) != 1) _exit(99);
}
