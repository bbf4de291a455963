/* scene - the importer plugin `hdf5`, which reads and writes scene files in HDF5
 *
 * Groups and datasets have the keys of the JSON form: particles/x is n x 3, planes/0/normal is the
 * normal of the first plane. Numbers are integers and IEEE floats of at most 64 bits, texts are
 * scalars of fixed length; attributes are ignored.
 *
 * Files are not trusted. References to other places (links, external and virtual datasets),
 * features that run other code (filters, types of variable length) and sizes beyond the possible
 * content of the file are refused before data are read. Defects of libhdf5 itself on damaged files
 * cannot be avoided here. */
#include "../hdf5/library.h"

#include <unistd.h>

#include "msim/importer.h"

/*------------------------------------- reading --------------------------------------------------*/

/* The deepest path is "objects/0/k/shear". */
enum { MOST_DEPTH = 4, MOST_PATH = 256, MOST_TEXT = 4096 };

/* Rows of a dataset, for read() */
typedef struct row_part {
  const msim_node *node;
  hsize_t first, n;
  void *room;
} row_part;

typedef struct hdf5_reader {
  fault fault;
  const msim_host *host;
  const msim_tree *tree; /* of load(); else NULL */
  row_part part;         /* of read() */
  char path[MOST_PATH];  /* of the present node */
  int depth;
  int reported;   /* the error message is already set */
  double members; /* limit of further members: ends cycles, and multiple links to a group */
  double bytes;   /* bytes of memory allowed for further data: limits decompression */
} hdf5_reader;

static int is_reading(const hdf5_reader *r) { return r->fault.status == MSIM_OK; }

/* Set the error message; nothing more is read. */
static void refuse_hdf5(hdf5_reader *r, const char *what) {
  if (!is_reading(r)) return;
  r->host->fail(r->host, "%s %s", *r->path ? r->path : "it", what);
  r->reported = 1;
  fault_set(&r->fault, MSIM_ERR_ARG, what);
}

/* Shape and type of a dataset. */
typedef struct dataset_shape {
  H5S_class_t extent;
  int rank;
  hsize_t dims[MSIM_NODE_MOST_DIMS];
  hid_t type, creation; /* plan: property list of its creation */
} dataset_shape;

static double count_numbers(const dataset_shape *s) {
  double count = 1;
  for (int i = 0; i < s->rank; i++) count *= (double)s->dims[i];
  return count;
}

/* Integers and IEEE floats in standard formats; libhdf5 is not asked to convert any other. */
static int is_standard_number(hid_t type) {
  const hid_t plain[] = {H5T_STD_I8LE,   H5T_STD_I8BE,   H5T_STD_I16LE,  H5T_STD_I16BE,
                         H5T_STD_I32LE,  H5T_STD_I32BE,  H5T_STD_I64LE,  H5T_STD_I64BE,
                         H5T_STD_U8LE,   H5T_STD_U8BE,   H5T_STD_U16LE,  H5T_STD_U16BE,
                         H5T_STD_U32LE,  H5T_STD_U32BE,  H5T_STD_U64LE,  H5T_STD_U64BE,
                         H5T_IEEE_F32LE, H5T_IEEE_F32BE, H5T_IEEE_F64LE, H5T_IEEE_F64BE};
  for (size_t i = 0; i < sizeof plain / sizeof *plain; i++)
    if (H5Tequal(type, plain[i]) > 0) return 1;
  return 0;
}

static void check_type(hdf5_reader *r, const dataset_shape *s) {
  const H5T_class_t class = H5Tget_class(s->type);
  if (class == H5T_STRING && H5Tis_variable_str(s->type) != 0)
    refuse_hdf5(r, "is a string of variable length; it must have a fixed length (numpy.bytes_)");
  else if (class == H5T_STRING && (s->extent != H5S_SCALAR || H5Tget_size(s->type) > MOST_TEXT))
    refuse_hdf5(r,
                "is an array of strings, or longer than 4096 bytes; it must be one shorter string");
  else if (class != H5T_STRING && !is_standard_number(s->type))
    refuse_hdf5(
        r,
        "has an unsupported type; it must be integers, IEEE floats of 32 or 64 bits, or a string");
}

static void check_filters(hdf5_reader *r, hid_t plan) {
  const int n = H5Pget_nfilters(plan);
  for (int i = 0; i < n && is_reading(r); i++) {
    unsigned flags, config;
    size_t none = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(plan, (unsigned)i, &flags, &none, NULL, 0, NULL, &config);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE)
      refuse_hdf5(r, "uses an unsupported filter; use shuffle and deflate (gzip) only");
  }
}

/* Memory needed for reading: the converted numbers, or one chunk if that is larger. */
static double memory_needed(const dataset_shape *s, H5D_layout_t layout) {
  hsize_t chunk[H5S_MAX_RANK];
  double bytes = (double)H5Tget_size(s->type);
  if (layout == H5D_CHUNKED && H5Pget_chunk(s->creation, H5S_MAX_RANK, chunk) == s->rank)
    for (int i = 0; i < s->rank; i++) bytes *= (double)chunk[i];
  const double whole = count_numbers(s) * sizeof(double);
  return bytes > whole ? bytes : whole;
}

static void check_storage(hdf5_reader *r, hid_t dataset, const dataset_shape *s) {
  const H5D_layout_t layout = H5Pget_layout(s->creation);
  const int filters = H5Pget_nfilters(s->creation);
  if (layout != H5D_COMPACT && layout != H5D_CONTIGUOUS && layout != H5D_CHUNKED)
    refuse_hdf5(r, "is a virtual dataset; it must contain its data");
  else if (H5Pget_external_count(s->creation) != 0)
    refuse_hdf5(r, "has its data in another file; store them in this file");
  check_filters(r, s->creation);
  if (!is_reading(r)) return;
  const double stored = (double)H5Dget_storage_size(dataset);
  const double least = count_numbers(s) * (double)H5Tget_size(s->type);
  if (stored < (filters > 0 ? least / 2000 : least)) /* deflate compresses at most 1032:1 */
    refuse_hdf5(r, "has more data than the file contains: it is damaged");
  r->bytes -= memory_needed(s, layout);
  if (is_reading(r) && r->bytes < 0)
    refuse_hdf5(r,
                "needs more memory than the limit of 64 MiB plus 100 times the size of the file");
}

/* A part of a compressed dataset would take the time of a whole chunk, or of all. */
static int is_contiguous(const dataset_shape *s) {
  return s->rank > 0 && H5Tget_class(s->type) != H5T_STRING &&
         H5Pget_layout(s->creation) == H5D_CONTIGUOUS;
}

static hid_t memory_type(const msim_node *node) {
  return node->kind == MSIM_NODE_REAL ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT64;
}

static void read_data(hdf5_reader *r, hid_t dataset, const dataset_shape *s,
                      const msim_node *node) {
  void *room;
  const msim_status status = r->tree->add(r->tree, node, &room);
  if (status) {
    r->reported = 1;
    fault_set(&r->fault, status, "");
    return;
  }
  if (!room && node->in_parts) return;
  hid_t type = memory_type(node);
  if (node->kind == MSIM_NODE_TEXT) {
    type = check_id(&r->fault, H5Tcopy(H5T_C_S1));
    check_result(&r->fault,
                 H5Tset_size(type, (size_t)node->dims[0] + 1)); /* includes the final zero */
    check_result(&r->fault, H5Tset_cset(type, H5Tget_cset(s->type)));
  }
  if (is_reading(r) && count_numbers(s) > 0)
    check_result(&r->fault, H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, room));
  if (node->kind == MSIM_NODE_TEXT) close_object(&r->fault, H5Tclose, type);
}

static void read_shape(hdf5_reader *r, hid_t dataset, dataset_shape *s) {
  hid_t space = check_id(&r->fault, H5Dget_space(dataset));
  *s = (dataset_shape){.extent = H5Sget_simple_extent_type(space), .type = -1, .creation = -1};
  s->rank = H5Sget_simple_extent_ndims(space);
  if (s->extent != H5S_SCALAR && s->extent != H5S_SIMPLE)
    refuse_hdf5(r, "is empty; it must contain data");
  if (s->rank < 0 || s->rank > MSIM_NODE_MOST_DIMS)
    refuse_hdf5(r, "has more than three dimensions");
  if (is_reading(r)) {
    check_result(&r->fault, H5Sget_simple_extent_dims(space, s->dims, NULL));
    s->type = check_id(&r->fault, H5Dget_type(dataset));
    s->creation = check_id(&r->fault, H5Dget_create_plist(dataset));
  }
  close_object(&r->fault, H5Sclose, space);
}

static msim_node describe_node(const hdf5_reader *r, const dataset_shape *s) {
  const H5T_class_t class = H5Tget_class(s->type);
  msim_node node = {
      .size = sizeof node, .path = r->path, .rank = s->rank, .in_parts = is_contiguous(s)};
  for (int i = 0; i < s->rank; i++) node.dims[i] = (int64_t)s->dims[i];
  node.kind = class == H5T_FLOAT ? MSIM_NODE_REAL : MSIM_NODE_WHOLE;
  if (class == H5T_STRING) {
    node.kind = MSIM_NODE_TEXT;
    node.rank = 1;
    node.dims[0] = (int64_t)H5Tget_size(s->type);
  }
  return node;
}

#define CHANGED "has changed while the file was read"

/* The dataset may have changed since it was announced. */
static void read_rows(hdf5_reader *r, hid_t dataset, const dataset_shape *s) {
  const row_part *p = &r->part;
  const msim_node is = describe_node(r, s);
  if (!is.in_parts || memcmp(is.dims, p->node->dims, sizeof is.dims) != 0) {
    refuse_hdf5(r, CHANGED);
    return;
  }
  hsize_t begin[MSIM_NODE_MOST_DIMS] = {p->first}, count[MSIM_NODE_MOST_DIMS] = {p->n};
  for (int i = 1; i < s->rank; i++) count[i] = s->dims[i];
  hid_t rows = check_id(&r->fault, H5Dget_space(dataset)),
        memory = check_id(&r->fault, H5Screate_simple(s->rank, count, NULL));
  if (is_reading(r))
    check_result(&r->fault, H5Sselect_hyperslab(rows, H5S_SELECT_SET, begin, NULL, count, NULL));
  if (is_reading(r))
    check_result(&r->fault,
                 H5Dread(dataset, memory_type(p->node), memory, rows, H5P_DEFAULT, p->room));
  close_object(&r->fault, H5Sclose, memory);
  close_object(&r->fault, H5Sclose, rows);
}

static void read_dataset(hdf5_reader *r, hid_t dataset) {
  dataset_shape s;
  read_shape(r, dataset, &s);
  if (is_reading(r)) check_type(r, &s);
  if (is_reading(r)) check_storage(r, dataset, &s);
  if (is_reading(r) && r->tree) {
    const msim_node node = describe_node(r, &s);
    read_data(r, dataset, &s, &node);
  } else if (is_reading(r)) {
    read_rows(r, dataset, &s);
  }
  close_object(&r->fault, H5Pclose, s.creation);
  close_object(&r->fault, H5Tclose, s.type);
}

static herr_t read_hdf5_member(hid_t group, const char *name, const H5L_info_t *link, void *data);

/* Only the member of a group that leads to the part */
static void read_member_of_path(hdf5_reader *r, hid_t group) {
  const size_t length = strlen(r->path);
  const char *left = r->part.node->path;
  char key[MOST_PATH];
  H5L_info_t link;
  if (length >= strlen(left)) {
    refuse_hdf5(r, CHANGED);
    return;
  }
  left += length + (length > 0); /* '/' */
  snprintf(key, sizeof key, "%.*s", (int)strcspn(left, "/"), left);
  if (check_result(&r->fault, H5Lget_info(group, key, &link, H5P_DEFAULT)))
    (void)read_hdf5_member(group, key, &link, r);
}

static void read_members(hdf5_reader *r, hid_t group) {
  if (++r->depth > MOST_DEPTH) refuse_hdf5(r, "is nested too deeply");
  hsize_t at = 0;
  if (is_reading(r) && !r->tree) read_member_of_path(r, group);
  else if (is_reading(r))
    check_result(&r->fault,
                 H5Literate(group, H5_INDEX_NAME, H5_ITER_NATIVE, &at, read_hdf5_member, r));
  r->depth--;
}

static void read_group(hdf5_reader *r, hid_t group) {
  void *room;
  const msim_node node = {.size = sizeof node, .path = r->path, .kind = MSIM_NODE_GROUP};
  const msim_status status = r->tree ? r->tree->add(r->tree, &node, &room) : MSIM_OK;
  if (!status) read_members(r, group);
  else r->reported = 1, fault_set(&r->fault, status, "");
}

static void read_hdf5_object(hdf5_reader *r, hid_t group, const char *name) {
  hid_t object = check_id(&r->fault, H5Oopen(group, name, H5P_DEFAULT));
  const H5I_type_t type = object < 0 ? H5I_BADID : H5Iget_type(object);
  if (type == H5I_GROUP) read_group(r, object);
  else if (type == H5I_DATASET) read_dataset(r, object);
  else refuse_hdf5(r, "is neither a group nor a dataset");
  close_object(&r->fault, H5Oclose, object);
}

/* A negative result ends H5Literate. */
static herr_t read_hdf5_member(hid_t group, const char *name, const H5L_info_t *link, void *data) {
  hdf5_reader *r = data;
  const size_t length = strlen(r->path), room = sizeof r->path - length;
  if ((size_t)snprintf(r->path + length, room, "%s%s", length ? "/" : "", name) >= room)
    refuse_hdf5(r, "... is too long a path");
  else if (link->type != H5L_TYPE_HARD)
    refuse_hdf5(r, link->type == H5L_TYPE_SOFT
                       ? "is a soft link; replace it by the group or dataset"
                       : "is a link to another file; replace it by the group or dataset");
  else if (--r->members < 0)
    refuse_hdf5(r, "exceeds the number of members possible in a file of this size: it is damaged");
  else read_hdf5_object(r, group, name);
  if (is_reading(r)) r->path[length] = '\0';
  return is_reading(r) ? 0 : -1;
}

/*------------------------------------- reading a file -------------------------------------------*/

static void read_scene_file(hdf5_reader *r, const char *path) {
  hsize_t size = 0;
  if (!library_fits()) fault_set(&r->fault, MSIM_ERR_PLUGIN, OTHER_RELEASE);
  hid_t access = is_reading(r) ? check_id(&r->fault, H5Pcreate(H5P_FILE_ACCESS)) : -1;
  if (is_reading(r)) check_result(&r->fault, H5Pset_file_locking(access, 0, 1));
  if (is_reading(r)) check_result(&r->fault, H5Pset_fclose_degree(access, H5F_CLOSE_STRONG));
  hid_t file = is_reading(r) ? check_id(&r->fault, H5Fopen(path, H5F_ACC_RDONLY, access)) : -1;
  if (is_reading(r) && check_result(&r->fault, H5Fget_filesize(file, &size))) {
    r->members = 16 + (double)size / 64; /* no object header is smaller */
    r->bytes = 0x1p26 + 100 * (double)size;
    hid_t root = check_id(&r->fault, H5Gopen2(file, "/", H5P_DEFAULT));
    if (is_reading(r)) read_members(r, root);
    close_object(&r->fault, H5Gclose, root);
  }
  close_object(&r->fault, H5Fclose, file);
  close_object(&r->fault, H5Pclose, access);
}

static msim_status read_scene(hdf5_reader *r, const char *path) {
  WITH_LIBRARY(r->host, read_scene_file(r, path));
  if (r->fault.status != MSIM_OK && !r->reported)
    r->host->fail(r->host, "cannot read %s: %s", *r->path ? r->path : "it as HDF5",
                  r->fault.reason);
  return r->fault.status;
}

static msim_status load_hdf5_scene(const msim_host *host, const char *path, const msim_tree *tree) {
  return read_scene(&(hdf5_reader){.host = host, .tree = tree}, path);
}

static msim_status read_hdf5_rows(const msim_host *host, const char *path, const msim_node *node,
                                  int64_t first, int64_t n, void *room) {
  const row_part part = {node, (hsize_t)first, (hsize_t)n, room};
  return read_scene(&(hdf5_reader){.host = host, .part = part}, path);
}

/*------------------------------------- writing --------------------------------------------------*/

static hid_t create_type(fault *f, const msim_node *node) {
  hid_t type = check_id(f, H5Tcopy(node->kind == MSIM_NODE_TEXT    ? H5T_C_S1
                                   : node->kind == MSIM_NODE_WHOLE ? H5T_STD_I64LE
                                                                   : H5T_IEEE_F64LE));
  if (node->kind != MSIM_NODE_TEXT) return type;
  check_result(f, H5Tset_size(type, (size_t)node->dims[0]));
  check_result(f, H5Tset_strpad(type, H5T_STR_NULLPAD));
  check_result(f, H5Tset_cset(type, H5T_CSET_UTF8));
  return type;
}

static void write_node(fault *f, hid_t file, const msim_node *node) {
  hsize_t dims[MSIM_NODE_MOST_DIMS];
  for (int i = 0; i < MSIM_NODE_MOST_DIMS; i++) dims[i] = (hsize_t)node->dims[i];
  const int is_scalar = node->kind == MSIM_NODE_TEXT || node->rank == 0;
  if (f->status != MSIM_OK || node->kind == MSIM_NODE_GROUP) return;
  hid_t type = create_type(f, node);
  hid_t memory = node->kind == MSIM_NODE_TEXT    ? type
                 : node->kind == MSIM_NODE_WHOLE ? H5T_NATIVE_INT64
                                                 : H5T_NATIVE_DOUBLE;
  hid_t space =
      check_id(f, is_scalar ? H5Screate(H5S_SCALAR) : H5Screate_simple(node->rank, dims, NULL));
  hid_t link = check_id(f, H5Pcreate(H5P_LINK_CREATE)),
        create = check_id(f, H5Pcreate(H5P_DATASET_CREATE));
  check_result(f, H5Pset_create_intermediate_group(link, 1));
  check_result(f, H5Pset_obj_track_times(
                      create, 0)); /* without time stamps, equal scenes give equal files */
  hid_t set = H5I_INVALID_HID;
  if (f->status == MSIM_OK)
    set = check_id(f, H5Dcreate2(file, node->path, type, space, link, create, H5P_DEFAULT));
  if (set >= 0) check_result(f, H5Dwrite(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, node->data));
  close_object(f, H5Dclose, set);
  close_object(f, H5Pclose, create);
  close_object(f, H5Pclose, link);
  close_object(f, H5Sclose, space);
  close_object(f, H5Tclose, type);
}

/* Upper estimate of the size of the file: data, and per node a header and group tables. */
static double estimate_size(int32_t n, const msim_node *nodes) {
  double bytes = 4096.0 * (n + 1);
  for (int32_t i = 0; i < n; i++) {
    double count = 1;
    for (int32_t d = 0; d < nodes[i].rank; d++) count *= (double)nodes[i].dims[d];
    bytes += count * (nodes[i].kind == MSIM_NODE_TEXT ? 1 : 8);
  }
  return bytes;
}

static void write_scene_file(fault *f, const char *path, int32_t n, const msim_node *nodes) {
  if (!library_fits()) fault_set(f, MSIM_ERR_PLUGIN, OTHER_RELEASE);
  if (f->status != MSIM_OK) return;
  hid_t access = check_id(f, H5Pcreate(H5P_FILE_ACCESS));
  check_result(f, H5Pset_file_locking(access, 0, 1));
  check_result(f, H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V18));
  check_result(f, H5Pset_fclose_degree(access, H5F_CLOSE_STRONG));
  hid_t file = check_id(f, H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access));
  if (f->status == MSIM_OK) reserve_disk(f, file, estimate_size(n, nodes));
  for (int32_t i = 0; i < n; i++) write_node(f, file, &nodes[i]);
  hsize_t size = 0;
  if (f->status == MSIM_OK && check_result(f, H5Fflush(file, H5F_SCOPE_GLOBAL)))
    check_result(f, H5Fget_filesize(file, &size));
  close_object(f, H5Fclose, file);
  close_object(f, H5Pclose, access);
  /* release the reserved space that was not needed */
  if (f->status == MSIM_OK && truncate(path, (off_t)size))
    fault_set(f, MSIM_ERR_IO, strerror(errno));
}

static msim_status save_hdf5_scene(const msim_host *host, const char *path, int32_t n,
                                   const msim_node *nodes) {
  fault f = {MSIM_OK, ""};
  WITH_LIBRARY(host, write_scene_file(&f, path, n, nodes));
  if (f.status != MSIM_OK) host->fail(host, "cannot be written: %s", f.reason);
  return f.status;
}

MSIM_IMPORTER_ENTRY(hdf5) {
  static const msim_importer table = {
      MSIM_IMPORTER_ABI, sizeof table,    "hdf5",          ".h5",          H5_VERS_INFO,
      "BSD-3-Clause",    load_hdf5_scene, save_hdf5_scene, read_hdf5_rows,
  };
  return &table;
}
