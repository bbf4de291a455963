#include "scene/value.h"

ms_column *ms_value_column(ms_value v) {
  return v.columns && json_is_integer(v.json) ? v.columns + json_integer_value(v.json) : NULL;
}

/* The column, if v is a single number in it; else NULL. */
static ms_column *number_in(ms_value v) {
  ms_column *c = ms_value_column(v);
  return c && v.depth == c->rank ? c : NULL;
}

/* The index of a number in the part of the column that is in memory; without memory c->data is
 * NULL. */
static size_t find_number(ms_column *c, size_t at) {
  at += c->first;
  if (at < c->begin || at >= c->end) c->read(c, at);
  return at - c->begin;
}

int ms_value_is_array(ms_value v) {
  const ms_column *c = ms_value_column(v);
  return c ? v.depth < c->rank : json_is_array(v.json);
}

size_t ms_value_size(ms_value v) {
  const ms_column *c = ms_value_column(v);
  if (!c) return json_array_size(v.json);
  return v.depth < c->rank ? (size_t)c->dims[v.depth] : 0;
}

ms_value ms_value_item(ms_value v, size_t i) {
  const ms_column *c = ms_value_column(v);
  if (!c) return (ms_value){json_array_get(v.json, i), v.columns, 0, 0};
  v.at = v.at * (size_t)c->dims[v.depth++] + i;
  return v;
}

ms_value ms_value_member(ms_value v, const char *key) {
  return (ms_value){json_object_get(v.json, key), v.columns, 0, 0};
}

int ms_value_is_number(ms_value v) {
  return ms_value_column(v) ? !!number_in(v) : json_is_number(v.json);
}

int ms_value_is_whole(ms_value v) {
  const ms_column *c = number_in(v);
  return c ? c->kind == MSIM_NODE_WHOLE : !ms_value_column(v) && json_is_integer(v.json);
}

double ms_value_number(ms_value v) {
  ms_column *c = number_in(v);
  if (!c) return ms_value_column(v) ? 0 : json_number_value(v.json);
  const size_t i = find_number(c, v.at);
  if (!c->data) return 0;
  if (c->kind == MSIM_NODE_REAL) return ((const double *)c->data)[i];
  return (double)((const int64_t *)c->data)[i];
}

int64_t ms_value_whole(ms_value v) {
  ms_column *c = number_in(v);
  if (!ms_value_is_whole(v)) return 0;
  if (!c) return json_integer_value(v.json);
  const size_t i = find_number(c, v.at);
  return c->data ? ((const int64_t *)c->data)[i] : 0;
}

const char *ms_value_text(ms_value v) { return json_string_value(v.json); }

void ms_value_release(ms_value v, const msim_allocator *alloc) {
  ms_column *c = ms_value_column(v);
  if (!c) return;
  ms_memory_free(alloc, c->data);
  c->data = NULL;
}
