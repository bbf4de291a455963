/* value - a value in the tree of a scene file
 *
 * The tree is JSON's. An importer reads numbers by the million: they stand beside the tree in
 * columns, and a whole number in the tree is the index of one. */
#ifndef MS_VALUE_H
#define MS_VALUE_H

#include <jansson.h>

#include "msim/importer.h"

/* Numbers as an importer read them. */
typedef struct ms_column {
  int32_t kind; /* MSIM_NODE_... */
  int32_t rank;
  int64_t dims[MSIM_NODE_MOST_DIMS];
  void *data;
} ms_column;

typedef struct ms_value {
  json_t *json;             /* NULL: it is not there */
  const ms_column *columns; /* NULL: all numbers are in the tree */
  int32_t depth;            /* indices taken within a column */
  size_t at;                /* its first number, counted in the column */
} ms_value;

int ms_value_is_array(ms_value v);
size_t ms_value_size(ms_value v); /* 0 where it is no array */
ms_value ms_value_item(ms_value v, size_t i);

ms_value ms_value_member(ms_value v, const char *key);

/* 0 and NULL where it is of another kind. */
int ms_value_is_number(ms_value v);
int ms_value_is_whole(ms_value v);
double ms_value_number(ms_value v);
int64_t ms_value_whole(ms_value v);
const char *ms_value_text(ms_value v);

#endif
