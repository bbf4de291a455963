/* assimp - the importer plugin `assimp`, which reads meshes in OBJ, STL, PLY and glTF files
 *
 * All triangles and polygons of a file are one mesh, at the places to which the nodes of a glTF
 * scene move them; polygons are cut into triangles, points and lines are left out. Vertices are in
 * the order of the file in PLY and glTF, and in that in which faces use them first in OBJ and STL.
 * Coordinates have the single precision of libassimp.
 *
 * Files may refer to others in their own folder, which are read: the buffers of glTF. libassimp has
 * one text for errors in all threads, hence the lock; damaged files may crash it. */
#define _POSIX_C_SOURCE 200809L /* stat */
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/version.h>

#include "msim/importer.h"

/*------------------------------------- nodes ----------------------------------------------------*/

/* Where the vertices and faces of all nodes go; NULL: they are only counted. */
typedef struct arrays {
  double *vertices;
  int64_t *faces;
  int64_t nvertices, nfaces;
} arrays;

/* The deepest node to follow */
enum { MOST_DEPTH = 256 };

/* c = a b, of affine transformations (the fourth row is 0 0 0 1) */
static void multiply(const double a[12], const struct aiMatrix4x4 *b, double c[12]) {
  const double rows[3][4] = {{(double)b->a1, (double)b->a2, (double)b->a3, (double)b->a4},
                             {(double)b->b1, (double)b->b2, (double)b->b3, (double)b->b4},
                             {(double)b->c1, (double)b->c2, (double)b->c3, (double)b->c4}};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 4; j++) {
      c[4 * i + j] = j == 3 ? a[4 * i + 3] : 0;
      for (int k = 0; k < 3; k++) c[4 * i + j] += a[4 * i + k] * rows[k][j];
    }
}

static double determinant(const double t[12]) {
  return t[0] * (t[5] * t[10] - t[6] * t[9]) - t[1] * (t[4] * t[10] - t[6] * t[8]) +
         t[2] * (t[4] * t[9] - t[5] * t[8]);
}

static void add_vertices(const struct aiMesh *mesh, const double t[12], arrays *to) {
  double *x = to->vertices + 3 * to->nvertices;
  for (unsigned v = 0; v < mesh->mNumVertices; v++)
    for (int i = 0; i < 3; i++)
      *x++ = t[4 * i] * (double)mesh->mVertices[v].x + t[4 * i + 1] * (double)mesh->mVertices[v].y +
             t[4 * i + 2] * (double)mesh->mVertices[v].z + t[4 * i + 3];
}

/* A mirrored node has its faces turned, so that they are seen from the same side. */
static void add_mesh(const struct aiMesh *mesh, const double t[12], arrays *to) {
  const int second = determinant(t) < 0 ? 2 : 1;
  if (to->vertices) add_vertices(mesh, t, to);
  for (unsigned f = 0; f < mesh->mNumFaces; f++) {
    const struct aiFace *face = &mesh->mFaces[f];
    if (face->mNumIndices != 3) continue; /* a point or a line */
    int64_t *corner = to->faces ? to->faces + 3 * to->nfaces : NULL;
    to->nfaces++;
    if (!corner) continue;
    corner[0] = to->nvertices + face->mIndices[0];
    corner[second] = to->nvertices + face->mIndices[1];
    corner[3 - second] = to->nvertices + face->mIndices[2];
  }
  to->nvertices += mesh->mNumVertices;
}

static msim_status add_node(const msim_host *host, const struct aiScene *scene,
                            const struct aiNode *node, const double parent[12], int depth,
                            arrays *to) {
  double t[12];
  msim_status status = MSIM_OK;
  if (depth > MOST_DEPTH) {
    host->fail(host, "its nodes are nested more than %d times", MOST_DEPTH);
    return MSIM_ERR_ARG;
  }
  multiply(parent, &node->mTransformation, t);
  for (unsigned m = 0; m < node->mNumMeshes; m++) add_mesh(scene->mMeshes[node->mMeshes[m]], t, to);
  for (unsigned c = 0; c < node->mNumChildren && !status; c++)
    status = add_node(host, scene, node->mChildren[c], t, depth + 1, to);
  return status;
}

static msim_status add_scene(const msim_host *host, const struct aiScene *scene, arrays *to) {
  static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  to->nvertices = to->nfaces = 0;
  return add_node(host, scene, scene->mRootNode, identity, 0, to);
}

/*------------------------------------- files ----------------------------------------------------*/

static msim_status announce(const msim_tree *tree, const char *path, int32_t kind, int64_t rows,
                            void **room) {
  const msim_node node = {
      .size = sizeof node, .path = path, .kind = kind, .rank = 2, .dims = {rows, 3}};
  return tree->add(tree, &node, room);
}

static msim_status add_arrays(const msim_host *host, const struct aiScene *scene,
                              const msim_tree *tree) {
  arrays to = {NULL};
  void *vertices, *faces;
  msim_status status = add_scene(host, scene, &to);
  if (!status && to.nfaces == 0) {
    host->fail(host, "it contains no faces");
    return MSIM_ERR_ARG;
  }
  if (!status) status = announce(tree, "vertices", MSIM_NODE_REAL, to.nvertices, &vertices);
  if (!status) status = announce(tree, "faces", MSIM_NODE_WHOLE, to.nfaces, &faces);
  if (status) return status;
  to.vertices = vertices, to.faces = faces;
  return add_scene(host, scene, &to);
}

/* libassimp would try to read a folder, or a device without end. */
static msim_status check_file(const msim_host *host, const char *path) {
  struct stat info;
  if (stat(path, &info) == 0 && S_ISREG(info.st_mode)) return MSIM_OK;
  const int number = errno;
  if (stat(path, &info) == 0) host->fail(host, "it is not a file");
  else host->fail(host, "cannot be read: %s", strerror(number));
  return MSIM_ERR_IO;
}

/* Fail with the reason of libassimp, in one line without a full stop. */
static msim_status fail_import(const msim_host *host) {
  char why[400];
  snprintf(why, sizeof why, "%s", aiGetErrorString());
  why[strcspn(why, "\r\n")] = '\0';
  for (size_t n = strlen(why); n > 0 && strchr(". ", why[n - 1]); n--) why[n - 1] = '\0';
  host->fail(host, "libassimp cannot read it: %s", *why ? why : "it gives no reason");
  return MSIM_ERR_ARG;
}

static int has_bytes(FILE *file, double n) {
  const long begin = ftell(file);
  return fseek(file, 0, SEEK_END) == 0 && (double)(ftell(file) - begin) >= n;
}

/* libassimp 5.2 reads a header of PLY forever if it does not understand a line, or if the end is
 * missing, and makes room for all elements that it states. 1: all lines are of its language, and
 * the rest of the file has a byte for each element; sets *nfaces to the stated number of faces. */
static int is_ply_header(FILE *file, unsigned *nfaces) {
  static const char *const words[] = {"ply", "format", "comment", "obj_info", "element"};
  static const char types[] =
      " char uchar short ushort int uint float double int8 uint8 int16 uint16 int32 uint32 float32 "
      "float64 ";
  char line[512], first[16], type[16], padded[24];
  double n, nelements = 0;
  while (fgets(line, sizeof line, file)) {
    int known = 0, nwords = sscanf(line, "%15s %15s %*s", first, type);
    if (nwords < 1 || !strchr(line, '\n')) return 0;
    if (strcmp(first, "end_header") == 0) return has_bytes(file, nelements);
    if (sscanf(line, " element %*s %lf", &n) == 1) nelements += n;
    if (sscanf(line, " element face %u", nfaces) == 1) continue;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) known |= !strcmp(first, words[i]);
    snprintf(padded, sizeof padded, " %s ", nwords > 1 ? type : "?");
    if (strcmp(first, "property") == 0)
      known = strcmp(padded, " list ") == 0 || strstr(types, padded) != NULL;
    if (!known) return 0;
  }
  return 0;
}

static msim_status check_ply(const msim_host *host, const char *path, unsigned *nfaces) {
  char start[4] = "";
  FILE *file = fopen(path, "rb");
  const int is_ply = file && fread(start, 1, 3, file) == 3 && strncmp(start, "ply", 3) == 0;
  if (is_ply) rewind(file);
  const int is_good = !is_ply || is_ply_header(file, nfaces);
  if (file) fclose(file);
  if (is_good) return MSIM_OK;
  host->fail(host, "its header of PLY is damaged, has no end, or states more than the file has");
  return MSIM_ERR_ARG;
}

/* What a file begins and ends with */
typedef struct ends {
  char head[84], tail[256]; /* up to the last character that is not blank */
  const char *line;         /* the last line in tail, without blanks around it */
  int has_end;              /* a line end follows */
  long size;
} ends;

static int read_ends(const char *path, ends *e) {
  const long most = sizeof e->tail - 1;
  FILE *file = fopen(path, "rb");
  *e = (ends){.line = e->tail};
  if (!file) return 0;
  const int is_there = fread(e->head, 1, sizeof e->head, file) > 0 &&
                       fseek(file, 0, SEEK_END) == 0 && (e->size = ftell(file)) > 0 &&
                       fseek(file, e->size > most ? e->size - most : 0, SEEK_SET) == 0;
  size_t n = is_there ? fread(e->tail, 1, (size_t)most, file) : 0;
  fclose(file);
  e->has_end = n > 0 && strchr("\r\n", e->tail[n - 1]) != NULL;
  while (n > 0 && strchr(" \t\r\n", e->tail[n - 1])) e->tail[--n] = '\0';
  const char *before = strrchr(e->tail, '\n');
  if (before) e->line = before + 1;
  e->line += strspn(e->line, " \t");
  return n > 0;
}

/* Binary files may begin like text; they have 50 bytes a face, whose number stands in byte 80. */
static int is_text_of_stl(const ends *e) {
  uint32_t nfaces;
  memcpy(&nfaces, e->head + 80, sizeof nfaces);
  return strncmp(e->head, "solid", 5) == 0 && e->size != 84 + 50 * (long)nfaces;
}

/* A vertex or a face of fewer than three numbers, behind which the file ends */
static int is_cut_line_of_obj(const ends *e) {
  char word[3][16];
  const int is_element = strncmp(e->line, "v ", 2) == 0 || strncmp(e->line, "f ", 2) == 0;
  return !e->has_end && is_element &&
         sscanf(e->line + 2, "%15s %15s %15s", word[0], word[1], word[2]) < 3;
}

/* libassimp returns what is there of truncated text files. */
static msim_status check_end(const msim_host *host, const char *path) {
  const char *extension = strrchr(path, '.');
  ends e;
  if (!extension || !read_ends(path, &e)) return MSIM_OK;
  if (is_text_of_stl(&e) && strncmp(e.line, "endsolid", 8) != 0) {
    host->fail(host, "it does not end with endsolid: the file is truncated");
    return MSIM_ERR_ARG;
  }
  if (strcasecmp(extension, ".obj") != 0 || !is_cut_line_of_obj(&e)) return MSIM_OK;
  host->fail(host, "its last line is incomplete: the file is truncated");
  return MSIM_ERR_ARG;
}

/* What the triangulation of libassimp takes for granted. Of a truncated PLY file it returns the
 * faces that are there; stated: the number in its header, 0: none. */
static msim_status check_faces(const msim_host *host, const struct aiScene *scene,
                               unsigned stated) {
  unsigned count = 0;
  for (unsigned m = 0; m < scene->mNumMeshes; m++) {
    const struct aiMesh *mesh = scene->mMeshes[m];
    count += mesh->mNumFaces;
    for (unsigned f = 0; f < mesh->mNumFaces; f++) {
      const struct aiFace *face = &mesh->mFaces[f];
      int is_good = mesh->mVertices && face->mNumIndices > 0 && face->mIndices;
      for (unsigned i = 0; is_good && i < face->mNumIndices; i++)
        is_good = face->mIndices[i] < mesh->mNumVertices;
      if (is_good) continue;
      host->fail(host, "face %u has no corners, or one that is no vertex: the file is damaged", f);
      return MSIM_ERR_ARG;
    }
  }
  if (count >= stated) return MSIM_OK;
  host->fail(host, "it has %u faces, and its header states %u: the file is truncated", count,
             stated);
  return MSIM_ERR_ARG;
}

/* NULL: refused, and *status is set. */
static const struct aiScene *import(const msim_host *host, const char *path, unsigned stated,
                                    msim_status *status) {
  const struct aiScene *scene = aiImportFile(path, 0);
  if (!scene) {
    *status = fail_import(host);
    return NULL;
  }
  *status = check_faces(host, scene, stated);
  if (*status) {
    aiReleaseImport(scene);
    return NULL;
  }
  scene = aiApplyPostProcessing(scene, aiProcess_Triangulate);
  if (!scene) *status = fail_import(host);
  return scene;
}

static msim_status load(const msim_host *host, const char *path, const msim_tree *tree) {
  unsigned nfaces = 0;
  msim_status status = check_file(host, path);
  if (!status) status = check_ply(host, path, &nfaces);
  if (!status) status = check_end(host, path);
  if (status) return status;
  host->lock(host);
  const struct aiScene *scene = import(host, path, nfaces, &status);
  host->unlock(host);
  if (!scene) return status;
  if (scene->mRootNode) status = add_arrays(host, scene, tree);
  else {
    host->fail(host, "it contains no nodes");
    status = MSIM_ERR_ARG;
  }
  aiReleaseImport(scene);
  return status;
}

static msim_status save(const msim_host *host, const char *path, int32_t n,
                        const msim_node *nodes) {
  (void)path, (void)n, (void)nodes;
  host->fail(host, "meshes have no masses and springs; save the scene as *.json or *.h5");
  return MSIM_ERR_UNSUPPORTED;
}

/* Its headers do not have the version. */
static char version[32];
static void set_version(void) {
  snprintf(version, sizeof version, "Assimp %u.%u.%u", aiGetVersionMajor(), aiGetVersionMinor(),
           aiGetVersionPatch());
}

MSIM_IMPORTER_ENTRY(assimp) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  static const msim_importer table = {.abi = MSIM_IMPORTER_ABI,
                                      .size = sizeof table,
                                      .name = "assimp",
                                      .extension = ".obj .stl .ply .gltf .glb",
                                      .library = version,
                                      .license = "BSD-3-Clause",
                                      .load = load,
                                      .save = save};
  pthread_once(&once, set_version);
  return &table;
}
