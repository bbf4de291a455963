/* api.h - declarations shared by the whole API: version, errors, memory allocation */
#ifndef MSIM_API_H
#define MSIM_API_H

#include "msim/status.h"

#define MSIM_VERSION_MAJOR 0
#define MSIM_VERSION_MINOR 1
#define MSIM_VERSION_PATCH 0

#if defined(__GNUC__)
#  define MSIM_API __attribute__((visibility("default")))
#else
#  define MSIM_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Reason of a failure: a sentence that names the offending input or element. Empty: success.
 *
 * Its 1024 bytes are fixed: it lies in the caller's memory and need not be initialized, so that it
 * has no member for its size. Sentences have at most 987 bytes, and the library sets the last 32
 * bytes of `text` to 0: they are reserved for further members, where 0 will mean "unknown". */
typedef struct msim_error {
  msim_status status;
  char text[1020];
} msim_error;

/* Text of a status; never NULL. */
MSIM_API const char *msim_status_text(msim_status status);

/* Version of the library that is loaded, "0.1.0". */
MSIM_API const char *msim_version(void);

/* Allocator of the memory of a scene, and of the sims and recorders made from it, without what the
 * libraries behind msim allocate by malloc: jansson, those of plugins, and libc. free() is not
 * called with NULL. If sims run in several threads, both functions must be callable from all of
 * them. It is copied. */
typedef struct msim_allocator {
  size_t size;
  void *(*alloc)(size_t bytes, void *user); /* NULL: out of memory */
  void (*free)(void *ptr, void *user);
  void *user;
} msim_allocator;

#ifdef __cplusplus
}
#endif
#endif
