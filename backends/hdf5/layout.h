/* layout - the format of trajectory files; docs/trajectory.md describes it for readers
 *
 * The file is VTKHDF 2.0 (docs.vtk.org, "VTKHDF File Format"): a temporal PolyData of two parts,
 * part 0 is the mesh, part 1 is empty. Particles are points, springs are lines, faces are polygons.
 * All planned frames exist from the start and refer to part 1. A frame is committed by setting its
 * Steps/PartOffsets to 0, eight bytes, after its data have been flushed. HDF5 metadata do not
 * change after creation, so a file whose writer was killed can be opened and contains every
 * committed frame, and viewers may read it during the run.
 *
 * Cell data have a row per line, then one per polygon; those of Stiffness, RestLength and Damping
 * are 0 for polygons. Strain and Tension are in single precision: they follow from Points, and in
 * double precision they would be most of the file (of a cloth of 64 x 64 particles, a frame would
 * have 707 kB in place of 452; its positions and velocities have 197). So is Reaction, which files
 * have where particles were pinned when they were created.
 *
 * Several processes may write rows of Points, Velocity, Strain and Tension: as space is allocated
 * and metadata do not change, they need not communicate. One of them has created or resumed
 * the file, writes all else, and commits a frame when the others have written their rows.
 *
 * /msim/frames/NCommitted is the number of committed frames. It is written after each commit, and
 * lowered before frames are withdrawn: after a crash it may be too small, but is never too large.
 * Closing the file corrects it.
 *
 * Checkpoints are in two slots, /msim/checkpoint/0 and 1, of words of 8 bytes: hash, frame, step,
 * number of bytes, the bytes. Frame i writes slot i mod 2 before its commit: if a write is
 * interrupted, the slot of the last committed frame, or that of the one before it, is intact.
 *
 * Besides /VTKHDF there are, per planned frame: /msim/frames/time, step, hash; once: /msim/scene
 * (the scene as JSON, bytes), /msim/planes (rows of normal, offset, restitution, friction) and the
 * attributes format, creator and static_hash of /msim. The hash of 64-bit words w_1, w_2, ...
 * (doubles by their bits) is, modulo 2^64,
 *
 *     sum over i of (z ^ (z >> 32)) * 0xbf58476d1ce4e5b9,  z = w_i ^ (i * 0x9e3779b97f4a7c15)
 *
 * Words of a frame: v (3n), x (3n), time, step. Of a slot: all after the hash, up to the end of its
 * bytes. Of the constant data: number of particles and of springs, Lines/Connectivity, Mass,
 * Stiffness and RestLength of the springs, length of the scene, its bytes, one per word,
 * Polygons/Connectivity.
 *
 * Files of format 1 lack what has format 2 below, and polygons, those of format 2 what has format
 * 3; they are resumed as they are. */
#ifndef HDF5_LAYOUT_H
#define HDF5_LAYOUT_H

#include <hdf5.h>

#include "msim/recorder.h"

/* Of columns with FORMAT_OF_PINS a file has those only if particles were pinned. */
enum { FORMAT = 3, FORMAT_OF_PINS = 3 };

/* Shape of the rows of a dataset. INDEX: int32 in memory, 64 bits in the file like WHOLE. SINGLE:
 * float; FORCE: three of them. PLANE: an msim_plane. */
typedef enum shape { VECTOR, REAL, WHOLE, QUAD, INDEX, BYTE, SINGLE, FORCE, PLANE } shape;
extern const hsize_t h5_width[];

/* Initial value of a column for frame i. */
typedef enum plan {
  NOTHING,
  TIMES,
  ZERO,
  ONE,
  FRAME,      /* i */
  FIRST_ROW,  /* i n */
  FIRST_CELL, /* i ncells */
} plan;

/* Data of one frame. */
typedef struct entry {
  msim_frame frame;
  uint64_t hash;
  int64_t part;
} entry;

/* A dataset with one row per frame, n if the shape is VECTOR or FORCE, ncells if it is SINGLE. */
typedef struct column {
  const char *path;
  shape shape;
  plan plan;
  int format;    /* the first one that has it */
  size_t source; /* offset in an entry; for the first NWRITTEN columns only */
} column;

/* COMMIT is written last, after all others have been flushed. */
enum { X, V, TIME_SHOWN, TIME = 5, STEP, HASH, REACTION = 12, COMMIT, NWRITTEN, NCOLUMNS = 31 };
extern const column h5_columns[NCOLUMNS];

/* Words at the beginning of a slot. */
enum { SLOT_HASH, SLOT_FRAME, SLOT_STEP, SLOT_LENGTH, SLOT_BYTES, NSLOTS = 2 };
extern const char *const h5_slots[NSLOTS];
size_t h5_slot_words(size_t bytes);

int h5_rank(shape s);
hsize_t h5_rows(shape s, int64_t n, int64_t ncells); /* number of rows per frame */
hid_t h5_memory_type(shape s);
hid_t h5_file_type(shape s);

#endif
