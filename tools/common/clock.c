#define _POSIX_C_SOURCE 200809L /* clock_gettime, nanosleep */
#include "clock.h"

#include <time.h>

double clock_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void clock_sleep(double seconds) {
  const time_t whole = (time_t)seconds;
  const struct timespec left = {.tv_sec = whole,
                                .tv_nsec = (long)(1e9 * (seconds - (double)whole))};
  nanosleep(&left, NULL);
}
