#include "layout.h"

const hsize_t h5_width[] = {3, 1, 1, 4, 1, 1};

const column h5_columns[] = {
    {"/VTKHDF/Points", VECTOR, NOTHING, offsetof(entry, frame.x)},
    {"/VTKHDF/PointData/Velocity", VECTOR, NOTHING, offsetof(entry, frame.v)},
    {"/VTKHDF/Steps/Values", REAL, TIMES, offsetof(entry, frame.t)},
    {"/VTKHDF/FieldData/KineticEnergy", REAL, NOTHING, offsetof(entry, frame.kinetic)},
    {"/VTKHDF/FieldData/PotentialEnergy", REAL, NOTHING, offsetof(entry, frame.potential)},
    {"/msim/frames/time", REAL, NOTHING, offsetof(entry, frame.t)},
    {"/msim/frames/step", WHOLE, NOTHING, offsetof(entry, frame.step)},
    {"/msim/frames/hash", WHOLE, NOTHING, offsetof(entry, hash)},
    [COMMIT] = {"/VTKHDF/Steps/PartOffsets", WHOLE, ONE, offsetof(entry, part)},
    {"/VTKHDF/Steps/NumberOfParts", WHOLE, ONE, 0},
    {"/VTKHDF/Steps/PointOffsets", WHOLE, FIRST_ROW, 0},
    {"/VTKHDF/Steps/CellOffsets", QUAD, ZERO, 0},
    {"/VTKHDF/Steps/ConnectivityIdOffsets", QUAD, ZERO, 0},
    {"/VTKHDF/Steps/PointDataOffsets/Velocity", WHOLE, FIRST_ROW, 0},
    {"/VTKHDF/Steps/PointDataOffsets/Mass", WHOLE, ZERO, 0},
    {"/VTKHDF/Steps/CellDataOffsets/Stiffness", WHOLE, ZERO, 0},
    {"/VTKHDF/Steps/CellDataOffsets/RestLength", WHOLE, ZERO, 0},
    {"/VTKHDF/Steps/FieldDataOffsets/KineticEnergy", WHOLE, FRAME, 0},
    {"/VTKHDF/Steps/FieldDataOffsets/PotentialEnergy", WHOLE, FRAME, 0},
};

const char *const h5_slots[NSLOTS] = {"/msim/checkpoint/0", "/msim/checkpoint/1"};

size_t h5_slot_words(size_t bytes) { return SLOT_BYTES + bytes / 8 + (bytes % 8 > 0); }

int h5_rank(shape s) { return h5_width[s] > 1 ? 2 : 1; }

hsize_t h5_rows(shape s, int64_t n) { return s == VECTOR ? (hsize_t)n : 1; }

hid_t h5_memory_type(shape s) {
  if (s == INDEX) return H5T_NATIVE_INT32;
  return s <= REAL ? H5T_NATIVE_DOUBLE : s == BYTE ? H5T_NATIVE_UINT8 : H5T_NATIVE_INT64;
}

hid_t h5_file_type(shape s) {
  return s <= REAL ? H5T_IEEE_F64LE : s == BYTE ? H5T_STD_U8LE : H5T_STD_I64LE;
}
