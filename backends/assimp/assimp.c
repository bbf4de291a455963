/* assimp - the importer plugin `assimp`, which reads meshes in OBJ, STL, PLY and glTF files
 *
 * All triangles and polygons of a file are one mesh, at the places to which the nodes of a glTF
 * scene move them; polygons are cut into triangles, points and lines are left out. Vertices are in
 * the order of the file in PLY and glTF, and in that in which faces use them first in OBJ and STL.
 * In OBJ those that no face uses follow, for the host to count.
 * Coordinates have the single precision of libassimp.
 *
 * Files may refer to others in their own folder, which are read: the buffers of glTF. libassimp has
 * one text for errors in all threads, hence the lock; damaged files may crash it. */
#define _POSIX_C_SOURCE 200809L /* newlocale, stat */
#include <errno.h>
#include <limits.h>
#include <locale.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/version.h>

#include "cleaned.h"
#include "msim/importer.h"
#include "obj.h"
#include "ply.h"
#include "stl.h"

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

/* Meshes are sorted: those without triangles consist of points or lines, which are left out. A
 * mirrored node has its faces turned, so that they are seen from the same side. */
static void add_mesh(const struct aiMesh *mesh, const double t[12], arrays *to) {
  const int second = determinant(t) < 0 ? 2 : 1;
  if (!(mesh->mPrimitiveTypes & aiPrimitiveType_TRIANGLE)) return;
  if (to->vertices) add_vertices(mesh, t, to);
  for (unsigned f = 0; f < mesh->mNumFaces; f++) {
    const struct aiFace *face = &mesh->mFaces[f];
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

/* The host does not look where vertices of no face are: nunused of them follow, at 0. */
static msim_status add_arrays(const msim_host *host, const char *path, const struct aiScene *scene,
                              const msim_tree *tree) {
  arrays to = {0};
  int64_t nunused;
  void *vertices, *faces;
  msim_status status = assimp_obj_count_unused(host, path, &nunused);
  if (!status) status = add_scene(host, scene, &to);
  if (!status && to.nfaces == 0) {
    host->fail(host, "it contains no faces");
    return MSIM_ERR_ARG;
  }
  const int64_t nvertices = to.nvertices + nunused;
  if (!status) status = announce(tree, "vertices", MSIM_NODE_REAL, nvertices, &vertices);
  if (!status) status = announce(tree, "faces", MSIM_NODE_WHOLE, to.nfaces, &faces);
  if (status) return status;
  to.vertices = vertices, to.faces = faces;
  status = add_scene(host, scene, &to);
  for (int64_t i = 3 * to.nvertices; i < 3 * nvertices; i++) to.vertices[i] = 0;
  return status;
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

/* libassimp takes what is there of an OBJ file that is truncated: of its last line, too, a vertex
 * or a face of fewer than three numbers without a line end. */
static msim_status check_last_line(const msim_host *host, const char *path) {
  char tail[256] = "", word[3][16];
  FILE *file = fopen(path, "rb");
  if (!file) return MSIM_OK;
  if (fseek(file, 1 - (long)sizeof tail, SEEK_END)) rewind(file);
  tail[fread(tail, 1, sizeof tail - 1, file)] = '\0';
  fclose(file);
  const char *line = strrchr(tail, '\n');
  line = line ? line + 1 : tail;
  line += strspn(line, " \t");
  const int is_element = strncmp(line, "v ", 2) == 0 || strncmp(line, "f ", 2) == 0;
  if (!is_element || sscanf(line + 2, "%15s %15s %15s", word[0], word[1], word[2]) == 3)
    return MSIM_OK;
  host->fail(host, "its last line is incomplete: the file is truncated");
  return MSIM_ERR_ARG;
}

/* libassimp takes truncated files as whole. */
static msim_status check_format(const msim_host *host, const char *path) {
  const char *extension = strrchr(path, '.');
  const msim_status status = assimp_ply_check(host, path);
  if (status || !extension) return status;
  if (strcasecmp(extension, ".stl") == 0) return assimp_stl_check(host, path);
  return strcasecmp(extension, ".obj") == 0 ? check_last_line(host, path) : MSIM_OK;
}

/* What the triangulation of libassimp takes for granted */
static msim_status check_faces(const msim_host *host, const struct aiScene *scene) {
  for (unsigned m = 0; m < scene->mNumMeshes; m++) {
    const struct aiMesh *mesh = scene->mMeshes[m];
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
  return MSIM_OK;
}

/* libassimp leaves out damaged faces of glTF with no more than a warning "...: ... dropped". */
enum { MOST_WARNING = 200 };
static void keep_warning_of_loss(const char *message, char *kept) {
  const char *text = strstr(message, ": ");
  if (text && !*kept && strstr(text, "dropped"))
    snprintf(kept, MOST_WARNING, "%.*s", (int)strcspn(text + 2, ".\n"), text + 2);
}

/* NULL: refused, with the reason in aiGetErrorString(), or in *status. */
static const struct aiScene *import_text(const msim_host *host, const char *path,
                                         msim_status *status) {
  char *text;
  size_t length;
  *status = assimp_cleaned_read(host, path, &text, &length);
  if (*status) return NULL;
  if (!text) return aiImportFile(path, 0);
  const struct aiScene *scene =
      length <= UINT_MAX ? aiImportFileFromMemory(text, (unsigned)length, 0, strrchr(path, '.') + 1)
                         : aiImportFile(path, 0);
  free(text);
  return scene;
}

/* NULL: refused, and *status is set. */
static const struct aiScene *import_whole(const msim_host *host, const char *path,
                                          msim_status *status) {
  char loss[MOST_WARNING] = "";
  const struct aiLogStream log = {keep_warning_of_loss, loss};
  aiAttachLogStream(&log);
  const struct aiScene *scene = import_text(host, path, status);
  aiDetachLogStream(&log);
  if (!scene && !*status) *status = fail_import(host);
  if (!scene || !*loss) return scene;
  aiReleaseImport(scene);
  host->fail(host, "it is damaged: %s", loss);
  *status = MSIM_ERR_ARG;
  return NULL;
}

/* NULL: refused, and *status is set. */
static const struct aiScene *import(const msim_host *host, const char *path, msim_status *status) {
  const struct aiScene *scene = import_whole(host, path, status);
  if (!scene) return NULL;
  *status = check_faces(host, scene);
  if (*status) {
    aiReleaseImport(scene);
    return NULL;
  }
  scene = aiApplyPostProcessing(scene, aiProcess_Triangulate | aiProcess_SortByPType);
  if (!scene) *status = fail_import(host);
  return scene;
}

static msim_status load_file(const msim_host *host, const char *path, const msim_tree *tree) {
  msim_status status = check_file(host, path);
  if (!status) status = check_format(host, path);
  if (status) return status;
  host->lock(host);
  const struct aiScene *scene = import(host, path, &status);
  host->unlock(host);
  if (!scene) return status;
  if (scene->mRootNode) status = add_arrays(host, path, scene, tree);
  else {
    host->fail(host, "it contains no nodes");
    status = MSIM_ERR_ARG;
  }
  aiReleaseImport(scene);
  return status;
}

/* Numbers have a decimal point, whatever the locale of the host. */
static msim_status load(const msim_host *host, const char *path, const msim_tree *tree) {
  const locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  if (!c) {
    host->fail(host, "out of memory");
    return MSIM_ERR_MEMORY;
  }
  const locale_t before = uselocale(c);
  const msim_status status = load_file(host, path, tree);
  uselocale(before);
  freelocale(c);
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
