/* recorder.h - the ABI of output plugins.
 *
 * A recorder plugin is one file, msim_recorder_NAME.so, that exports msim_recorder_entry; linked
 * into the host the symbol is msim_recorder_NAME. MSIM_RECORDER_ENTRY writes either. The rules of
 * change are those of backend.h. Programs that want to record use msim_recorder_open in msim.h.
 */
#ifndef MSIM_RECORDER_H
#define MSIM_RECORDER_H

#include "msim/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MSIM_RECORDER_ABI 1u

/* What is going to be recorded. Valid during open() and resume() only. */
typedef struct msim_recording {
  size_t size;
  const char *path; /* the file to create; the host renames it when open() has succeeded */
  int32_t n;        /* particles */
  int32_t nsprings;
  const int32_t *ij;          /* 2 nsprings */
  const double *mass;         /* n, kg */
  const double *k;            /* nsprings, N/m */
  const double *rest;         /* nsprings, m */
  int64_t nframes;            /* frames planned, >= 1 */
  const double *times;        /* nframes, s: their planned times, ascending */
  const char *scene;          /* the scene as JSON text (FORMAT: scene file) */
  size_t scene_length;        /* bytes, without the terminating zero */
  const char *name;           /* what messages call the file: its final name; NULL: path */
  size_t checkpoint_capacity; /* bytes, the most that comes with a frame; 0: nothing does */
  int32_t sync;               /* 1: what write() has accepted outlives a power cut */
} msim_recording;

/* One state. Valid during write() only. */
typedef struct msim_frame {
  size_t size;
  int64_t step;
  double t;               /* s */
  const double *x;        /* 3n, m: x0 y0 z0 x1 ... */
  const double *v;        /* 3n, m/s */
  double kinetic;         /* J */
  double potential;       /* J: elastic and gravitational */
  const void *checkpoint; /* what a run goes on from, opaque; NULL: nothing */
  size_t checkpoint_length;
} msim_frame;

/* Where a file goes on. Lent until the next call with the recorder. */
typedef struct msim_resumption {
  size_t size;
  int64_t frames;         /* that stay; the next write() is of the one after them */
  int64_t step;           /* of the last of them */
  const void *checkpoint; /* that came with it; NULL: there are no frames */
  size_t checkpoint_length;
} msim_resumption;

typedef struct msim_recorder_type {
  uint32_t abi;          /* MSIM_RECORDER_ABI */
  uint32_t size;         /* sizeof(msim_recorder_type) */
  const char *name;      /* [a-z0-9_-]+ */
  const char *extension; /* of the files it writes, with the dot */
  const char *library;   /* the library behind it, with its version */
  const char *license;   /* of that library, SPDX */

  msim_status (*open)(const msim_host *host, const msim_recording *what, void **self);
  msim_status (*write)(void *self, const msim_frame *frame);
  /* Frees self in any case; reports what buffering hid. */
  msim_status (*close)(void *self);

  /* What follows came later: `size` tells whether it is there. */

  /* Go on with a file that open() made for the same particles, springs and times, in its place; the
   * plan may end earlier than the file's. The frames that stay end with the last one whose
   * checkpoint is whole, as it is. The file changes with the next write() and not before. */
  msim_status (*resume)(const msim_host *host, const msim_recording *what, msim_resumption *from,
                        void **self);
  /* 1: open() made this file, so another one may replace it. */
  int32_t (*recognize)(const msim_host *host, const char *path);
} msim_recorder_type;

#define MSIM_RECORDER_SIZE_1 (offsetof(msim_recorder_type, close) + sizeof(void (*)(void *)))

typedef const msim_recorder_type *msim_recorder_entry_fn(void);

#ifdef MSIM_PLUGIN
#  define MSIM_RECORDER_ENTRY(name)                                                             \
    __attribute__((visibility("default"))) const msim_recorder_type *msim_recorder_entry(void); \
    const msim_recorder_type *msim_recorder_entry(void)
#else
#  define MSIM_RECORDER_ENTRY(name)                       \
    const msim_recorder_type *msim_recorder_##name(void); \
    const msim_recorder_type *msim_recorder_##name(void)
#endif

#ifdef __cplusplus
}
#endif
#endif
