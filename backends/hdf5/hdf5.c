/* hdf5 - the recorder plugin `hdf5`: trajectories that ParaView opens as they are
 *
 * The file is VTKHDF 2.0 (docs.vtk.org, "VTKHDF File Format"): a temporal PolyData of two parts,
 * 0 = the mesh, 1 = nothing. Particles are points, springs are lines. All planned frames exist from
 * the start and show part 1; a frame is committed by setting its Steps/PartOffsets to 0, eight
 * bytes, after its data has been flushed. No metadata of HDF5 changes after creation, so a file
 * whose writer was killed opens and holds every committed frame, and a viewer may read along.
 *
 * Next to /VTKHDF, per planned frame: /msim/frames/time, step, hash; once: /msim/scene (the scene
 * as JSON, bytes) and the attributes format, creator and static_hash of /msim. A hash of 64-bit
 * words w_1, w_2, ... (doubles by their bits) is, modulo 2^64,
 *
 *     sum over i of (z ^ (z >> 32)) * 0xbf58476d1ce4e5b9,  z = w_i ^ (i * 0x9e3779b97f4a7c15)
 *
 * A frame's words: v (3n), x (3n), time, step. The static words: number of particles and of
 * springs, Lines/Connectivity, Mass, Stiffness, RestLength, the scene's length, its bytes, one a
 * word. */
#define _POSIX_C_SOURCE 200809L /* posix_fallocate */
#include "msim/recorder.h"

#include <errno.h>
#include <fcntl.h>
#include <hdf5.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

/*------------------------------------- the layout -----------------------------------------------*/

/* Rows of a dataset. INDEX: int32 in memory, as wide as WHOLE in the file. */
typedef enum shape { VECTOR, REAL, WHOLE, QUAD, INDEX, BYTE } shape;
static const hsize_t width[] = {3, 1, 1, 4, 1, 1};

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
enum { COMMIT = 8, NWRITTEN };

static const column columns[] = {
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
enum { NCOLUMNS = sizeof columns / sizeof *columns };

typedef struct recorder {
  const msim_host *host;
  hid_t file, column[NWRITTEN];
  int64_t n, nframes, written;
  msim_status status; /* that of the first failure; nothing is written after it */
  char doing[96];     /* what failed */
  char reason[256];   /* and why */
  char name[];        /* of the file, for messages */
} recorder;

static int rank(shape s) { return width[s] > 1 ? 2 : 1; }
static hsize_t rows_per_frame(shape s, int64_t n) { return s == VECTOR ? (hsize_t)n : 1; }

static hid_t memory_type(shape s) {
  if (s == INDEX) return H5T_NATIVE_INT32;
  return s <= REAL ? H5T_NATIVE_DOUBLE : s == BYTE ? H5T_NATIVE_UINT8 : H5T_NATIVE_INT64;
}

/*------------------------------------- errors, hashes -------------------------------------------*/

/* Say what is going to be done, for the message should it fail; 0 where something has failed. */
static int doing(recorder *r, const char *verb, const char *object) {
  if (r->status == MSIM_OK) snprintf(r->doing, sizeof r->doing, "%s %s", verb, object);
  return r->status == MSIM_OK;
}

static void fail(recorder *r, msim_status status, const char *reason) {
  r->status = status;
  snprintf(r->reason, sizeof r->reason, "%s", reason);
}

/* The innermost record of libhdf5's error stack. That of a failed system call ends like
 * "errno = 28, error message = 'No space left on device', ...": the part in quotes will do. */
static herr_t explain(unsigned depth, const H5E_error2_t *record, void *data) {
  static const char mark[] = "error message = '";
  recorder *r = data;
  if (depth > 0 || !record->desc) return 0;
  const char *found = strstr(record->desc, mark);
  fail(r, found ? MSIM_ERR_IO : MSIM_ERR_BACKEND, found ? found + strlen(mark) : record->desc);
  if (found) r->reason[strcspn(r->reason, "'")] = '\0';
  return 0;
}

/* Every result of libhdf5 passes here. Reasons are taken at once: the next call clears them. */
static int ok(recorder *r, int64_t result) {
  if (result < 0 && r->status == MSIM_OK) {
    fail(r, MSIM_ERR_BACKEND, "libhdf5 does not say why");
    (void)H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, explain, r);
  }
  return result >= 0;
}

static hid_t id(recorder *r, hid_t result) { return ok(r, result) ? result : H5I_INVALID_HID; }

static void drop(recorder *r, herr_t (*close)(hid_t), hid_t object) {
  if (object >= 0) ok(r, close(object));
}

static msim_status report(const recorder *r) {
  if (r->status != MSIM_OK)
    r->host->fail(r->host, "%s: cannot %s: %s", r->name, r->doing, r->reason);
  return r->status;
}

typedef struct hash {
  uint64_t sum, count;
} hash;

static void hash_words(hash *h, size_t count, const void *words) {
  const char *bytes = words;
  for (size_t i = 0; i < count; i++) {
    uint64_t w;
    memcpy(&w, bytes + 8 * i, 8);
    uint64_t z = w ^ ++h->count * UINT64_C(0x9e3779b97f4a7c15);
    h->sum += (z ^ z >> 32) * UINT64_C(0xbf58476d1ce4e5b9);
  }
}

static uint64_t frame_hash(int64_t n, const msim_frame *frame) {
  hash h = {0, 0};
  hash_words(&h, 3 * (size_t)n, frame->v);
  hash_words(&h, 3 * (size_t)n, frame->x);
  hash_words(&h, 1, &frame->t);
  hash_words(&h, 1, &frame->step);
  return h.sum;
}

static uint64_t static_hash(const msim_recording *what) {
  const size_t n = (size_t)what->n, nsprings = (size_t)what->nsprings;
  const unsigned char *scene = (const unsigned char *)what->scene;
  hash h = {0, 0};
  hash_words(&h, 2, (int64_t[]){what->n, what->nsprings});
  for (size_t i = 0; i < 2 * nsprings; i++) hash_words(&h, 1, &(int64_t){what->ij[i]});
  hash_words(&h, n, what->mass);
  hash_words(&h, nsprings, what->k);
  hash_words(&h, nsprings, what->rest);
  hash_words(&h, 1, &(uint64_t){what->scene_length});
  for (size_t i = 0; i < what->scene_length; i++) hash_words(&h, 1, &(uint64_t){scene[i]});
  return h.sum;
}

/*------------------------------------- datasets -------------------------------------------------*/

static void put(recorder *r, hid_t to, shape s, hsize_t first, hsize_t rows, const void *data) {
  if (r->status != MSIM_OK || rows == 0) return;
  const hsize_t start[] = {first, 0}, count[] = {rows, width[s]};
  hid_t there = id(r, H5Dget_space(to));
  hid_t here = id(r, H5Screate_simple(rank(s), count, NULL));
  if (ok(r, H5Sselect_hyperslab(there, H5S_SELECT_SET, start, NULL, count, NULL)))
    ok(r, H5Dwrite(to, memory_type(s), here, there, H5P_DEFAULT, data));
  drop(r, H5Sclose, here);
  drop(r, H5Sclose, there);
}

/* Row i of `rows` becomes first + i stride, all along its width. */
static void fill(recorder *r, hid_t dataset, shape s, hsize_t rows, int64_t first, int64_t stride) {
  enum { BLOCK = 256, WIDEST = 4 };
  int64_t block[BLOCK * WIDEST];
  for (hsize_t i = 0; i < rows && r->status == MSIM_OK; i += BLOCK) {
    const hsize_t count = rows - i < BLOCK ? rows - i : BLOCK;
    for (hsize_t j = 0; j < count * width[s]; j++)
      block[j] = first + (int64_t)(i + j / width[s]) * stride;
    put(r, dataset, s, i, count, block);
  }
}

/* 256 rows; of vectors one frame, in equal pieces of at most 1 MiB. */
static hsize_t chunk_rows(shape s, int64_t n, hsize_t rows) {
  const hsize_t most = (1 << 20) / (3 * sizeof(double)), frame = rows_per_frame(s, n);
  const hsize_t pieces = frame / most + 1;
  const hsize_t chunk = s == VECTOR ? (frame + pieces - 1) / pieces : 256;
  return chunk < rows ? chunk : rows;
}

/* Contiguous where chunk = 0. All its space is taken at once and stays as it is. No times: equal
 * runs give equal bytes. */
static hid_t create_dataset(recorder *r, const char *path, shape s, hsize_t rows, hsize_t chunk) {
  if (!doing(r, "write", path)) return H5I_INVALID_HID;
  const hsize_t dims[] = {rows, width[s]}, chunk_dims[] = {chunk, width[s]};
  hid_t space = id(r, H5Screate_simple(rank(s), dims, NULL));
  hid_t link = id(r, H5Pcreate(H5P_LINK_CREATE));
  hid_t create = id(r, H5Pcreate(H5P_DATASET_CREATE));
  ok(r, H5Pset_create_intermediate_group(link, 1));
  ok(r, H5Pset_obj_track_times(create, 0));
  ok(r, H5Pset_alloc_time(create, H5D_ALLOC_TIME_EARLY));
  ok(r, H5Pset_fill_time(create, H5D_FILL_TIME_NEVER));
  if (chunk) ok(r, H5Pset_chunk(create, rank(s), chunk_dims));
  hid_t type = s <= REAL ? H5T_IEEE_F64LE : s == BYTE ? H5T_STD_U8LE : H5T_STD_I64LE;
  hid_t dataset = id(r, H5Dcreate2(r->file, path, type, space, link, create, H5P_DEFAULT));
  drop(r, H5Pclose, create);
  drop(r, H5Pclose, link);
  drop(r, H5Sclose, space);
  return dataset;
}

static void create_columns(recorder *r, const double *times) {
  for (int i = 0; i < NCOLUMNS; i++) {
    const column *c = &columns[i];
    const hsize_t rows = (hsize_t)r->nframes * rows_per_frame(c->shape, r->n);
    const int64_t stride = c->plan == FRAME ? 1 : c->plan == FIRST_ROW ? r->n : 0;
    hid_t dataset = create_dataset(r, c->path, c->shape, rows, chunk_rows(c->shape, r->n, rows));
    if (c->plan == TIMES) put(r, dataset, c->shape, 0, rows, times);
    else if (c->plan != NOTHING) fill(r, dataset, c->shape, rows, c->plan == ONE, stride);
    if (i < NWRITTEN) r->column[i] = dataset;
    else drop(r, H5Dclose, dataset);
  }
}

static void constant(recorder *r, const char *path, shape s, int64_t rows, const void *data) {
  hid_t dataset = create_dataset(r, path, s, (hsize_t)rows, 0);
  put(r, dataset, s, 0, (hsize_t)rows, data);
  drop(r, H5Dclose, dataset);
}

/* VTK wants all four kinds of cells, and one list of offsets a part. */
static void create_cells(recorder *r, const char *kind, int64_t cells, const int32_t *ij) {
  const char *name[] = {"Connectivity", "NumberOfCells", "NumberOfConnectivityIds", "Offsets"};
  char path[4][64];
  for (int i = 0; i < 4; i++) snprintf(path[i], sizeof path[i], "/VTKHDF/%s/%s", kind, name[i]);
  constant(r, path[0], INDEX, 2 * cells, ij);
  constant(r, path[1], WHOLE, 2, (int64_t[]){cells, 0});
  constant(r, path[2], WHOLE, 2, (int64_t[]){2 * cells, 0});
  hid_t offsets = create_dataset(r, path[3], WHOLE, (hsize_t)cells + 2, 0);
  fill(r, offsets, WHOLE, (hsize_t)cells + 1, 0, 2);
  put(r, offsets, WHOLE, (hsize_t)cells + 1, 1, &(int64_t){0});
  drop(r, H5Dclose, offsets);
}

static void create_constants(recorder *r, const msim_recording *what) {
  constant(r, "/VTKHDF/NumberOfPoints", WHOLE, 2, (int64_t[]){what->n, 0});
  create_cells(r, "Vertices", 0, NULL);
  create_cells(r, "Lines", what->nsprings, what->ij);
  create_cells(r, "Polygons", 0, NULL);
  create_cells(r, "Strips", 0, NULL);
  constant(r, "/VTKHDF/PointData/Mass", REAL, what->n, what->mass);
  constant(r, "/VTKHDF/CellData/Stiffness", REAL, what->nsprings, what->k);
  constant(r, "/VTKHDF/CellData/RestLength", REAL, what->nsprings, what->rest);
  constant(r, "/msim/scene", BYTE, (int64_t)what->scene_length, what->scene);
}

/* A scalar where count = 0. */
static void create_attribute(recorder *r, const char *group, const char *name, hid_t type,
                             hsize_t count, const void *data) {
  if (!doing(r, "write the attributes of", group)) return;
  hid_t space = id(r, count ? H5Screate_simple(1, &count, NULL) : H5Screate(H5S_SCALAR));
  hid_t attribute = id(r, H5Acreate_by_name(r->file, group, name, type, space, H5P_DEFAULT,
                                            H5P_DEFAULT, H5P_DEFAULT));
  if (attribute >= 0) ok(r, H5Awrite(attribute, type, data));
  drop(r, H5Aclose, attribute);
  drop(r, H5Sclose, space);
}

/* VTK before 9.5 reads texts only if they are ASCII of fixed length. */
static void create_text(recorder *r, const char *group, const char *name, const char *text) {
  hid_t type = id(r, H5Tcopy(H5T_C_S1));
  ok(r, H5Tset_size(type, strlen(text)));
  ok(r, H5Tset_strpad(type, H5T_STR_NULLPAD));
  create_attribute(r, group, name, type, 0, text);
  drop(r, H5Tclose, type);
}

static void create_attributes(recorder *r, const msim_recording *what) {
  create_attribute(r, "/VTKHDF", "Version", H5T_NATIVE_INT64, 2, (int64_t[]){2, 0});
  create_text(r, "/VTKHDF", "Type", "PolyData");
  create_attribute(r, "/VTKHDF/Steps", "NSteps", H5T_NATIVE_INT64, 0, &r->nframes);
  create_attribute(r, "/msim", "format", H5T_NATIVE_INT64, 0, &(int64_t){1});
  create_text(r, "/msim", "creator", "msim 0.1.0");
  create_attribute(r, "/msim", "static_hash", H5T_NATIVE_INT64, 0, &(uint64_t){static_hash(what)});
}

/*------------------------------------- the file -------------------------------------------------*/

/* libhdf5 aborts the process where it is not the release whose headers were compiled in. */
static int library_fits(void) {
  unsigned v[3] = {0, 0, 0};
  return H5get_libversion(&v[0], &v[1], &v[2]) >= 0 && v[0] == H5_VERS_MAJOR &&
         v[1] == H5_VERS_MINOR && v[2] == H5_VERS_RELEASE;
}

/* Superblock 0, which has no "open for writing" flag to be left behind. No locks: viewers may open
 * the file while it is written. No cache of chunks: a write that fails does so in the call that
 * made it, and leaves nothing behind that libhdf5 would have to write when it closes. */
static void create_file(recorder *r, const char *path) {
  hid_t access = id(r, H5Pcreate(H5P_FILE_ACCESS));
  ok(r, H5Pset_fapl_sec2(access));
  ok(r, H5Pset_file_locking(access, 0, 1));
  ok(r, H5Pset_cache(access, 0, 0, 0, 0.0));
  ok(r, H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V18));
  ok(r, H5Pset_fclose_degree(access, H5F_CLOSE_STRONG)); /* with all datasets */
  if (r->status == MSIM_OK) r->file = id(r, H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access));
  drop(r, H5Pclose, access);
}

static void flush(recorder *r) {
  if (doing(r, "write", "the file")) ok(r, H5Fflush(r->file, H5F_SCOPE_GLOBAL));
}

/* Take disk space now: "disk full" then comes before the run and not hours into it. Some file
 * systems cannot promise space; there a write may fail later. */
static void reserve(recorder *r, double bytes) {
  char size[48];
  snprintf(size, sizeof size, "%.3g MB of disk space", bytes / 1e6);
  void *fd = NULL;
  if (!doing(r, "reserve", size) || !ok(r, H5Fget_vfd_handle(r->file, H5P_DEFAULT, &fd))) return;
  int error = EINTR;
  while (error == EINTR) error = posix_fallocate(*(const int *)fd, 0, (off_t)bytes);
  if (error && error != EOPNOTSUPP && error != EINVAL) fail(r, MSIM_ERR_IO, strerror(error));
}

/* The bytes of all data; libhdf5 adds its own. */
static double payload(const msim_recording *what) {
  double frame = 0;
  for (const column *c = columns; c < columns + NCOLUMNS; c++)
    frame += 8.0 * (double)(width[c->shape] * rows_per_frame(c->shape, what->n));
  return (double)what->nframes * frame + 8.0 * what->n + 40.0 * what->nsprings;
}

/* Space is reserved twice: when the size is known, and before libhdf5 writes anything, because
 * what it caches of metadata and cannot write it would keep for ever. */
static void create(recorder *r, const msim_recording *what) {
  hsize_t size = 0;
  doing(r, "create", "the file");
  if (!library_fits()) fail(r, MSIM_ERR_PLUGIN, "built for another release of " H5_VERS_INFO);
  else if (what->nframes < 1 || payload(what) > 0x1p62)
    fail(r, MSIM_ERR_ARG, "too few or too many frames");
  else create_file(r, what->path);
  reserve(r, payload(what));
  create_columns(r, what->times);
  create_constants(r, what);
  create_attributes(r, what);
  flush(r);
  if (r->status == MSIM_OK && ok(r, H5Fget_filesize(r->file, &size))) reserve(r, (double)size);
}

static void put_column(recorder *r, int i, const entry *e) {
  const shape s = columns[i].shape;
  const hsize_t rows = rows_per_frame(s, r->n);
  const void *data = (const char *)e + columns[i].source;
  if (s == VECTOR) data = *(const double *const *)data;
  doing(r, "write", columns[i].path);
  put(r, r->column[i], s, (hsize_t)r->written * rows, rows, data);
}

static void put_entry(recorder *r, const entry *e) {
  for (int i = 0; i < COMMIT; i++) put_column(r, i, e);
  flush(r);
  put_column(r, COMMIT, e);
  flush(r);
}

/*------------------------------------- the recorder ---------------------------------------------*/

/* libhdf5 is one per process and, as often built, not safe for threads. While it is in our hands
 * it must not print. At exit it would try again and again to write what a full disk refused, and
 * crash; H5dont_atexit forbids that if it comes first, else it changes nothing. */
static pthread_mutex_t library = PTHREAD_MUTEX_INITIALIZER;

#define WITH_LIBRARY(work)          \
  do {                              \
    pthread_mutex_lock(&library);   \
    (void)H5dont_atexit();          \
    H5E_BEGIN_TRY { work; }         \
    H5E_END_TRY                     \
    pthread_mutex_unlock(&library); \
  } while (0)

/* Frames that were planned but not written stay, and show nothing: to cut them would change
 * metadata, and a file whose writer is killed while it does that may be damaged. */
static msim_status close_recorder(void *self) {
  recorder *r = self;
  doing(r, "close", "the file");
  WITH_LIBRARY(drop(r, H5Fclose, r->file));
  const msim_status status = report(r);
  r->host->free(r->host, r);
  return status;
}

static msim_status open_recorder(const msim_host *host, const msim_recording *what, void **self) {
  const char *name = what->name ? what->name : what->path;
  recorder *r = host->alloc(host, sizeof *r + strlen(name) + 1);
  *self = NULL;
  if (!r) {
    host->fail(host, "%s: no memory for a recorder", name);
    return MSIM_ERR_MEMORY;
  }
  *r = (recorder){host, .file = H5I_INVALID_HID, .n = what->n, .nframes = what->nframes};
  memcpy(r->name, name, strlen(name) + 1);
  WITH_LIBRARY(create(r, what));
  if (r->status != MSIM_OK) return close_recorder(r);
  *self = r;
  return MSIM_OK;
}

static msim_status write_frame(void *self, const msim_frame *frame) {
  recorder *r = self;
  if (r->written == r->nframes) {
    r->host->fail(r->host, "%s: all %lld planned frames are written", r->name,
                  (long long)r->nframes);
    return MSIM_ERR_ARG;
  }
  const entry e = {*frame, frame_hash(r->n, frame), 0};
  WITH_LIBRARY(put_entry(r, &e));
  if (r->status == MSIM_OK) r->written++;
  return report(r);
}

MSIM_RECORDER_ENTRY(hdf5) {
  static const msim_recorder_type type = {
      MSIM_RECORDER_ABI, sizeof type,   "hdf5",      ".vtkhdf",      H5_VERS_INFO,
      "BSD-3-Clause",    open_recorder, write_frame, close_recorder,
  };
  return &type;
}
