/* importer.h - the ABI of plugins that read and write scene files in formats other than JSON.
 *
 * An importer plugin is one file, msim_importer_NAME.so, that exports msim_importer_entry; linked
 * into the host, the symbol is msim_importer_NAME. MSIM_IMPORTER_ENTRY defines either. The rules of
 * change are those of backend.h. Programs load and save scenes by msim_scene_load and
 * msim_scene_save (scene.h).
 *
 * The extension of a file selects its importer. A plugin for files *.net has the name net and the
 * extension .net, so that it is found without opening any other:
 *
 *     cc -shared -fPIC -DMSIM_PLUGIN $(pkg-config --cflags msim) net.c -o msim_importer_net.so
 *     MSIM_PLUGIN_PATH=$PWD msim_cli run scene.net
 *
 * Only the plugins of msim itself have other names: hdf5 reads *.h5, and assimp the meshes *.obj,
 * *.stl, *.ply, *.gltf and *.glb. Files *.json are always JSON.
 *
 * In every format a scene file is a tree. The path of a node is the sequence of its keys in the
 * JSON form, with '/' between them: "particles/x"; the i-th element of a list of objects has the
 * key i: "planes/0/normal". Only the host interprets and validates keys and values.
 *
 * A file to which `file` of an object of type mesh refers has two nodes instead: `vertices`, n x 3
 * real numbers, and `faces`, m x 3 whole numbers: the corners of triangles, counted from 0.
 */
#ifndef MSIM_IMPORTER_H
#define MSIM_IMPORTER_H

#include "msim/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MSIM_IMPORTER_ABI 1u

/* Kinds of nodes. */
enum {
  MSIM_NODE_GROUP = 0, /* contains other nodes, which all come after it */
  MSIM_NODE_TEXT = 1,  /* dims[0] bytes of UTF-8, rank 1 */
  MSIM_NODE_REAL = 2,  /* double */
  MSIM_NODE_WHOLE = 3  /* int64_t */
};

enum { MSIM_NODE_MOST_DIMS = 3 };

typedef struct msim_node {
  size_t size;
  const char *path;
  int32_t kind;
  int32_t rank; /* 0: one number; 1: a list; 2: a list of lists, ...; stored row by row */
  int64_t dims[MSIM_NODE_MOST_DIMS];
  const void *data; /* data to save; unused in add() */
  /* Later additions: they exist if `size` includes them. */
  int32_t in_parts; /* add(): 1 if msim_importer.read can read a part of the numbers */
} msim_node;

/* Receiver of the nodes that load() finds. */
typedef struct msim_tree {
  size_t size;
  /* Announce a node; *room is set to the memory for its values; NULL for a group, and for numbers
   * that the host will read in parts. If add() fails, load() must return the same status; the error
   * message is already set. */
  msim_status (*add)(const struct msim_tree *tree, const msim_node *node, void **room);
  void *data; /* private to the host */
} msim_tree;

typedef struct msim_importer {
  uint32_t abi;          /* MSIM_IMPORTER_ABI */
  uint32_t size;         /* sizeof(msim_importer) */
  const char *name;      /* [a-z0-9_-]+ */
  const char *extension; /* of its files, with the dot: "." and the name; several: ".obj .ply" */
  const char *library;   /* the library behind it, with its version */
  const char *license;   /* of that library, SPDX */

  /* Messages describe the defect without naming the file: the host prepends the file name. */
  msim_status (*load)(const msim_host *host, const char *path, const msim_tree *tree);
  /* Creates a new file, which the host renames after save() has succeeded. */
  msim_status (*save)(const msim_host *host, const char *path, int32_t n, const msim_node *nodes);

  /* Later additions: they exist if `size` includes them. */

  /* Read rows [first, first + n) of a node with rank >= 1 that load() has added with in_parts.
   * Called after load() has ended; the file may have changed since. */
  msim_status (*read)(const msim_host *host, const char *path, const msim_node *node, int64_t first,
                      int64_t n, void *room);
} msim_importer;

#define MSIM_IMPORTER_SIZE_1 (offsetof(msim_importer, save) + sizeof(void (*)(void)))

typedef const msim_importer *msim_importer_entry_fn(void);

#ifdef MSIM_PLUGIN
#  define MSIM_IMPORTER_ENTRY(name)                                                        \
    __attribute__((visibility("default"))) const msim_importer *msim_importer_entry(void); \
    const msim_importer *msim_importer_entry(void)
#else
#  define MSIM_IMPORTER_ENTRY(name)                  \
    const msim_importer *msim_importer_##name(void); \
    const msim_importer *msim_importer_##name(void)
#endif

#ifdef __cplusplus
}
#endif
#endif
