/* recorder.h - the ABI of plugins that write trajectories.
 *
 * A recorder plugin is one file, msim_recorder_NAME.so, that exports msim_recorder_entry; linked
 * into a program, the symbol is msim_recorder_NAME, and msim_options.recorders takes the table it
 * returns. MSIM_RECORDER_ENTRY defines either. The rules of change are those of backend.h. Programs
 * record trajectories by msim_recorder_open (msim.h).
 *
 * The extension of a file selects its recorder. A plugin for files *.xyz has the name xyz and the
 * extension .xyz, so that it is found without opening any other:
 *
 *     cc -shared -fPIC -DMSIM_PLUGIN $(pkg-config --cflags msim) xyz.c -o msim_recorder_xyz.so
 *     MSIM_PLUGIN_PATH=$PWD msim_cli run scene.json --out motion.xyz
 *
 * Only the plugins of msim itself have other names: hdf5 writes *.vtkhdf.
 */
#ifndef MSIM_RECORDER_H
#define MSIM_RECORDER_H

#include "msim/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MSIM_RECORDER_ABI 1u

/* Description of a recording. Valid during open() and resume() only. */
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
  const double *times;        /* nframes: planned times, s, ascending */
  const char *scene;          /* the scene as JSON text, in the format of scene files */
  size_t scene_length;        /* bytes, without the terminating zero */
  const char *name;           /* file name for messages: the final one; NULL: path */
  size_t checkpoint_capacity; /* maximum size of a frame's checkpoint, bytes; 0: none */
  int32_t sync;               /* 1: what write() has accepted survives a power failure */
  /* Later additions: present if `size` includes them. */
  const uint8_t *pinned; /* n: 1 where pinned */
  const double *damping; /* nsprings, N s/m */
  int32_t nfaces;
  const int32_t *faces; /* 3 nfaces: triangles of particles */
  int32_t nplanes;
  const msim_plane *planes; /* nplanes, with unit normals */
  const char *title;        /* the name of the scene, UTF-8 */
  double gravity[3];        /* m/s^2 */
  int32_t ncolliders;
  const msim_collider *colliders; /* ncolliders, one every colliders->size bytes */
  /* NULL, or `scene` is NULL: calls put for each piece of the text, one behind the other, as long
   * as that returns MSIM_OK; returns the status of put, or why the text cannot be written */
  msim_status (*read_scene)(const struct msim_recording *what,
                            msim_status (*put)(void *user, const char *piece, size_t length),
                            void *user);
  const void *scene_source; /* of read_scene */
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
  const void *checkpoint; /* opaque data for resuming the run here; NULL: none */
  size_t checkpoint_length;
  /* Later additions: present if `size` includes them. */
  double elastic, gravitational; /* J: the parts of `potential` */
  /* nsprings + nfaces: (l - rest) / rest, 0 where rest = 0, and k (l - rest) in N of each spring of
   * length l, then of each face: the mean of the springs among its edges, 0 without any */
  const float *strain, *tension;
  /* 3n: the force in N that its support exerts on each pinned particle, see msim_sim_reactions, 0
   * on others; NULL: no particle was pinned when the recording began */
  const float *reaction;
  /* 6 ncolliders: of each collider the position of its center, or of the middle of its axis, m, and
   * the rotation vector about that point, after its rotation at rest; NULL: none moves */
  const double *poses;
} msim_frame;

/* The rows of a frame that one of several ranks writes: of particles, and of cells, springs and
 * then faces. In the frame x and v begin with the first of these particles, strain and tension
 * with the first of these cells. */
typedef struct msim_frame_part {
  size_t size;
  int64_t frame; /* number of the frame in the file, from 0 on */
  int32_t first, n;
  int64_t first_cell, ncells;
  /* The frame's checkpoint is a part of a whole one of checkpoint_length bytes, 0: none, from byte
   * checkpoint_first on, a multiple of 8. */
  size_t checkpoint_first, checkpoint_length;
} msim_frame_part;

/* Sums over words, modulo 2^64, that the recorder defines: of the rows of a frame, and of the bytes
 * of its checkpoint */
typedef struct msim_frame_hash {
  uint64_t rows, checkpoint;
} msim_frame_hash;

/* The point at which a file is resumed. Borrowed until the next call with the recorder. */
typedef struct msim_resumption {
  size_t size;
  int64_t frames;         /* number of frames kept; the next write() appends to them */
  int64_t step;           /* of the last frame kept */
  const void *checkpoint; /* of the last frame kept; NULL: there are no frames */
  size_t checkpoint_length;
} msim_resumption;

/* Also declared by msim.h. */
typedef struct msim_recorder_type msim_recorder_type;

struct msim_recorder_type {
  uint32_t abi;          /* MSIM_RECORDER_ABI */
  uint32_t size;         /* sizeof(msim_recorder_type) */
  const char *name;      /* [a-z0-9_-]+ */
  const char *extension; /* of the files it writes, with the dot: "." and the name */
  const char *library;   /* the library behind it, with its version */
  const char *license;   /* of that library, SPDX */

  msim_status (*open)(const msim_host *host, const msim_recording *what, void **self);
  msim_status (*write)(void *self, const msim_frame *frame);
  /* Free self in any case; report write errors that buffering has delayed. */
  msim_status (*close)(void *self);

  /* Later additions: present if `size` includes them. */

  /* Continue, in place, a file that open() created for the same particles, springs and times; the
   * planned times may be fewer than the file's. Frames are kept up to and including the last one
   * with an intact checkpoint. The file is not changed before the next write(). */
  msim_status (*resume)(const msim_host *host, const msim_recording *what, msim_resumption *from,
                        void **self);
  /* 1: open() created this file, so a new recording may replace it. */
  int32_t (*recognize)(const msim_host *host, const char *path);
  /* 1: nframes and times are not read, so that frames may be recorded whose number is not known, as
   * that of all steps under error control. */
  int32_t open_ended;

  /* Several ranks write one file: all four, or none. Rank 0 opens or resumes it; then the others
   * join(), for which `times`, `scene` and the arrays of particles, springs and faces are NULL.
   * After begin() on rank 0 all ranks write their parts of a frame; then commit() on rank 0 writes
   * all else. It has its part once more, and the sums, modulo 2^64, of the hashes that write_part()
   * has returned. The other ranks write nothing else. */
  msim_status (*join)(const msim_host *host, const msim_recording *what, void **self);
  msim_status (*begin)(void *self);
  msim_status (*write_part)(void *self, const msim_frame *frame, const msim_frame_part *part,
                            msim_frame_hash *hash);
  msim_status (*commit)(void *self, const msim_frame *frame, const msim_frame_part *part,
                        const msim_frame_hash *hash);
  /* 1: open() gets a long text of the scene by read_scene, where several ranks share the scene. */
  int32_t reads_scene;
};

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
