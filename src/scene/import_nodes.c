#include "scene/import_nodes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_LENGTH = 255 }; /* of a path; "objects/0/k/structural" is shorter */
enum { PART = 1 << 17 };    /* numbers that are read at a time */

msim_status ms_import_nodes_fail_memory(ms_import_nodes *in) {
  return in->status = ms_json_fail_memory(&in->reader);
}

/* "planes/0/normal" in the form used in messages: planes[0].normal */
static ms_key_path readable_path(const char *path) {
  ms_key_path p = {""};
  while (*path) {
    char key[MOST_LENGTH + 1], *end;
    snprintf(key, sizeof key, "%.*s", (int)strcspn(path, "/"), path);
    const unsigned long long i = strtoull(key, &end, 10);
    const int is_index = *p.text && *key >= '0' && *key <= '9' && !*end;
    p = is_index ? ms_json_item_path(p.text, (size_t)i) : ms_json_member_path(p.text, key);
    path += strcspn(path, "/");
    path += *path == '/';
  }
  return p;
}

static msim_status refuse_node(ms_import_nodes *in, const char *path, const char *why) {
  return in->status =
             ms_json_fail(&in->reader, MSIM_ERR_ARG, "%s %s", readable_path(path).text, why);
}

void ms_import_nodes_check_utf8(ms_import_nodes *in, const char *path, const char *text) {
  const int is_utf8 = ms_scene_is_utf8(text);
  if (is_utf8 < 0) ms_import_nodes_fail_memory(in);
  if (is_utf8 == 0) refuse_node(in, path, "is not valid UTF-8");
}

/*------------------------------------- add nodes ------------------------------------------------*/

static int is_valid_node(const msim_node *node) {
  if (!node->path || !*node->path || strlen(node->path) > MOST_LENGTH) return 0;
  if (node->kind == MSIM_NODE_GROUP) return 1;
  if (node->kind < MSIM_NODE_TEXT || node->kind > MSIM_NODE_WHOLE) return 0;
  if (node->rank < 0 || node->rank > MSIM_NODE_MOST_DIMS) return 0;
  if (node->kind == MSIM_NODE_TEXT && node->rank != 1) return 0;
  double count = 1;
  for (int32_t i = 0; i < node->rank; i++) {
    if (node->dims[i] < 0 || node->dims[i] > INT32_MAX) return 0;
    count *= (double)node->dims[i];
  }
  return count < 0x1p62;
}

static size_t count_numbers(int32_t rank, const int64_t *dims) {
  size_t count = 1;
  for (int32_t i = 0; i < rank; i++) count *= (size_t)dims[i];
  return count;
}

/* Room for most rows of the column */
static int provide_room(ms_column *c, size_t most) {
  ms_import_nodes *in = c->file;
  const size_t width = count_numbers(c->rank - 1, c->dims + 1), rows = (size_t)c->dims[0];
  if (!c->data)
    c->data =
        ms_memory_allocate(&in->reader.alloc, (rows < most ? rows : most) * width, sizeof(double));
  if (!c->data)
    ms_error_set(&in->failure, MSIM_ERR_MEMORY, "%s: out of memory for the scene", in->path);
  return c->data != NULL;
}

/* Whole rows, at least one */
static void read_part(ms_column *c, size_t at) {
  ms_import_nodes *in = c->file;
  ms_plugin_host host;
  msim_node node = {.size = sizeof node, .path = c->path, .kind = c->kind, .rank = c->rank};
  const size_t width = count_numbers(c->rank - 1, c->dims + 1),
               end = c->first / width + (size_t)c->dims[0], first = at / width,
               most = width < PART ? PART / width : 1, n = end - first < most ? end - first : most;
  c->begin = first * width, c->end = c->begin + n * width;
  if (!provide_room(c, most) || in->failure.status) return;
  memcpy(node.dims, c->dims, sizeof node.dims);
  node.dims[0] = c->file_rows;
  ms_plugin_init_host(&host, &in->reader.alloc);
  const msim_status status =
      in->table->read(&host.base, in->path, &node, (int64_t)first, (int64_t)n, c->data);
  if (status) ms_plugin_fail(&host, in->path, status < 0 ? status : MSIM_ERR_PLUGIN, &in->failure);
}

static int has_parts(const ms_import_nodes *in, const msim_node *node, size_t count) {
  return in->in_parts && in->table->size > offsetof(msim_importer, read) && in->table->read &&
         node->size > offsetof(msim_node, in_parts) && node->in_parts && node->rank > 0 &&
         node->kind != MSIM_NODE_TEXT && count > PART;
}

/* Allocate a column for the numbers or text of a node, with a final 0; its index as JSON. */
static json_t *new_column(ms_import_nodes *in, const msim_node *node) {
  msim_error inner;
  const size_t size = node->kind == MSIM_NODE_TEXT ? 1 : sizeof(double),
               count = count_numbers(node->rank, node->dims);
  if (ms_memory_reserve(&in->reader.alloc, MS_ARRAY(in->columns), in->n, &in->capacity,
                        (int64_t)in->n + 1, &inner))
    return NULL;
  ms_column *c = &in->columns[in->n];
  *c = (ms_column){.kind = node->kind, .rank = node->rank, .end = count};
  c->file_rows = node->dims[0];
  memcpy(c->dims, node->dims, sizeof c->dims);
  if (has_parts(in, node, count)) {
    c->end = 0, c->read = read_part, c->file = in;
    c->path = ms_memory_copy_string(&in->reader.alloc, node->path);
  } else {
    c->data = ms_memory_allocate(&in->reader.alloc, count + 1, size);
  }
  in->n++; /* also after an error: ms_import_nodes_free frees what is there */
  return c->data || c->path ? json_integer(in->n - 1) : NULL;
}

/* Find the group of the last key of a path, and set *key to that key; NULL: no such group. */
static json_t *find_group(ms_import_nodes *in, const char *path, const char **key) {
  char group[MOST_LENGTH + 1];
  json_t *at = in->root;
  *key = path;
  for (const char *slash; at && (slash = strchr(*key, '/')) != NULL; *key = slash + 1) {
    snprintf(group, sizeof group, "%.*s", (int)(slash - *key), *key);
    at = json_object_get(at, group);
  }
  return at;
}

static msim_status add_node(const msim_tree *tree, const msim_node *node, void **room) {
  ms_import_nodes *in = tree->data;
  const char *key;
  *room = NULL;
  if (in->status) return in->status;
  if (!is_valid_node(node))
    return in->status = ms_json_fail(&in->reader, MSIM_ERR_ARG,
                                     "it contains a node with an invalid path, type or size");
  json_t *group = find_group(in, node->path, &key);
  if (!json_is_object(group)) return refuse_node(in, node->path, "belongs to no group of the file");
  if (json_object_get(group, key)) return refuse_node(in, node->path, "occurs twice");
  ms_import_nodes_check_utf8(in, node->path, key);
  if (in->status) return in->status;
  json_t *value = node->kind == MSIM_NODE_GROUP ? json_object() : new_column(in, node);
  if (!value || json_object_set_new_nocheck(group, key, value))
    return ms_import_nodes_fail_memory(in);
  if (node->kind != MSIM_NODE_GROUP && !in->columns[in->n - 1].read)
    *room = in->columns[in->n - 1].data;
  return MSIM_OK;
}

/*------------------------------------- the whole ------------------------------------------------*/

msim_status ms_import_nodes_load(ms_import_nodes *in, const msim_importer *table,
                                 const char *path) {
  ms_plugin_host host;
  msim_error inner;
  const msim_tree tree = {sizeof tree, add_node, in};
  ms_plugin_init_host(&host, &in->reader.alloc);
  in->table = table, in->path = path;
  in->root = json_object();
  if (!in->root) return ms_import_nodes_fail_memory(in);
  msim_status status = table->load(&host.base, path, &tree);
  if (in->status) return in->status; /* add_node() has already set the message */
  if (status) {
    ms_plugin_fail(&host, path, status, &inner);
    return ms_error_set(in->reader.err, status < 0 ? status : MSIM_ERR_PLUGIN, "%s", inner.text);
  }
  return MSIM_OK;
}

void ms_import_nodes_free(ms_import_nodes *in) {
  json_decref(in->root);
  for (int32_t i = 0; i < in->n; i++)
    MS_FREE(&in->reader.alloc, in->columns[i].data, in->columns[i].path);
  ms_memory_free(&in->reader.alloc, in->columns);
}
