/* layout - what stands where in a trajectory
 *
 * The file is VTKHDF 2.0 (docs.vtk.org, "VTKHDF File Format"): a temporal PolyData of two parts,
 * 0 = the mesh, 1 = nothing. Particles are points, springs are lines. All planned frames exist from
 * the start and show part 1; a frame is committed by setting its Steps/PartOffsets to 0, eight
 * bytes, after its data has been flushed. No metadata of HDF5 changes after creation, so a file
 * whose writer was killed opens and holds every committed frame, and a viewer may read along.
 *
 * What the run can go on from lies in two slots, /msim/checkpoint/0 and 1: words of 8 bytes, which
 * are hash, frame, step, number of bytes, the bytes. Frame i writes slot i mod 2 before its commit:
 * whatever is torn, the last committed frame has its slot still, or the one before it has.
 *
 * Next to /VTKHDF, per planned frame: /msim/frames/time, step, hash; once: /msim/scene (the scene
 * as JSON, bytes) and the attributes format, creator and static_hash of /msim. A hash of 64-bit
 * words w_1, w_2, ... (doubles by their bits) is, modulo 2^64,
 *
 *     sum over i of (z ^ (z >> 32)) * 0xbf58476d1ce4e5b9,  z = w_i ^ (i * 0x9e3779b97f4a7c15)
 *
 * A frame's words: v (3n), x (3n), time, step. A slot's: all after the hash, as far as it has
 * bytes. The static words: number of particles and of springs, Lines/Connectivity, Mass, Stiffness,
 * RestLength, the scene's length, its bytes, one a word. */
#ifndef HDF5_LAYOUT_H
#define HDF5_LAYOUT_H

#include <hdf5.h>

#include "msim/recorder.h"

/* Rows of a dataset. INDEX: int32 in memory, as wide as WHOLE in the file. */
typedef enum shape { VECTOR, REAL, WHOLE, QUAD, INDEX, BYTE } shape;
extern const hsize_t h5_width[];

/* What a column holds for frame i before anything is computed. */
typedef enum plan { NOTHING, TIMES, ZERO, ONE, FRAME /* i */, FIRST_ROW /* i n */ } plan;

/* What one frame writes. */
typedef struct entry {
  msim_frame frame;
  uint64_t hash;
  int64_t part;
} entry;

/* A dataset with a row a frame; n rows a frame where the shape is VECTOR. */
typedef struct column {
  const char *path;
  shape shape;
  plan plan;
  size_t source; /* within an entry; of the first NWRITTEN only */
} column;

/* COMMIT is written last, and only after all the others are in the file. */
enum { X, V, TIME_SHOWN, TIME = 5, STEP, HASH, COMMIT, NWRITTEN, NCOLUMNS = 19 };
extern const column h5_columns[NCOLUMNS];

/* What a slot begins with. */
enum { SLOT_HASH, SLOT_FRAME, SLOT_STEP, SLOT_LENGTH, SLOT_BYTES, NSLOTS = 2 };
extern const char *const h5_slots[NSLOTS];
size_t h5_slot_words(size_t bytes);

int h5_rank(shape s);
hsize_t h5_rows(shape s, int64_t n); /* of a frame */
hid_t h5_memory_type(shape s);
hid_t h5_file_type(shape s);

#endif
