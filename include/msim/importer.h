/* importer.h - the ABI of plugins that read and write scenes in files other than JSON.
 *
 * An importer plugin is one file, msim_importer_NAME.so, that exports msim_importer_entry; linked
 * into the host the symbol is msim_importer_NAME. MSIM_IMPORTER_ENTRY writes either. The rules of
 * change are those of backend.h. Programs that want a scene use msim_scene_load in msim.h.
 *
 * A scene file is a tree, whatever its format: the keys of the JSON form, with '/' between them,
 * are a node's path, "particles/x"; the i-th of a list of objects has the key i, "planes/0/normal".
 * What the keys and values mean, and whether they may stand there, is the host's business alone.
 */
#ifndef MSIM_IMPORTER_H
#define MSIM_IMPORTER_H

#include "msim/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MSIM_IMPORTER_ABI 1u

/* What a node is. */
enum {
  MSIM_NODE_GROUP = 0, /* of other nodes, all of which come after it */
  MSIM_NODE_TEXT = 1,  /* dims[0] bytes of UTF-8, rank 1 */
  MSIM_NODE_REAL = 2,  /* double */
  MSIM_NODE_WHOLE = 3  /* int64_t */
};

enum { MSIM_NODE_MOST_DIMS = 2 };

typedef struct msim_node {
  size_t size;
  const char *path;
  int32_t kind;
  int32_t rank; /* 0: one number; 1: a list; 2: a list of lists, row by row */
  int64_t dims[MSIM_NODE_MOST_DIMS];
  const void *data; /* what is to be saved; unused in add() */
} msim_node;

/* Where load() puts what it finds. */
typedef struct msim_tree {
  size_t size;
  /* Announce a node; *room is where its values belong, NULL for a group. After an error load()
   * ends with the status that it got; the sentence is there already. */
  msim_status (*add)(const struct msim_tree *tree, const msim_node *node, void **room);
  void *data; /* the host's */
} msim_tree;

typedef struct msim_importer {
  uint32_t abi;          /* MSIM_IMPORTER_ABI */
  uint32_t size;         /* sizeof(msim_importer) */
  const char *name;      /* [a-z0-9_-]+ */
  const char *extension; /* of its files, with the dot */
  const char *library;   /* the library behind it, with its version */
  const char *license;   /* of that library, SPDX */

  /* Sentences name no file, only what is wrong in it: the host puts the file's name in front. */
  msim_status (*load)(const msim_host *host, const char *path, const msim_tree *tree);
  /* The file is new, and the host renames it when save() has succeeded. */
  msim_status (*save)(const msim_host *host, const char *path, int32_t n, const msim_node *nodes);
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
