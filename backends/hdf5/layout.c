#include "layout.h"

const hsize_t h5_width[] = {3, 1, 1, 4, 1, 1, 1, 3, 6};

const column h5_columns[] = {
    {"/VTKHDF/Points", VECTOR, NOTHING, 1, offsetof(entry, frame.x)},
    {"/VTKHDF/PointData/Velocity", VECTOR, NOTHING, 1, offsetof(entry, frame.v)},
    {"/VTKHDF/Steps/Values", REAL, TIMES, 1, offsetof(entry, frame.t)},
    {"/VTKHDF/FieldData/KineticEnergy", REAL, NOTHING, 1, offsetof(entry, frame.kinetic)},
    {"/VTKHDF/FieldData/PotentialEnergy", REAL, NOTHING, 1, offsetof(entry, frame.potential)},
    {"/msim/frames/time", REAL, NOTHING, 1, offsetof(entry, frame.t)},
    {"/msim/frames/step", WHOLE, NOTHING, 1, offsetof(entry, frame.step)},
    {"/msim/frames/hash", WHOLE, NOTHING, 1, offsetof(entry, hash)},
    {"/VTKHDF/FieldData/ElasticEnergy", REAL, NOTHING, 2, offsetof(entry, frame.elastic)},
    {"/VTKHDF/FieldData/GravitationalEnergy", REAL, NOTHING, 2,
     offsetof(entry, frame.gravitational)},
    {"/VTKHDF/CellData/Strain", SINGLE, NOTHING, 2, offsetof(entry, frame.strain)},
    {"/VTKHDF/CellData/Tension", SINGLE, NOTHING, 2, offsetof(entry, frame.tension)},
    [REACTION] = {"/VTKHDF/PointData/Reaction", FORCE, NOTHING, FORMAT_OF_PINS,
                  offsetof(entry, frame.reaction)},
    [COMMIT] = {"/VTKHDF/Steps/PartOffsets", WHOLE, ONE, 1, offsetof(entry, part)},
    {"/VTKHDF/Steps/NumberOfParts", WHOLE, ONE, 1, 0},
    {"/VTKHDF/Steps/PointOffsets", WHOLE, FIRST_ROW, 1, 0},
    {"/VTKHDF/Steps/CellOffsets", QUAD, ZERO, 1, 0},
    {"/VTKHDF/Steps/ConnectivityIdOffsets", QUAD, ZERO, 1, 0},
    {"/VTKHDF/Steps/PointDataOffsets/Velocity", WHOLE, FIRST_ROW, 1, 0},
    {"/VTKHDF/Steps/PointDataOffsets/Mass", WHOLE, ZERO, 1, 0},
    {"/VTKHDF/Steps/PointDataOffsets/Pinned", WHOLE, ZERO, 2, 0},
    {"/VTKHDF/Steps/PointDataOffsets/Reaction", WHOLE, FIRST_ROW, FORMAT_OF_PINS, 0},
    {"/VTKHDF/Steps/CellDataOffsets/Stiffness", WHOLE, ZERO, 1, 0},
    {"/VTKHDF/Steps/CellDataOffsets/RestLength", WHOLE, ZERO, 1, 0},
    {"/VTKHDF/Steps/CellDataOffsets/Damping", WHOLE, ZERO, 2, 0},
    {"/VTKHDF/Steps/CellDataOffsets/Strain", WHOLE, FIRST_CELL, 2, 0},
    {"/VTKHDF/Steps/CellDataOffsets/Tension", WHOLE, FIRST_CELL, 2, 0},
    {"/VTKHDF/Steps/FieldDataOffsets/KineticEnergy", WHOLE, FRAME, 1, 0},
    {"/VTKHDF/Steps/FieldDataOffsets/PotentialEnergy", WHOLE, FRAME, 1, 0},
    {"/VTKHDF/Steps/FieldDataOffsets/ElasticEnergy", WHOLE, FRAME, 2, 0},
    {"/VTKHDF/Steps/FieldDataOffsets/GravitationalEnergy", WHOLE, FRAME, 2, 0},
};

const char *const h5_slots[NSLOTS] = {"/msim/checkpoint/0", "/msim/checkpoint/1"};

size_t h5_slot_words(size_t bytes) { return SLOT_BYTES + bytes / 8 + (bytes % 8 > 0); }

int h5_rank(shape s) { return h5_width[s] > 1 ? 2 : 1; }

hsize_t h5_rows(shape s, int64_t n, int64_t ncells) {
  return s == VECTOR || s == FORCE ? (hsize_t)n : s == SINGLE ? (hsize_t)ncells : 1;
}

/* The types of a shape: in memory if is_memory, else in the file */
static hid_t type_of(shape s, int is_memory) {
  switch (s) {
    case VECTOR:
    case REAL:
    case PLANE:
      return is_memory ? H5T_NATIVE_DOUBLE : H5T_IEEE_F64LE;
    case SINGLE:
    case FORCE:
      return is_memory ? H5T_NATIVE_FLOAT : H5T_IEEE_F32LE;
    case BYTE:
      return is_memory ? H5T_NATIVE_UINT8 : H5T_STD_U8LE;
    case INDEX:
      return is_memory ? H5T_NATIVE_INT32 : H5T_STD_I64LE;
    default:
      return is_memory ? H5T_NATIVE_INT64 : H5T_STD_I64LE;
  }
}

hid_t h5_memory_type(shape s) { return type_of(s, 1); }

hid_t h5_file_type(shape s) { return type_of(s, 0); }
