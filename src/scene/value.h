/* value - access to the values of a scene file
 *
 * The tree is that of JSON. The many numbers that an importer reads are in columns next to the
 * tree, where an integer is the index of a column. */
#ifndef MS_VALUE_H
#define MS_VALUE_H

#include <jansson.h>

#include "base/memory.h"
#include "msim/importer.h"

/* An array of numbers, or a text, from an importer. */
typedef struct ms_column {
  int32_t kind; /* MSIM_NODE_... */
  int32_t rank;
  int64_t dims[MSIM_NODE_MOST_DIMS];
  void *data;
  int64_t file_rows; /* of which the column has dims[0] */
  size_t first;      /* the number of the file that is its first one */
  size_t begin, end; /* the numbers of the file that `data` has: all, or a part of them */
  void (*read)(struct ms_column *column, size_t at); /* gets the part with number `at`; or NULL */
  void *file;                                        /* where from */
  char *path;
} ms_column;

typedef struct ms_value {
  json_t *json;       /* NULL: missing */
  ms_column *columns; /* NULL: all numbers are in the tree */
  int32_t depth;      /* number of indices applied within the column */
  size_t at;          /* these indices as one: (i_0 dims[1] + i_1) dims[2] + i_2 */
} ms_value;

int ms_value_is_array(ms_value v);
size_t ms_value_size(ms_value v); /* 0 if it is not an array */
ms_value ms_value_item(ms_value v, size_t i);

ms_value ms_value_member(ms_value v, const char *key);

/* These return 0 or NULL if the value is of another kind. */
int ms_value_is_number(ms_value v);
int ms_value_is_whole(ms_value v);
double ms_value_number(ms_value v);
int64_t ms_value_whole(ms_value v);
const char *ms_value_text(ms_value v);

/* The column of a value that is one in itself; NULL: it is not. */
ms_column *ms_value_column(ms_value v);

/* Free the numbers of a column, which are not read again: they may take as much memory as the
 * scene. */
void ms_value_release(ms_value v, const msim_allocator *alloc);

#endif
