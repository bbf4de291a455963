/* import_nodes - the nodes that an importer finds in a file */
#ifndef MS_IMPORT_NODES_H
#define MS_IMPORT_NODES_H

#include "scene/import.h"
#include "scene/json_reader.h"

/* A tree of objects, in which an integer is the index of a column. reader.label, .alloc and .err
 * are set before the load. */
typedef struct ms_import_nodes {
  ms_json_reader reader;
  json_t *root;
  ms_column *columns;
  int32_t n, capacity;
  msim_status status; /* of the first node that was refused */
  int in_parts;       /* 1: large arrays may be read in parts, after ms_import_nodes_load */
  msim_error
      failure; /* of the first part that could not be read, after which numbers are undefined */
  const msim_importer *table;
  const char *path;
} ms_import_nodes;

/* Read a file; with in_parts its large arrays later, when values are asked for. The caller deletes
 * the nodes, also after an error. */
msim_status ms_import_nodes_load(ms_import_nodes *in, const msim_importer *table, const char *path);
void ms_import_nodes_free(ms_import_nodes *in);

/* Set in->status if the text is not valid UTF-8. */
void ms_import_nodes_check_utf8(ms_import_nodes *in, const char *path, const char *text);

/* Set in->status. */
msim_status ms_import_nodes_fail_memory(ms_import_nodes *in);

#endif
