#include "create.h"

#include <stdio.h>
#include <string.h>

#include "file.h"
#include "hash.h"

/*------------------------------------- datasets -------------------------------------------------*/

/* Set all entries of row i to first + i stride, for 0 <= i < rows. */
static void fill_rows(recorder *r, hid_t dataset, shape s, hsize_t rows, int64_t first,
                      int64_t stride) {
  enum { BLOCK = 256, WIDEST = 4 };
  int64_t block[BLOCK * WIDEST];
  for (hsize_t i = 0; i < rows && r->fault.status == MSIM_OK; i += BLOCK) {
    const hsize_t count = rows - i < BLOCK ? rows - i : BLOCK;
    for (hsize_t j = 0; j < count * h5_width[s]; j++)
      block[j] = first + (int64_t)(i + j / h5_width[s]) * stride;
    h5_put(r, dataset, s, i, count, block);
  }
}

static int has_floats(shape s) { return s == SINGLE || s == FORCE; }

static size_t value_bytes(shape s) { return has_floats(s) ? sizeof(float) : sizeof(double); }

/* Rows of a chunk: 256, and for particles and cells a frame divided into equal pieces of at most
 * 1 MiB. */
static hsize_t chunk_rows(const recorder *r, shape s, hsize_t rows) {
  const hsize_t most = (1 << 20) / (h5_width[s] * value_bytes(s)), frame = h5_frame_rows(r, s);
  const hsize_t pieces = frame / most + 1;
  const hsize_t chunk = s == VECTOR || has_floats(s) ? (frame + pieces - 1) / pieces : 256;
  return chunk < rows ? chunk : rows;
}

/* Contiguous if chunk = 0. Space is allocated at once and not initialized. Without time stamps, so
 * that equal runs give equal bytes. */
static hid_t create_dataset(recorder *r, const char *path, shape s, hsize_t rows, hsize_t chunk) {
  if (!h5_doing(r, "write", path)) return H5I_INVALID_HID;
  const hsize_t dims[] = {rows, h5_width[s]}, chunk_dims[] = {chunk, h5_width[s]};
  hid_t space = h5_id(r, H5Screate_simple(h5_rank(s), dims, NULL));
  hid_t link = h5_id(r, H5Pcreate(H5P_LINK_CREATE));
  hid_t create = h5_id(r, H5Pcreate(H5P_DATASET_CREATE));
  h5_ok(r, H5Pset_create_intermediate_group(link, 1));
  h5_ok(r, H5Pset_obj_track_times(create, 0));
  h5_ok(r, H5Pset_alloc_time(create, H5D_ALLOC_TIME_EARLY));
  h5_ok(r, H5Pset_fill_time(create, H5D_FILL_TIME_NEVER));
  if (chunk) h5_ok(r, H5Pset_chunk(create, h5_rank(s), chunk_dims));
  hid_t dataset =
      h5_id(r, H5Dcreate2(r->file, path, h5_file_type(s), space, link, create, H5P_DEFAULT));
  h5_drop(r, H5Pclose, create);
  h5_drop(r, H5Pclose, link);
  h5_drop(r, H5Sclose, space);
  return dataset;
}

static void create_columns(recorder *r, const double *times) {
  for (int i = 0; i < NCOLUMNS; i++) {
    const column *c = &h5_columns[i];
    if (!h5_has_column(r, c)) continue;
    const hsize_t rows = (hsize_t)r->nframes * h5_frame_rows(r, c->shape);
    const int64_t strides[] = {[FRAME] = 1, [FIRST_ROW] = r->n, [FIRST_CELL] = r->ncells};
    hid_t dataset = create_dataset(r, c->path, c->shape, rows, chunk_rows(r, c->shape, rows));
    if (c->plan == TIMES) h5_put(r, dataset, c->shape, 0, rows, times);
    else if (c->plan != NOTHING)
      fill_rows(r, dataset, c->shape, rows, c->plan == ONE, strides[c->plan]);
    if (i < NWRITTEN) r->column[i] = dataset;
    else h5_drop(r, H5Dclose, dataset);
  }
}

static void create_constant(recorder *r, const char *path, shape s, int64_t rows,
                            const void *data) {
  hid_t dataset = create_dataset(r, path, s, (hsize_t)rows, 0);
  if (data) h5_put(r, dataset, s, 0, (hsize_t)rows, data);
  h5_drop(r, H5Dclose, dataset);
}

/* Zeros follow the values of the springs. */
static void create_cell_data(recorder *r, const char *path, int32_t nsprings,
                             const double *values) {
  hid_t dataset = create_dataset(r, path, REAL, (hsize_t)r->ncells, 0);
  fill_rows(r, dataset, REAL, (hsize_t)r->ncells, 0, 0);
  if (values) h5_put(r, dataset, REAL, 0, (hsize_t)nsprings, values);
  h5_drop(r, H5Dclose, dataset);
}

/* VTK requires all four kinds of cells, with one list of offsets per part. corners: of a cell */
static void create_cells(recorder *r, const char *kind, int64_t cells, int64_t corners,
                         const int32_t *points) {
  const char *name[] = {"Connectivity", "NumberOfCells", "NumberOfConnectivityIds", "Offsets"};
  char path[4][64];
  for (int i = 0; i < 4; i++) snprintf(path[i], sizeof path[i], "/VTKHDF/%s/%s", kind, name[i]);
  create_constant(r, path[0], INDEX, corners * cells, points);
  create_constant(r, path[1], WHOLE, 2, (int64_t[]){cells, 0});
  create_constant(r, path[2], WHOLE, 2, (int64_t[]){corners * cells, 0});
  hid_t offsets = create_dataset(r, path[3], WHOLE, (hsize_t)cells + 2, 0);
  fill_rows(r, offsets, WHOLE, (hsize_t)cells + 1, 0, corners);
  h5_put(r, offsets, WHOLE, (hsize_t)cells + 1, 1, &(int64_t){0});
  h5_drop(r, H5Dclose, offsets);
}

/* Where the next piece of the text belongs, and its hash */
typedef struct scene_writer {
  recorder *r;
  hid_t dataset;
  hsize_t at;
  hash hash;
} scene_writer;

static msim_status put_piece(void *user, const char *piece, size_t length) {
  scene_writer *w = user;
  h5_put(w->r, w->dataset, BYTE, w->at, length, piece);
  for (size_t i = 0; i < length; i++)
    h5_hash_words(&w->hash, 1, &(uint64_t){(unsigned char)piece[i]});
  w->at += length;
  return w->r->fault.status;
}

static void create_scene(recorder *r, const msim_recording *what) {
  hid_t dataset = create_dataset(r, "/msim/scene", BYTE, (hsize_t)what->scene_length, 0);
  scene_writer w = {.r = r, .dataset = dataset, .hash = {0, h5_scene_words(what)}};
  if (what->scene) put_piece(&w, what->scene, what->scene_length);
  else if (what->read_scene && what->read_scene(what, put_piece, &w) && !r->fault.status)
    h5_fail(r, MSIM_ERR_MEMORY, "out of memory for the text of the scene");
  r->scene_hash = w.hash.sum;
  h5_drop(r, H5Dclose, dataset);
}

static void create_constants(recorder *r, const msim_recording *what) {
  create_constant(r, "/VTKHDF/NumberOfPoints", WHOLE, 2, (int64_t[]){what->n, 0});
  create_cells(r, "Vertices", 0, 1, NULL);
  create_cells(r, "Lines", what->nsprings, 2, what->ij);
  create_cells(r, "Polygons", what->nfaces, 3, what->faces);
  create_cells(r, "Strips", 0, 1, NULL);
  create_constant(r, "/VTKHDF/PointData/Mass", REAL, what->n, what->mass);
  create_constant(r, "/VTKHDF/PointData/Pinned", BYTE, what->n, what->pinned);
  create_cell_data(r, "/VTKHDF/CellData/Stiffness", what->nsprings, what->k);
  create_cell_data(r, "/VTKHDF/CellData/RestLength", what->nsprings, what->rest);
  create_cell_data(r, "/VTKHDF/CellData/Damping", what->nsprings, what->damping);
  create_scene(r, what);
  create_constant(r, "/msim/planes", PLANE, what->nplanes, what->planes);
  r->count = create_dataset(r, "/msim/frames/NCommitted", WHOLE, 1, 0);
  h5_put(r, r->count, WHOLE, 0, 1, &(int64_t){0});
}

/* A slot of zeros is invalid, because its hash is not 0. */
static void create_slots(recorder *r, size_t capacity) {
  if (capacity == 0) return;
  r->capacity = capacity;
  for (int i = 0; i < NSLOTS; i++) {
    r->slot[i] = create_dataset(r, h5_slots[i], WHOLE, h5_slot_words(capacity), 0);
    h5_put(r, r->slot[i], WHOLE, 0, SLOT_BYTES, (uint64_t[SLOT_BYTES]){0});
  }
}

/* A scalar if count = 0. */
static void create_attribute(recorder *r, const char *group, const char *name, hid_t type,
                             hsize_t count, const void *data) {
  if (!h5_doing(r, "write the attributes of", group)) return;
  hid_t space = h5_id(r, count ? H5Screate_simple(1, &count, NULL) : H5Screate(H5S_SCALAR));
  hid_t attribute = h5_id(r, H5Acreate_by_name(r->file, group, name, type, space, H5P_DEFAULT,
                                               H5P_DEFAULT, H5P_DEFAULT));
  if (attribute >= 0) h5_ok(r, H5Awrite(attribute, type, data));
  h5_drop(r, H5Aclose, attribute);
  h5_drop(r, H5Sclose, space);
}

/* VTK before 9.5 reads only texts that are ASCII of fixed length. */
static void create_text(recorder *r, const char *group, const char *name, const char *text) {
  hid_t type = h5_id(r, H5Tcopy(H5T_C_S1));
  h5_ok(r, H5Tset_size(type, strlen(text)));
  h5_ok(r, H5Tset_strpad(type, H5T_STR_NULLPAD));
  create_attribute(r, group, name, type, 0, text);
  h5_drop(r, H5Tclose, type);
}

static void create_attributes(recorder *r, const msim_recording *what) {
  create_attribute(r, "/VTKHDF", "Version", H5T_NATIVE_INT64, 2, (int64_t[]){2, 0});
  create_text(r, "/VTKHDF", "Type", "PolyData");
  create_attribute(r, "/VTKHDF/Steps", "NSteps", H5T_NATIVE_INT64, 0, &r->nframes);
  create_attribute(r, "/msim", "format", H5T_NATIVE_INT64, 0, &(int64_t){FORMAT});
  create_text(r, "/msim", "creator", "msim 0.1.0");
  create_attribute(r, "/msim", "static_hash", H5T_NATIVE_INT64, 0,
                   &(uint64_t){h5_static_hash(what, r->scene_hash)});
}

/*------------------------------------- the whole ------------------------------------------------*/

/* Bytes of all data, without the metadata of libhdf5. */
static double count_data_bytes(const recorder *r, const msim_recording *what) {
  double frame = 0;
  for (const column *c = h5_columns; c < h5_columns + NCOLUMNS; c++)
    if (h5_has_column(r, c))
      frame += (double)(value_bytes(c->shape) * h5_width[c->shape] * h5_frame_rows(r, c->shape));
  return (double)what->nframes * frame + 9.0 * what->n + 24.0 * (double)r->ncells +
         24.0 * what->nsprings + 32.0 * what->nfaces + 2.0 * (double)what->checkpoint_capacity;
}

/* Space is allocated twice: when the amount of data is known, and before libhdf5 writes its cached
 * metadata, which it would keep forever if writing failed. */
void h5_create(recorder *r, const msim_recording *what) {
  hsize_t size = 0;
  h5_doing(r, "create", "the file");
  if (what->nframes < 1 || count_data_bytes(r, what) > 0x1p62)
    h5_fail(r, MSIM_ERR_ARG,
            "there are %lld frames; there must be at least 1, and at most 2^62 bytes of data",
            (long long)what->nframes);
  h5_open_file(r, what->path, CREATE);
  h5_reserve(r, count_data_bytes(r, what));
  create_columns(r, what->times);
  create_constants(r, what);
  create_slots(r, what->checkpoint_capacity);
  create_attributes(r, what);
  h5_flush(r);
  if (r->fault.status == MSIM_OK && h5_ok(r, H5Fget_filesize(r->file, &size)))
    h5_reserve(r, (double)size);
}
