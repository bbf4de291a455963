/* api.h - what all of the API rests on: version, errors, memory */
#ifndef MSIM_API_H
#define MSIM_API_H

#include "msim/status.h"

#define MSIM_VERSION_MAJOR 0
#define MSIM_VERSION_MINOR 1
#define MSIM_VERSION_PATCH 0

#if defined(_WIN32) && !defined(MSIM_STATIC)
#  ifdef MSIM_BUILDING
#    define MSIM_API __declspec(dllexport)
#  else
#    define MSIM_API __declspec(dllimport)
#  endif
#elif defined(__GNUC__)
#  define MSIM_API __attribute__((visibility("default")))
#else
#  define MSIM_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* What went wrong: a sentence that names the culprit. Empty after success. */
typedef struct msim_error {
  msim_status status;
  char text[1020];
} msim_error;

/* Fixed text for a status; never NULL. */
MSIM_API const char *msim_status_text(msim_status status);

/* The version of the library that runs, "0.1.0". */
MSIM_API const char *msim_version(void);

/* All memory of a scene, and of sims made from it, comes from here. free(NULL) must be allowed;
 * where sims run in several threads, both must be callable from all of them. */
typedef struct msim_allocator {
  void *(*alloc)(size_t bytes, void *user); /* NULL when there is none left */
  void (*free)(void *ptr, void *user);
  void *user;
} msim_allocator;

#ifdef __cplusplus
}
#endif
#endif
