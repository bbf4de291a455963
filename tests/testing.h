/* testing - assertions and helpers that every test program includes */
#ifndef TESTING_H
#define TESTING_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "msim/msim.h"

/* Fail the test with the message of the library unless the call returns MSIM_OK. */
#define assert_ok(call)                                                                        \
  do {                                                                                         \
    msim_error err_ = {0, ""};                                                                 \
    msim_error *err = &err_;                                                                   \
    msim_status status_ = (call);                                                              \
    if (status_ != MSIM_OK) fail_msg("%s: status %d, \"%s\"", #call, (int)status_, err->text); \
  } while (0)

/* Fail unless |a - b| <= tol, and print both numbers. */
#define assert_close(a, b, tol)                                                              \
  do {                                                                                       \
    double a_ = (a), b_ = (b), tol_ = (tol);                                                 \
    if (!(a_ - b_ <= tol_ && b_ - a_ <= tol_))                                               \
      fail_msg("%s = %.17g, %s = %.17g, off by %.3g > %.3g", #a, a_, #b, b_, a_ - b_, tol_); \
  } while (0)

/* Exit status of a test program that cannot run without `what`: skipped (77), or failed (1) where
 * MSIM_COMPLETE is set, as by tools/check, which requires every dependency. */
static inline int missing_status(const char *what) {
  const int fails = getenv("MSIM_COMPLETE") != NULL;
  print_message("%s: %s is missing\n", fails ? "failed" : "skipped", what);
  return fails ? 1 : 77;
}

/* Skip the test if !there, or fail it where MSIM_COMPLETE is set. */
static inline void require(int there, const char *what) {
  if (there) return;
  if (missing_status(what) == 1) fail();
  skip();
}

/* 1 under AddressSanitizer, about ten times slower: tests then leave out their large sizes. */
#if defined(__SANITIZE_ADDRESS__)
enum { HAS_ADDRESS_SANITIZER = 1 };
#else
enum { HAS_ADDRESS_SANITIZER = 0 };
#endif

/* 1 where MSIM_LONG_TESTS is set, as by tools/check --slice failing_allocations: tests with the
 * label `long` then try every failure or random scene, otherwise some of them. */
static inline int is_long(void) { return getenv("MSIM_LONG_TESTS") != NULL; }

/* The next number in [0, 1), by the linear congruential generator of Numerical Recipes. */
static inline double uniform(unsigned *seed) {
  *seed = *seed * 1664525u + 1013904223u;
  return (*seed >> 8) / 16777216.0;
}

#endif
