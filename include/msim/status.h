/* status.h - return codes of functions and plugins, and services of msim for plugins */
#ifndef MSIM_STATUS_H
#define MSIM_STATUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* 0: success. < 0: error. > 0: numerical event. What holds after each: msim.h */
typedef int32_t msim_status;

#define MSIM_STATUS_LIST(X)                                                           \
  X(MSIM_OK, 0, "success")                                                            \
  X(MSIM_NOT_SPD, 1, "the system matrix is not positive definite")                    \
  X(MSIM_NOT_CONVERGED, 2, "an iterative solver did not reach its tolerance")         \
  X(MSIM_NOT_FINITE, 3, "the state contains NaN or numbers that are too large")       \
  X(MSIM_STOPPED, 4, "stopped on request")                                            \
  X(MSIM_UNSTABLE, 5, "energy or extent exceed their bounds: the motion is unstable") \
  X(MSIM_FORCE_FAILED, 6, "the program's force function failed")                      \
  X(MSIM_ERR_ARG, -1, "invalid argument")                                             \
  X(MSIM_ERR_MEMORY, -2, "out of memory")                                             \
  X(MSIM_ERR_NAME, -3, "unknown integrator, solver, recorder or importer")            \
  X(MSIM_ERR_PLUGIN, -4, "the plugin cannot be loaded")                               \
  X(MSIM_ERR_ABI, -5, "the plugin was built for another version of msim")             \
  X(MSIM_ERR_BACKEND, -6, "the library behind a plugin failed")                       \
  X(MSIM_ERR_IO, -7, "a file could not be read or written")                           \
  X(MSIM_ERR_UNSUPPORTED, -8, "not supported by this version")                        \
  X(MSIM_ERR_SIZE, -9, "the member `size` of a struct was not set to its sizeof")

#define MSIM_STATUS_ENUM(name, value, text) name = value,
enum { MSIM_STATUS_LIST(MSIM_STATUS_ENUM) MSIM_STATUS_END_ = 99 };
#undef MSIM_STATUS_ENUM

/* Services of the host (msim) for a plugin. Memory comes from the allocator of the scene or sim. */
typedef struct msim_host {
  size_t size;                                                /* sizeof(msim_host) */
  void *(*alloc)(const struct msim_host *host, size_t bytes); /* NULL: out of memory */
  void (*free)(const struct msim_host *host, void *ptr);      /* accepts NULL */
  /* Set the message that the user reads when the plugin returns an error; printf-like. */
  void (*fail)(const struct msim_host *host, const char *format, ...);
  void *data; /* private to the host */
  /* Around calls of a library that is not thread-safe and that other plugins may use as well, as
   * libhdf5: one thread of the process at a time gets past lock(). Not recursive. */
  void (*lock)(const struct msim_host *host);
  void (*unlock)(const struct msim_host *host);
} msim_host;

#ifdef __cplusplus
}
#endif
#endif
