/* registry - the function tables of one kind of plugin, by name or by a file's extension: those of
 * the program, those linked in, and those in plugin files */
#ifndef MS_REGISTRY_H
#define MS_REGISTRY_H

#include <string.h>

#include "base/plugin.h"

/* A plugin that msim documents: it is listed, and files with its extension are its own. */
typedef struct ms_registry_plugin {
  const char *name, *extension; /* extension: with the dot, lower case; several with a space
                                   between; NULL: it is found by name only */
  const char *plugin;         /* its packages are libmsim0-PLUGIN (Debian), libmsim-PLUGIN (conda);
                                   NULL: it is built in, or part of msim */
  const char *debian, *conda; /* the packages from which it is built, a space between */
  const char *pip;            /* its package of PyPI; NULL: that of msim contains it */
  int has_no_table;           /* 1: part of msim, and not found here */
} ms_registry_plugin;

typedef struct ms_registry_member {
  const char *name;
  size_t offset;
} ms_registry_member;
#define MS_REGISTRY_MEMBER(table, member) \
  { #member, offsetof(table, member) }

/* What distinguishes one kind of plugin. Every table begins with `abi`, `size` and `name`. */
typedef struct ms_registry {
  const char *kind; /* "recorder": the plugin NAME is a file msim_recorder_NAME.so */
  const char *noun; /* its name in messages */
  uint32_t abi;
  size_t least_size;                  /* of the first version of the table */
  size_t library, license, extension; /* offsets of these members; 0: tables have none; extension
                                         as in ms_registry_plugin */
  const ms_registry_plugin *known;    /* ends with a NULL name */
  const ms_registry_member *required; /* pointers that must not be NULL; ends with a NULL name */
  const void *(*linked)(int32_t i);   /* the i-th table linked in, NULL past the end */
  const void *(*enter)(void *symbol); /* the table that a plugin's entry function returns */
  /* Refuse other defects of a table. Nullable. */
  msim_status (*check)(const void *table, const char *file, msim_error *err);
} ms_registry;

/* Define linked() and enter() for entry functions of a type; ...: those linked in, a comma behind
 * each. ISO C has no cast from void * to a function. */
#define MS_REGISTRY_ENTRIES(entry_fn, ...)                 \
  static const void *linked(int32_t i) {                   \
    static entry_fn *const entries[] = {__VA_ARGS__ NULL}; \
    return entries[i] ? entries[i]() : NULL;               \
  }                                                        \
  static const void *enter(void *symbol) {                 \
    entry_fn *entry;                                       \
    memcpy(&entry, &symbol, sizeof entry);                 \
    return entry();                                        \
  }

/* Where tables come from besides those linked in. */
typedef struct ms_registry_sources {
  const void *own; /* list of the program, of pointers to tables, NULL at its end; nullable */
  const char *plugin_path; /* of ms_plugin_open; nullable */
  const msim_allocator *alloc;
} ms_registry_sources;

/* The table of the program, linked in, or from a plugin, in this order. name: that of the table,
 * or if tables have extensions the path of a file: an extension .EXT that no table and no known
 * plugin has is that of the plugin EXT. MSIM_ERR_NAME: not found; MSIM_ERR_PLUGIN, MSIM_ERR_ABI:
 * not loadable, or an invalid table. */
msim_status ms_registry_find(const ms_registry *r, const char *name,
                             const ms_registry_sources *sources, const void **table,
                             msim_error *err);

/* 1: one of the known plugins has the extension of the path. */
int ms_registry_knows(const ms_registry *r, const char *path);

/* Describe the i-th known plugin, see msim_solver_info. */
int32_t ms_registry_info(const ms_registry *r, int32_t i, const char *plugin_path,
                         msim_plugin_entry *entry, msim_error *err);

#endif
